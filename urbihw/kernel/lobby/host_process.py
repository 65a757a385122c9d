"""The process in which programs run, as they see it by ``System``."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from urbihw.frozen import frozen


@frozen
class HostProcess:
    """What the owner of a kernel gives to its programs.

    Attributes:
        name: ``System.programName``, the path by which the process was called.
        arguments: ``System.arguments``.
        shutdown: begins an orderly shutdown of the process.
        reboot: the same, and a restart; None if the process cannot restart itself.
    """

    name: str = "urbi"
    arguments: Sequence[str] = ()
    shutdown: Callable[[], None] = lambda: None
    reboot: Callable[[], None] | None = None
