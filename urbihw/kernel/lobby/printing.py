"""What a client is shown of values and errors, though other programs may have changed how the library prints.

All connections share the slots that print (``record.PRINTING``).  As long as they are the library's own, nothing is
done here.  Else a printing may fail or take for ever, in the connection of somebody who knows nothing of it: what
cannot print any more is put back, a value whose printing fails is shown plainly too, and a printing that takes longer
than ``LIMIT`` seconds is given up, and the library's own slots are put back.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, TypeVar

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import stack_of
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.code import Code, Executable
from urbihw.kernel.runtime.plain import plain_error, plain_text
from urbihw.kernel.runtime.record import listed
from urbihw.kernel.sched.errors import HeldTooLong
from urbihw.kernel.sched.signals import StopTag
from urbihw.kernel.sched.tag import Tag

if TYPE_CHECKING:
    from urbihw.kernel.lobby.lobby import Lobby
    from urbihw.kernel.runtime.world import World

T = TypeVar("T")
LIMIT: Final = 1.0
"""Seconds that a changed way of printing may take."""
MOST_SHOWN: Final = 1_000_000
"""How many characters are shown of a value; of a Binary all, since its head says how many follow."""


def show(lobby: Lobby, value: Any) -> None:
    """Print a value of the top level, in the running job.  Raises what printing it raises."""
    world = lobby.world
    if _is_changed(world):
        try:
            text = _in_time(lobby, lambda: world.shown(value), lambda: world.shown(value))
        except errors.UrbiError as error:
            lobby.report(error)
            text = plain_text(world, value)
    else:
        text = world.shown(value)
    if len(text) <= MOST_SHOWN or isinstance(value, BinaryObject):
        lobby.output.line(text)
        return
    lobby.output.line(text[:MOST_SHOWN])
    lobby.output.line(f"!!! of a value of {len(text)} characters only {MOST_SHOWN} are shown", "error")


def described(lobby: Lobby, error: BaseException) -> list[str]:
    """The lines that tell of an uncaught error, without the leading marks.  Never fails."""
    world = lobby.world
    if not _is_changed(world):
        return world.describe(error)
    if isinstance(error, HeldTooLong):
        _put_back(lobby, _runs_none_of(error))
    urbi = world.normalized(error)
    plain = plain_error(world, urbi, stack_of(urbi, world.hide_system))
    if isinstance(urbi, errors.Raised) or world.scheduler.current is None:
        return plain
    return _in_time(lobby, lambda: world.describe(urbi), lambda: plain)


def _is_changed(world: World) -> bool:
    """Whether printing still is another one, after what was removed is put back."""
    record = world.record
    if record.reprinted:
        record.mend_printing(lambda now: isinstance(now, Executable))
    return record.reprinted


def _in_time(lobby: Lobby, action: Callable[[], T], instead: Callable[[], T]) -> T:
    """What ``action`` gives, or ``instead`` if it takes too long: then the library prints as it did again."""
    scheduler = lobby.world.scheduler
    began = scheduler.clock.now()
    tag = Tag(scheduler, "printing")
    entry = tag.enter()
    timer = scheduler.call_at(began + LIMIT, lambda: tag.stop(lobby.world.void))
    late = False
    try:
        return action()
    except StopTag as signal:
        if signal.entry is not entry:
            raise
        late = True
    except HeldTooLong:
        late = True
    finally:
        timer.cancel()
        tag.leave(entry)
        if late or scheduler.clock.now() - began > LIMIT:
            _put_back(lobby, lambda now: False)
    return instead()


def _put_back(lobby: Lobby, may_stay: Callable[[Any], bool]) -> None:
    names = lobby.world.record.mend_printing(may_stay)
    if names:
        lobby.output.line(f"*** urbihw: put back in the library, since printing took too long: {listed(names)}")


def _runs_none_of(error: BaseException) -> Callable[[Any], bool]:
    """Whether a function is none of those that an error went through."""
    codes, tb = set(), error.__traceback__
    while tb is not None:
        codes.add(tb.tb_frame.f_code)
        tb = tb.tb_next
    return lambda now: not isinstance(now, Code) or getattr(now.fn, "__code__", None) not in codes
