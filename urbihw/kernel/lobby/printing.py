"""Printing of values and errors for a client, even if other programs have changed the printing slots.

All connections share the printing slots (``record.PRINTING``).  While they are unchanged, this module does nothing
special.  Changed slots may fail or never return in the connection of another client.  So slots that cannot print any
more are restored, a value whose printing fails is printed as plain text, and printing that takes longer than
``PRINTING_TIMEOUT_S`` is cancelled and the slots are restored.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final, TypeVar

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import stack_of
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.code import Executable
from urbihw.kernel.runtime.plain import plain_error, plain_text
from urbihw.kernel.runtime.record import listed
from urbihw.kernel.sched.errors import HeldTooLong
from urbihw.kernel.sched.signals import StopTag
from urbihw.kernel.sched.tag import Tag

if TYPE_CHECKING:
    from urbihw.kernel.lobby.lobby import Lobby
    from urbihw.kernel.runtime.world import World

T = TypeVar("T")
PRINTING_TIMEOUT_S: Final = 1.0
"""Maximum duration of printing with changed slots."""
MAX_SHOWN_LENGTH: Final = 1_000_000
"""Maximum number of printed characters of a value; a Binary is printed in full, since its header has the length."""


def show(lobby: Lobby, value: Any) -> None:
    """Print a top-level value, in the running job.  Raises the errors of printing."""
    world = lobby.world
    if _is_changed(world):
        try:
            text = _run_with_timeout(lobby, lambda: world.shown(value), lambda: world.shown(value))
        except errors.ThrownError as error:
            lobby.report(error)
            text = plain_text(world, value)
    else:
        text = world.shown(value)
    if len(text) <= MAX_SHOWN_LENGTH or isinstance(value, BinaryObject):
        lobby.output.line(text)
        return
    lobby.output.line(text[:MAX_SHOWN_LENGTH])
    lobby.output.line(f"!!! of a value of {len(text)} characters only {MAX_SHOWN_LENGTH} are shown", "error")


def described(lobby: Lobby, error: BaseException) -> list[str]:
    """The lines that report an uncaught error, without the leading ``!!!``.  Never fails."""
    world = lobby.world
    if not _is_changed(world):
        return world.describe(error)
    urbi = world.normalized(error)
    plain = plain_error(world, urbi, stack_of(urbi, world.hide_system))
    if isinstance(urbi, errors.Raised) or world.scheduler.current is None:
        return plain
    return _run_with_timeout(lobby, lambda: world.describe(urbi), lambda: plain)


def _is_changed(world: World) -> bool:
    """Whether printing is still changed after removed slots were restored."""
    record = world.record
    if record.printing_changed:
        record.restore_printing(lambda now: isinstance(now, Executable))
    return record.printing_changed


def _run_with_timeout(lobby: Lobby, action: Callable[[], T], instead: Callable[[], T]) -> T:
    """The result of ``action``, or ``instead`` if it takes too long; the printing slots are restored then."""
    scheduler = lobby.world.scheduler
    began = scheduler.clock.now()
    tag = Tag(scheduler, "printing")
    entry = tag.enter()
    timer = scheduler.call_at(began + PRINTING_TIMEOUT_S, lambda: tag.stop(lobby.world.void))
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
        if late or scheduler.clock.now() - began > PRINTING_TIMEOUT_S:
            _put_back(lobby, lambda now: False)
    return instead()


def _put_back(lobby: Lobby, may_stay: Callable[[Any], bool]) -> None:
    names = lobby.world.record.restore_printing(may_stay)
    if names:
        lobby.output.line(f"*** urbihw: put back in the library, since printing took too long: {listed(names)}")
