"""How deep the classes of urbihw derive from each other, and that each package names its modules: a reader of a method
must not climb a tower to find it, nor search for where to begin."""

from __future__ import annotations

import ast
import importlib
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import urbihw
from urbihw.buses.link import Port
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.uobject import UObject

DEEPEST: Final = 5
"""Classes of urbihw from a class to the root of its layer: the class counts, the root does not.  Beyond that, compose:
``urbihw.kernel.uobject.part`` lets the parts of a device have slots of it."""
ROOTS: Final = (UObject, Obj, Port)
"""The roots of the layers: devices, values of urbiscript, wires.  Other classes are counted down to ``object``."""


ROOT: Final = Path(__file__).resolve().parents[1]
BY_TABLE: Final = ("urbihw/cli", "urbihw/kernel/stdlib")
"""Packages whose modules are rows of a table in alphabetical order: commands, and the classes of the library."""
IN_EACH_ROBOT: Final = frozenset(("options", "trace", "words"))
"""Modules of the folders of robots, which the docstring of ``urbihw.platforms`` explains once."""


def unnamed_modules(package: Path) -> list[str]:
    """The modules and packages in a package that its docstring does not name; docs/tree.md has those of urbihw."""
    text = (package / "__init__.py").read_text("utf-8")
    words = ast.get_docstring(ast.parse(text)) or ""
    if package.name == "urbihw":
        words = (ROOT / "docs" / "tree.md").read_text("utf-8")
    inner = {path.stem for path in package.glob("*.py")} | {path.parent.name for path in package.glob("*/__init__.py")}
    of_robots = package.parent.name == "platforms" or (package / "platform.toml").is_file()
    inner -= {"__init__", "__main__"} | (IN_EACH_ROBOT if of_robots else set())
    return sorted(name for name in inner if not re.search(rf"\b{re.escape(name)}\b", words))


def test_the_docstring_of_a_package_names_its_modules() -> None:
    packages = [
        path.parent for top in ("urbihw", "packages/nao/urbihw_nao") for path in (ROOT / top).rglob("__init__.py")
    ]
    chosen = [package for package in packages if str(package.relative_to(ROOT)) not in BY_TABLE]
    assert {str(package.relative_to(ROOT)): found for package in chosen if (found := unnamed_modules(package))} == {}


def classes() -> Iterator[type]:
    """All classes of the modules of urbihw whose imports are installed."""
    for module in pkgutil.walk_packages(urbihw.__path__, "urbihw."):
        if module.name.endswith("__main__"):
            continue
        try:
            found = importlib.import_module(module.name)
        except ImportError as error:
            assert error.name is not None and not error.name.startswith("urbihw"), error
            continue
        for value in vars(found).values():
            if isinstance(value, type) and value.__module__ == module.name:
                yield value


def line(kind: type) -> list[type]:
    """The longest line of classes of urbihw from a class to a root."""
    if kind in ROOTS:
        return []
    above = max((line(base) for base in kind.__bases__), key=len) if kind is not object else []
    return [kind, *above] if kind.__module__.startswith("urbihw") else above


def test_no_class_stands_on_a_tower() -> None:
    found = {kind: line(kind) for kind in classes()}
    assert len(found) > 900
    deep = [" > ".join(each.__name__ for each in way) for way in found.values() if len(way) > DEEPEST]
    assert not deep, f"more than {DEEPEST} classes; let parts have the jobs:\n" + "\n".join(sorted(deep))
    assert max(map(len, found.values())) == DEEPEST, "lower the number: it is a gain to be held"
