"""The console of ``urbi``: a lobby that writes to standard output and, if interactive, reads standard input."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import Callable, Iterable
from typing import Final

from urbihw.exitcodes import EX_RUNTIME, EX_SYNTAX
from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.lobby.output import Output
from urbihw.kernel.process import KernelProcess

CHUNK: Final = 64 * 1024


class _ErrorRecorder(Output):
    """An output that records the first error, for the exit code."""

    def __init__(self, kernel: Kernel) -> None:
        super().__init__(kernel.scheduler, lambda: None)
        self.code = 0
        self.watching = True

    def line(self, text: str, channel: str = "") -> None:
        """Send one line; the first error determines the exit code."""
        if self.watching and channel == "error" and text.startswith("!!! ") and not self.code:
            self.code = EX_SYNTAX if ": syntax error: " in text else EX_RUNTIME
        super().line(text, channel)


class Terminal:
    """The lobby of the process itself.

    The process ends with standard input.  ``on_quit`` is called when ``quit`` has ended the console: the server goes on
    without it.
    """

    def __init__(self, process: KernelProcess) -> None:
        self._process = process
        kernel = process.kernel
        self._reading = False
        self.on_quit: Callable[[], None] = lambda: None
        self.lobby: Lobby = kernel.open_lobby()
        self._output = _ErrorRecorder(kernel)
        self._output.write(self.lobby.output.take_bytes())
        self.lobby.output = self._output
        self.lobby.on_quit = self._quit
        kernel.scheduler.add_round_hook(self._flush)

    @property
    def code(self) -> int:
        """The exit code of the texts of the command line: 0, 65 or 70."""
        return self._output.code

    def feed(self, text: bytes) -> None:
        """Run a text as if it had been typed."""
        self.lobby.feed(text)

    def idle(self) -> asyncio.Future[None]:
        """A future that is done when all texts fed so far have run."""
        done: asyncio.Future[None] = asyncio.get_running_loop().create_future()

        def set_idle() -> None:
            if not done.done():
                done.set_result(None)

        self.lobby.shell.when_idle(set_idle)
        return done

    def start(self, texts: Iterable[bytes], interactive: bool) -> None:
        """Run the texts of the command line; then read standard input, if ``interactive``."""
        for text in texts:
            self.lobby.feed(text)
        if interactive:
            self.lobby.shell.when_idle(self._stop_watching)
            self._reading = True
            self._begin_to_read()

    def _stop_watching(self) -> None:
        self._output.watching = False

    def _begin_to_read(self) -> None:
        loop = asyncio.get_running_loop()
        if sys.stdin is None:
            loop.call_soon(self._end_of_input)
            return
        try:
            loop.add_reader(sys.stdin.fileno(), self._read)
        except PermissionError:
            # epoll does not support a plain file and /dev/null, which are always ready.
            loop.call_soon(self._read_on)

    def _read(self) -> bool:
        """Read from standard input; true if there may be more."""
        try:
            data = os.read(sys.stdin.fileno(), CHUNK)
        except BlockingIOError:
            return True
        except OSError:
            data = b""
        if not data:
            self._end_of_input()
        elif self._reading:
            self.lobby.feed(data)
        self._process.drive()
        return bool(data)

    def _read_on(self) -> None:
        if self._reading and self._read():
            asyncio.get_running_loop().call_soon(self._read_on)

    def _end_of_input(self) -> None:
        """Handle the end of input: Ctrl-D ends the session at once, a pipe or file when all its statements have run."""
        if not self._reading:
            return
        self._stop_reading()
        if sys.stdin is not None and sys.stdin.isatty():
            self._process.stop()
        else:
            self._process.kernel.post(lambda: self.lobby.shell.when_idle(self._process.stop))

    def _stop_reading(self) -> None:
        self._reading = False
        if sys.stdin is not None:
            asyncio.get_running_loop().remove_reader(sys.stdin.fileno())

    def _quit(self) -> None:
        self._flush()
        if self._reading:
            self._stop_reading()
        self.on_quit()

    def _flush(self) -> None:
        """Write the output of the lobby; end the session if the reader of standard output has ended."""
        data = self._output.take_bytes()
        if not data:
            return
        try:
            sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()
        except BrokenPipeError:
            self._output.close()
            # The flush of Python at exit must not fail, too.
            with contextlib.suppress(OSError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            self._process.stop()

    def close(self) -> None:
        """Write the remaining output, and stop reading."""
        self._flush()
        if self._reading:
            self._stop_reading()
