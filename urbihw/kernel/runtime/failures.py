"""Conversion of errors: any Python exception to an urbiscript one, to its value for ``catch``, and to its text for
users.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import Stack, failed_in_program, note_stack, stack_of
from urbihw.kernel.runtime.binary import BinaryObject
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.plain import plain_error
from urbihw.kernel.runtime.record import listed
from urbihw.kernel.runtime.unread import locate_later, make_unread
from urbihw.kernel.sched.errors import HeldTooLong, TooManyJobs
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.kernel")


class Failures:
    """The errors of one world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._showing = False
        """Whether a value is being printed for a message, which may fail too."""

    def type_error(
        self, index: int | None, value: Value, expected: str, routine: str | None = ""
    ) -> errors.ThrownError:
        """``routine: unexpected VALUE for argument INDEX, expected a TYPE``."""
        if value is self._world.void:
            return errors.unexpected_void()
        where = "" if index is None else f" for argument {index}"
        article = "an" if expected[:1] in "AEIOU" else "a"
        message = f"unexpected {self._shown(value)}{where}, expected {article} {expected}"
        wanted = self._world.classes.get(expected, expected)
        if index is None:
            return errors.Raised("Type", message, routine, effective=value, expected=wanted)
        return errors.Raised("ArgumentType", message, routine, index=index, effective=value, expected=wanted)

    def _shown(self, value: Value) -> str:
        """``printable``, or a plain text when printing the value has failed."""
        if isinstance(value, BinaryObject):  # the content may be a picture of a megabyte
            return f"BIN {len(value.content)} {value.keywords}".rstrip()
        if self._showing:
            return f"{self._world.type_name(value)}_{self._world.uid(value)}"
        self._showing = True
        try:
            return self._world.printable(value)
        finally:
            self._showing = False

    def normalized(self, error: BaseException) -> errors.ThrownError:
        """Any Python exception as an urbiscript one; an exception that is no error of urbiscript is logged as an
        internal error.
        """
        if isinstance(error, errors.ThrownError):
            return error
        if isinstance(error, ZeroDivisionError):
            raised: errors.ThrownError = errors.Raised("Primitive", "division by 0", "/")
        elif isinstance(error, RecursionError):
            raised = errors.Raised("Scheduling", "stack exhausted", None)
        elif isinstance(error, TooManyJobs | HeldTooLong):
            if isinstance(error, HeldTooLong):
                self._restore_held(error)
            raised = errors.Raised("Scheduling", str(error), None)
        elif isinstance(error, MemoryError):
            raised = errors.Raised("Scheduling", "memory exhausted", None)
        elif isinstance(error, OSError):
            raised = errors.primitive(error.strerror or str(error), None)
        else:
            log.error("bug in urbihw: %s: %s", type(error).__name__, error)
            log.debug("traceback of the bug", exc_info=error)
            raised = errors.primitive(f"internal error ({type(error).__name__}), please report it: {error}", None)
        return raised.with_traceback(error.__traceback__)

    def _restore_held(self, error: HeldTooLong) -> None:
        """Put back functions of the library in whose place a program has put those that held the interpreter: at once,
        since to report the error may run them again.
        """
        codes, tb = set(), error.__traceback__
        while tb is not None:
            codes.add(tb.tb_frame.f_code)
            tb = tb.tb_next
        names = self._world.record.restore_held(codes)
        job = self._world.scheduler.current
        if names and job is not None and job.context is not None:
            told = f"*** urbihw: put back in the library, since it held the interpreter: {listed(names)}"
            job.context.output.line(told)

    def caught(self, error: BaseException) -> Any:
        """The urbiscript value of a caught error; Exceptions get their location and backtrace, when they are read."""
        return self._caught(error if isinstance(error, errors.ThrownError) else self.normalized(error), note_stack)

    def _caught(self, urbi: errors.ThrownError, note: Callable[[BaseException, bool], Callable[[], Stack]]) -> Any:
        """The value of an error; ``note`` finds its call stack, if it is needed."""
        value, world = urbi.value, self._world
        if isinstance(urbi, errors.Raised):
            if value is None:
                value = urbi.value = make_unread(world, urbi, note(urbi, world.hide_system))
        elif isinstance(value, Obj) and world.is_a(value, world.exception_proto) and "backtrace" not in value.slots:
            locate_later(value, note(urbi, world.hide_system))
        return value

    def describe(self, error: BaseException) -> list[str]:
        """The lines that report an uncaught error to a user, without the leading ``!!!``.

        Never fails, although it may run functions of a program: an error in such a function is reported instead, and
        where the library itself cannot print any more, the text is plain.
        """
        try:
            return self._described(error)
        except Exception as second:
            if failed_in_program(second):
                with contextlib.suppress(Exception):
                    return self._described(second)
        urbi = self.normalized(error)
        return plain_error(self._world, urbi, stack_of(urbi, self._world.hide_system))

    def _described(self, error: BaseException) -> list[str]:
        urbi = self.normalized(error)
        stack = stack_of(urbi, self._world.hide_system)
        value = self._caught(urbi, lambda urbi, hide_system: lambda: stack)
        if isinstance(value, Obj) and self._world.is_a(value, self._world.exception_proto):
            lines = [self.located_exception_text(value)]
            if stack.routine and self._slot_text(value, "loc"):  # a syntax error in a text that was being evaluated
                lines.append(f"   called from: {self._slot_text(value, 'location')}: {stack.routine}")
        else:
            lines = [self._world.text(value)]
        return lines + stack.lines()

    def located_exception_text(self, value: Value) -> str:
        """``place: routine: message`` of an Exception, without what is unknown; the place of a syntax error is that in
        the text."""
        loc = self._slot_text(value, "loc")
        place = loc or self._slot_text(value, "location")
        routine = "syntax error" if loc else self._slot_text(value, "routine")
        message = self._world.text(self._world.send(value, "message"))
        return "".join([f"{part}: " for part in (place, routine) if part]) + message

    def _slot_text(self, value: Value, name: str) -> str:
        holder = self._world.as_obj(value).find(name)
        content = None if holder is None else holder.slots[name]
        if content is None or content is self._world.void or content is self._world.nil:
            return ""
        return self._world.text(content)
