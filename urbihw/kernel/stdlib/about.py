"""Lobby: information about the program: banner, license, authors, copyright, acknowledgements.

Source: manual, specs/lobby; server protocol, section 1, for the format of the banner.
"""

from __future__ import annotations

from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.channel import starred
from urbihw.kernel.stdlib.lobby import connected_lobby
from urbihw.kernel.value import Value
from urbihw.release import installed_version

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
    return f"urbihw {installed_version() or '(not installed)'}"


def _print_lines(this: Value, *lines: str) -> None:
    output = connected_lobby(this).output
    for line in lines:
        output.line(starred(line))


@TABLE.primitive("banner")
def banner(world: World, this: Value) -> None:
    """Print the banner that greets a new connection."""
    _print_lines(this, ROW, f"{release()}: robots as urbiscript objects", COPYRIGHT, "", *WARRANTY, "",
          "Every robot is a slot of Global; see the docs folder.", ROW)


@TABLE.primitive("copyright")
def copyright_(world: World, this: Value, deep: bool = True) -> None:
    """Print the version and the copyright; if ``deep``, also those of the urbiscript language."""
    _print_lines(this, release(), COPYRIGHT)
    if deep:
        language = "urbiscript 2.3, as described in the Urbi SDK manual"
        _print_lines(this, "", language, "Copyright (C) 2005-2010 Gostai S.A.S.")


@TABLE.primitive("license")
def license_(world: World, this: Value) -> None:
    """Print the license of the program."""
    _print_lines(this, *LICENSE)


@TABLE.primitive("authors")
def authors(world: World, this: Value) -> None:
    """Print the authors of the program."""
    _print_lines(this, "urbihw: the urbihw authors", "urbiscript: Jean-Christophe Baillie and the Urbi team of Gostai")


@TABLE.primitive("thanks")
def thanks(world: World, this: Value) -> None:
    """Print the components that the program is built on."""
    _print_lines(this, "Python, lark, greenlet, pyserial, and those who make them")
