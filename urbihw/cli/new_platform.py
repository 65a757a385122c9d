"""Write the skeleton of a new platform into a tree of the sources, or as a package of its own.

A platform is a folder of ``urbihw/platforms``, a simulated robot in ``fakes``, and what the contract tests want of it.
The skeleton is a robot with one wheel that passes them all; ``skeleton`` beside this module mirrors the tree.  A
package of its own has the platform and the simulated robot as packages of Python, which urbihw finds by entry points.
"""

from __future__ import annotations

import argparse
import keyword
import re
import sys
from itertools import groupby
from pathlib import Path
from string import Template
from typing import Final, NamedTuple

from urbihw import platforms
from urbihw.cli.options import CliRefused
from urbihw.exitcodes import EX_CONFIG
from urbihw.kernel import Kernel
from urbihw.robot import ROBOT_LIBRARY
from urbihw.started import as_typed

SKELETON: Final = Path(__file__).with_name("skeleton")
SUFFIX: Final = ".tmpl"
PLACEHOLDER: Final = "NAME"
"""The placeholder for the name of the platform in the paths of the skeleton; in its files it is ``$name`` or
``$Name``, and ``$package`` and ``$fakes`` are the packages of the platform and of the simulated robot."""


class SkeletonLayout(NamedTuple):
    """Where the files of the skeleton go.

    Attributes:
        package, fakes: the full names of the packages.
        folders: folder of the skeleton -> folder below the root; files of others are left out.
    """

    package: str
    fakes: str
    folders: dict[str, str]


IN_TREE: Final = SkeletonLayout(
    "urbihw.platforms.NAME", "urbihw_fakes.NAME",
    {folder: folder for folder in ("urbihw/platforms/NAME", "fakes/urbihw_fakes/NAME", "tests/platforms")},
)  # fmt: skip
"""A platform of a clone of the sources."""
OUTSIDE: Final = SkeletonLayout(
    "urbihw_NAME", "urbihw_NAME_fakes",
    {"urbihw/platforms/NAME": "urbihw_NAME", "fakes/urbihw_fakes/NAME": "urbihw_NAME_fakes", "package": "."},
)  # fmt: skip
"""A package of its own."""
RESERVED: Final = ("body", "robot", "wheel")
"""Names of parts of the robot that the skeleton makes."""
_NAME: Final = re.compile(r"[a-z][a-z0-9]{1,15}")


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw new-platform``."""
    parser.add_argument("name", metavar="NAME", help="of the platform, such as toy")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--folder", type=Path, metavar="DIR", help="the tree to write into (the one that runs)")
    where.add_argument("--package", type=Path, metavar="DIR", help="write a package of its own into DIR")


def run(options: argparse.Namespace) -> int:
    """Write the files, and print the next steps; 78 if that is impossible, and then nothing is written."""
    try:
        root = options.package or _tree(options.folder or Path(__file__).resolve().parents[2])
        _check_name(options.name)
        written = write_skeleton(options.name, root, OUTSIDE if options.package else IN_TREE)
    except CliRefused as refusal:
        print(f"urbihw new-platform: {refusal}", file=sys.stderr)
        return refusal.code
    for path in written:
        print(path.relative_to(root))
    print(f"\ninstall it: {sys.executable} -m pip install -e {root}" if options.package else "")
    print(f"serve it: {as_typed('urbihw serve')} --platform {options.name} --fake")
    if not options.package:
        print(f"test it:  python -m pytest tests/platforms -k {options.name} -m 'not long'")
    return 0


def write_skeleton(name: str, root: Path, layout: SkeletonLayout) -> list[Path]:
    """Write the files of a platform, and return their paths.  Raises CliRefused if one exists already."""
    words = {"package": layout.package.replace(PLACEHOLDER, name), "fakes": layout.fakes.replace(PLACEHOLDER, name)}
    targets = {
        root / _target(path.relative_to(SKELETON / folder), target, name): path
        for folder, target in layout.folders.items()
        for path in sorted((SKELETON / folder).rglob(f"*{SUFFIX}"))
    }
    folders = {root / target.replace(PLACEHOLDER, name) for target in layout.folders.values() if PLACEHOLDER in target}
    for path in sorted(folders | {folder.with_suffix(".py") for folder in folders} | targets.keys()):
        if path.exists():
            raise CliRefused(f"{path} is there already: take another name, or remove it", EX_CONFIG)
    try:
        for target, source in targets.items():
            text = Template(source.read_text("utf-8")).substitute(words, name=name, Name=name.capitalize())
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(_with_sorted_imports(text), "utf-8")
    except OSError as error:
        raise CliRefused(f"{error.filename} cannot be written: {error.strerror}", EX_CONFIG) from error
    return list(targets)


def _target(inner: Path, folder: str, name: str) -> str:
    """The path of a file of the skeleton, ``inner`` in its folder, below the root."""
    return f"{folder}/{inner.as_posix().removesuffix(SUFFIX)}".replace(PLACEHOLDER, name)


def _with_sorted_imports(text: str) -> str:
    """The text with each block of imports sorted: the position of a module depends on the name of the platform."""
    runs = groupby(text.splitlines(keepends=True), lambda line: line.startswith("from "))
    return "".join(line for imports, lines in runs for line in (sorted(lines) if imports else lines))


def _tree(folder: Path) -> Path:
    """The root of a tree of the sources.  Raises CliRefused."""
    for part in ("urbihw/platforms", "fakes/urbihw_fakes", "tests/platforms"):
        if not (folder / part).is_dir():
            raise CliRefused(f"{folder} has no folder {part}: name a clone of the sources with --folder", EX_CONFIG)
    return folder.resolve()


def _check_name(name: str) -> None:
    """Raise CliRefused if a platform, Python, urbiscript or its library uses this name."""
    if not _NAME.fullmatch(name):
        raise CliRefused(
            f"{name!r} cannot be a name: take 2 to 16 letters a to z and digits, a letter first", EX_CONFIG
        )
    if keyword.iskeyword(name) or name in RESERVED:
        raise CliRefused(f"{name!r} means something else already: take another name", EX_CONFIG)
    if other := platforms.owner(name):
        raise CliRefused(f"{other} has a platform {name!r} already: take another name", EX_CONFIG)
    kernel = Kernel(libraries=(ROBOT_LIBRARY,))
    lobby = kernel.open_lobby()
    names = ", ".join(f'Global.hasSlot("{each}")' for each in (name, name.capitalize()))
    lobby.output.take_bytes()
    kernel.feed(lobby, f"{{ var {name} = 0 | [{names}] }};".encode())
    kernel.run()
    kernel.close()
    if b"[false, false]" not in lobby.output.take_bytes():
        raise CliRefused(f"{name!r} is a word or a slot of urbiscript already: take another name", EX_CONFIG)
