"""What Lobby tells of the program: banner, license, authors, copyright, thanks.

Source: manual, specs/lobby; server protocol, section 1, for the shape of the banner.
"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.channel import starred
from urbihw.kernel.stdlib.lobby import real

TABLE = Table("Lobby")

ROW = "*" * 56
COPYRIGHT = "Copyright (C) 2026 the urbihw authors"
WARRANTY = (
    "This program comes with ABSOLUTELY NO WARRANTY.  It can",
    "be used under certain conditions.  Type `license;',",
    "`authors;', or `copyright;' for more information.",
)
LICENSE = (
    "urbihw is distributed under the BSD 3-clause license:",
    "you may use, change and pass it on, in source or binary form, if you keep",
    "the copyright notice, the list of conditions and the disclaimer, and do not",
    "use the names of its authors to endorse what you derive from it.",
)


def release() -> str:
    """Name and version of the program."""
    # imported when somebody asks: it takes a tenth of the time that the whole library takes to start
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f"urbihw {version('urbihw')}"
    except PackageNotFoundError:
        return "urbihw (not installed)"


def _tell(this: Any, *lines: str) -> None:
    output = real(this).output
    for line in lines:
        output.line(starred(line))


@TABLE.primitive("banner")
def banner(world: World, this: Any) -> None:
    """Say what greets a new connection."""
    _tell(this, ROW, f"{release()}: robots as urbiscript objects", COPYRIGHT, "", *WARRANTY, "",
          "Every robot is a slot of Global; see the docs folder.", ROW)


@TABLE.primitive("copyright")
def copyright_(world: World, this: Any, deep: bool = True) -> None:
    """Say the version and whose it is; if ``deep``, also of the language it speaks."""
    _tell(this, release(), COPYRIGHT)
    if deep:
        _tell(this, "", "urbiscript 2.3, as described in the Urbi SDK manual", "Copyright (C) 2005-2010 Gostai S.A.S.")


@TABLE.primitive("license")
def license_(world: World, this: Any) -> None:
    """Say under which conditions the program may be used."""
    _tell(this, *LICENSE)


@TABLE.primitive("authors")
def authors(world: World, this: Any) -> None:
    """Say who made the program."""
    _tell(this, "urbihw: the urbihw authors", "urbiscript: Jean-Christophe Baillie and the Urbi team of Gostai")


@TABLE.primitive("thanks")
def thanks(world: World, this: Any) -> None:
    """Say what the program is built on."""
    _tell(this, "Python, lark, greenlet, pyserial, and those who make them")
