"""The entry points of the commands.

Each imports the module of its command when it is called: the imports take a good part of a second, and Ctrl-C must end
a command without a traceback also during them.  So this module imports nothing that takes long.  A stop does not even
wait for the parser of options.
"""

from __future__ import annotations

import os
import sys

from urbihw.exitcodes import INTERRUPTED

TYPE_CHECKING = False  # as ``typing`` has it, whose import a stop cannot wait for
if TYPE_CHECKING:
    from collections.abc import Callable

MODULES = {
    "urbihw": "urbihw.cli.main",
    "urbi": "urbihw.cli.urbi",
    "urbi_launch": "urbihw.cli.launch",
    "urbi_send": "urbihw.cli.send",
    "urbi_image": "urbihw.cli.image",
    "urbi_sound": "urbihw.cli.sound",
    "urbi_ping": "urbihw.cli.ping",
}
"""Entry point -> the module with the ``main`` of the command."""
AT_ONCE = ("stop", "estop", "release")
"""Subcommands of ``urbihw`` that ``urbihw.cli.control`` runs by itself."""
PRIORITY = -10
"""The niceness of a stop."""
PIPE_CLOSED = 141
"""Exit code after the reader of standard output has gone: 128 + SIGPIPE, as shells have it."""


def guarded(work: Callable[[], int | None]) -> int | None:
    """Run a command: Ctrl-C, and a reader of a pipe who has enough, end it without a traceback."""
    try:
        code = work()
        sys.stdout.flush()
    except KeyboardInterrupt:  # while modules are imported, or before a command has its own handler
        return INTERRUPTED
    except BrokenPipeError:  # the reader of a pipe, such as head, has enough
        with open(os.devnull, "w") as nowhere:
            # What is still in the buffer must not fail when Python ends.
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
        return PIPE_CLOSED
    return code


def _run(command: str) -> int:
    try:
        from urbihw.cli.program import program

        code: int = program(MODULES[command]).main()
    except KeyboardInterrupt:
        return INTERRUPTED
    return code


def _stop() -> int | None:
    try:
        # Before a busy machine lets this process wait; only root, and users with the limit RLIMIT_NICE, may.
        os.setpriority(os.PRIO_PROCESS, 0, PRIORITY)
    except OSError:
        pass
    from urbihw.cli import control

    return control.run_at_once(sys.argv[1:])


def urbihw() -> int:
    """``urbihw``; returns the exit code, as the others do."""
    code = guarded(_stop) if sys.argv[1:2] and sys.argv[1] in AT_ONCE else None
    return _run("urbihw") if code is None else code


def urbi() -> int:
    """``urbi``."""
    return _run("urbi")


def urbi_launch() -> int:
    """``urbi-launch``."""
    return _run("urbi_launch")


def urbi_send() -> int:
    """``urbi-send``."""
    return _run("urbi_send")


def urbi_image() -> int:
    """``urbi-image``."""
    return _run("urbi_image")


def urbi_sound() -> int:
    """``urbi-sound``."""
    return _run("urbi_sound")


def urbi_ping() -> int:
    """``urbi-ping``."""
    return _run("urbi_ping")
