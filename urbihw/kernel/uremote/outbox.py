"""The output of a remote, in order: text or frames, collected per round; values of variables may wait for a congested
link.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable
from typing import Any

from urbihw.kernel.uremote.frames import SIZES, EmitRequest, Frame, ProgramText, Result, StringTooLong, Update, encode
from urbihw.kernel.uremote.remote import literal, quoted

log = logging.getLogger("urbihw.remote")

Part = bytes | memoryview


class Outbox:
    """The output queue.  It discards everything while closed, because a new connection starts with announcing
    everything.

    While ``congested()``, only the latest value of each variable is kept; it is sent by ``drained``.
    """

    def __init__(self, write: Callable[[list[Part]], None]) -> None:
        self._write = write
        self._parts: list[Part] = []
        self._frames = False
        self._open = False
        self._late: dict[str, tuple[Callable[[], Any], int]] = {}
        self.congested: Callable[[], bool] = lambda: False

    def reset(self) -> None:
        """Start a new connection, in text mode."""
        self._open, self._frames = True, False
        self._parts.clear()
        self._late.clear()

    def close(self) -> None:
        """The connection has ended."""
        self._open = False
        self._parts.clear()
        self._late.clear()

    def binary(self, on: bool) -> None:
        """Switch to frames or back to text."""
        if on:
            self.flush()
            self._frames = True
            self._parts.append(SIZES)

    def flush(self) -> None:
        """Send the collected output."""
        if self._late and not self.congested():
            late, self._late = self._late, {}
            for name, (value, stamp) in late.items():
                self.update(name, value, stamp)
        if self._parts:
            parts, self._parts = self._parts, []
            self._write(parts)

    # ---------------------------------------------------------------- saying

    def add_statement(self, statement: str) -> None:
        """Send one statement, whose result is not printed."""
        self._text(f"{statement}|;\n")

    def background(self, statement: str) -> None:
        """Send one statement that runs in the background."""
        self._text(f"{statement},\n")

    def chain(self, statements: Iterable[str]) -> None:
        """Send statements that are run as one."""
        text = "|".join(statements)
        if text:
            self.add_statement(text)

    def answer(self, ticket: str, value: Any) -> None:
        """Send the result of a call."""
        if self._frames:
            self._frame(Result(ticket, value))
        elif value is None:
            self.add_statement(f"Global.UObject.funCall({quoted(ticket)})")
        else:
            self._put(b"Global.UObject.funCall(" + quoted(ticket).encode() + b", " + literal(value) + b"),\n")

    def emit(self, name: str, payload: list[Any]) -> None:
        """Send an emission of an event."""
        if self._frames:
            self._frame(EmitRequest(name, payload))
        else:
            values = b", ".join(literal(value) for value in payload)
            self._put(name.encode() + b"!(" + values + b")|;\n")

    def update(
        self, name: str, value: Callable[[], Any], stamp: int, other: Callable[[Update], bool] | None = None
    ) -> None:
        """Send the value of a variable, by the ``other`` transport if it accepts the value; void is not sent."""
        if other is not None and self._open and other(Update(name, value(), stamp)):
            return
        if self.congested():
            self._late[name] = (value, stamp)
            return
        made = value()
        if made is None:
            return
        try:
            if self._frames:
                self._frame(Update(name, made, stamp))
            else:
                path, _, slot = name.rpartition(".")
                head = f'{path}.getSlot("{slot}").update_timed('.encode()
                self._put(head + literal(made) + f", {stamp})|;\n".encode())
        except (StringTooLong, TypeError) as error:
            log.error("value of %s not sent: %s", name, error)

    def _text(self, text: str) -> None:
        if not self._frames:
            self._put(text.encode("latin-1", "replace"))
            return
        try:
            self._frame(ProgramText(text))
        except StringTooLong as error:
            log.error("statement not sent: %s: %.60s", error, text)

    def _frame(self, frame: Frame) -> None:
        if self._open:
            self._parts += encode(frame)

    def _put(self, part: bytes) -> None:
        if self._open:
            self._parts.append(part)
