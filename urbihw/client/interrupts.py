"""Ctrl-C beside a blocking connection: it interrupts waiting, and nothing that must not be left half done.

Python runs a handler of a signal between any two steps of the main thread, also between the taking of a lock and the
block that releases it.  A connection that was left so would not answer the ``robot.stop()`` of an ``except``.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Any

_set_handler: Callable[[int, Any], Any] = getattr(signal.signal, "__wrapped__", signal.signal)
"""Without the conversion to members of enumerations, which takes longer than the call."""


def _in_main() -> bool:
    return threading.get_ident() == _main


def _note_main() -> None:
    global _main
    _main = threading.main_thread().ident


_main: int | None
_note_main()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_note_main)


class Deferral:
    """While a block runs, the handler of SIGINT waits for its end, or for a block ``waiting`` in it.

    Only in the main thread, where handlers run; elsewhere both blocks do nothing.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._waits = 0
        self._pending = False
        self._handler: Callable[[int, FrameType | None], Any] | None = None
        self.waiting = _Waiting(self)

    def __enter__(self) -> None:
        if not _in_main():
            return
        if self._depth == 0:
            self._waits = 0  # an interrupt in the last step of waiting leaves it
            handler = _set_handler(signal.SIGINT, self._hear)
            self._handler = handler if callable(handler) else None
            if self._handler is None:  # SIGINT is ignored, or ends the program at once
                _set_handler(signal.SIGINT, handler)
        self._depth += 1

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if not _in_main():
            return
        self._depth -= 1
        if self._depth == 0 and self._handler is not None:
            present = _set_handler(signal.SIGINT, self._handler)
            if present != self._hear:  # the program has set another one meanwhile
                _set_handler(signal.SIGINT, present)
            self._deliver()

    def _hear(self, number: int, frame: FrameType | None) -> None:
        self._pending = True
        if self._waits:
            self._deliver()

    def _deliver(self) -> None:
        if self._pending and self._handler is not None:
            self._pending = False
            self._handler(signal.SIGINT, None)

    def begin_wait(self) -> None:
        """An interrupt may come from now on."""
        if _in_main():
            self._waits += 1
            self._deliver()

    def end_wait(self) -> None:
        """An interrupt has to wait again."""
        if _in_main():
            self._waits -= 1


class _Waiting:
    """A block that an interrupt may end."""

    def __init__(self, deferral: Deferral) -> None:
        self._deferral = deferral

    def __enter__(self) -> None:
        try:
            self._deferral.begin_wait()
        except BaseException:
            self._deferral.end_wait()
            raise

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._deferral.end_wait()


DEFERRAL = Deferral()
"""The one deferral of the process, which has one handler."""
