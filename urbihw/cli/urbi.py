"""``urbi``: an urbiscript server, with the options of the original (manual, section 18.3).

Exit codes: 0 after ``shutdown``, 64 unknown option, 66 a script is missing, 69 cannot listen, 70 our fault.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import os
import signal
import sys
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import NoReturn

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.server.loop import Driver
from urbihw.kernel.server.tcp import Server

EX_USAGE, EX_NOINPUT, EX_UNAVAILABLE = 64, 66, 69


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        self.exit(EX_USAGE, f"{self.prog}: {message}\n")


class _Source(argparse.Action):
    """Collects -e and -f in the order in which they were given."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        namespace.sources.append((self.const, values))


def parser() -> argparse.ArgumentParser:
    """The options of ``urbi``."""
    made = _Parser(prog="urbi", description="Run an urbiscript server.")
    made.add_argument("-e", "--expression", action=_Source, const="text", dest="sources", default=[], metavar="EXP",
                      help="run EXP")
    made.add_argument("-f", "--file", action=_Source, const="file", dest="sources", metavar="FILE", help="run FILE")
    made.add_argument("-i", "--interactive", action="store_true", help="read and run standard input")
    made.add_argument("-P", "--port", type=int, default=-1, help="listen on PORT (0: any free one)")
    made.add_argument("-H", "--host", default="127.0.0.1", help="the address to listen on (default: %(default)s)")
    made.add_argument("-w", "--port-file", metavar="FILE", help="write the port to FILE when ready")
    made.add_argument("-q", "--quiet", action="store_true", help="no banner")
    made.add_argument("-F", "--fast", action="store_true", help="simulated time: sleeping costs nothing")
    made.add_argument("--version", action="version", version=f"urbihw {version('urbihw')}")
    made.add_argument("script", nargs="?", help="a file to run; what follows is System.arguments")
    made.add_argument("arguments", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    options = parser().parse_args(argv)
    logging.basicConfig(format="urbi: %(message)s", level=logging.WARNING)
    sources = list(options.sources)
    if options.script is not None:
        sources.append(("file", options.script))
    if not sources and options.port < 0:
        options.interactive = True
    try:
        texts = [_text(kind, value) for kind, value in sources]
    except OSError as error:
        print(f"urbi: failed to process file {error.filename}: {error.strerror}", file=sys.stderr)
        return EX_NOINPUT
    return asyncio.run(_serve(options, texts))


def _text(kind: str, value: str) -> bytes:
    if kind == "text":
        return value.encode()
    data = sys.stdin.buffer.read() if value == "-" else Path(value).read_bytes()
    if data.startswith(b"#!"):
        data = b"//" + data
    name = value.replace("\\", "\\\\").replace('"', '\\"')
    return f'//#push 1 "{name}"\n'.encode() + data + b"\n//#pop\n"


async def _serve(options: argparse.Namespace, texts: list[bytes]) -> int:
    kernel = Kernel(fast=options.fast)
    driver = Driver(kernel.scheduler)
    stopped = asyncio.get_running_loop().create_future()

    def stop(code: int = 0) -> None:
        if not stopped.done():
            stopped.set_result(code)

    programs = kernel.programs
    programs.shutdown = stop
    programs.name = sys.argv[0]
    programs.arguments = list(options.arguments)
    programs.quiet = options.quiet
    server = Server(driver, kernel.open_lobby)
    console = Console(kernel, driver)
    port = -1
    if options.port >= 0:
        try:
            port = await server.listen(options.host, options.port)
        except OSError as error:
            print(f"urbi: cannot listen to port {options.host}:{options.port}: {error.strerror}", file=sys.stderr)
            return EX_UNAVAILABLE
    programs.listen_port = port
    if options.port_file:
        Path(options.port_file).write_text(f"{port}\n")
    console.start(texts, options.interactive)
    asyncio.get_running_loop().add_signal_handler(signal.SIGINT, stop)
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stop)
    driver.drive()
    code = await stopped
    console.flush()
    driver.close()
    await server.close()
    return int(code)


class Console:
    """The lobby of standard input and output."""

    def __init__(self, kernel: Kernel, driver: Driver) -> None:
        self._kernel = kernel
        self._driver = driver
        self.lobby: Lobby = kernel.open_lobby(None, lambda lobby: None)
        kernel.scheduler.add_round_hook(self.flush)

    def start(self, texts: list[bytes], interactive: bool) -> None:
        """Run the texts given on the command line; then read standard input, if wanted."""
        for text in texts:
            self.lobby.feed(text)
        if interactive:
            asyncio.get_running_loop().add_reader(sys.stdin.fileno(), self._read)

    def _read(self) -> None:
        data = os.read(sys.stdin.fileno(), 65536)
        if data:
            self.lobby.feed(data)
        else:
            asyncio.get_running_loop().remove_reader(sys.stdin.fileno())
            self._kernel.post(self._end_of_input)
        self._driver.drive()

    def _end_of_input(self) -> None:
        self.lobby.shell.when_idle(self._kernel.programs.shutdown)

    def flush(self) -> None:
        """Write what the console lobby said."""
        data = self.lobby.output.take()
        if data:
            sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()


if __name__ == "__main__":
    sys.exit(main())
