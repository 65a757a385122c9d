"""How deep the classes of urbihw derive from each other: a reader of a method must not climb a tower to find it."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
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
