"""The entry points of the commands.

Each imports the module of its command when it is called: the imports take a good part of a second, and Ctrl-C must end
a command without a traceback also during them.  So this module imports nothing that takes long.
"""

from __future__ import annotations

from importlib import import_module

from urbihw.exitcodes import INTERRUPTED

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


def _run(command: str) -> int:
    try:
        code: int = import_module(MODULES[command]).main()
    except KeyboardInterrupt:
        return INTERRUPTED
    return code


def urbihw() -> int:
    """``urbihw``; returns the exit code, as the others do."""
    return _run("urbihw")


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
