"""System.documentation: what the docstrings of this implementation say of a slot.  Not in the manual; for consoles.

Nothing is gathered before somebody asks, so that it costs a server nothing to start.
"""

from __future__ import annotations

import inspect
from functools import cache
from importlib import import_module
from typing import Any

from urbihw.kernel.runtime.code import Executable, Primitive
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import MODULES, prototype


class Docstrings:
    """The docstrings of one world's library, by the objects they are about."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._built_in: dict[tuple[int, str], str] = {}
        self._prototypes: dict[int, str] = {}
        for name in MODULES:
            module = import_module(f"urbihw.kernel.stdlib.{name}")
            tables = getattr(module, "TABLES", None) or ([module.TABLE] if hasattr(module, "TABLE") else [])
            for table in tables:
                self._add(table, module.__doc__ or "")

    def _add(self, table: Table, about: str) -> None:
        proto = prototype(self._world, table.proto)
        subject, _, text = about.partition(": ")
        if table.proto in subject.replace(",", " ").split():
            self._prototypes.setdefault(id(proto), text.partition("\n\n")[0])
        for row in table.rows:
            for name in row.names:
                self._built_in[id(proto), name] = row.function.__doc__ or ""

    def of(self, this: Any, name: str) -> str:
        """What is said of a slot; "" if nothing is."""
        holder = self._world.peek_obj(this).find(name)
        if holder is None:
            return ""
        value = holder.slots[name]
        text = _of_device_function(holder, name)
        if not text and isinstance(value, Primitive):
            text = self._built_in.get((id(holder), name), "")
        if not text and not isinstance(value, Executable):
            text = self._of_value(value)
        return inspect.cleandoc(text).replace("``", "")

    def _of_value(self, value: Any) -> str:
        """What is said of the class of a value."""
        device = getattr(value, "kind", None)
        if isinstance(device, type):
            return device.__doc__ or ""
        for one in (value, *self._world.protos_of(value)):
            if id(one) in self._prototypes:
                return self._prototypes[id(one)]
        return ""


def _of_device_function(holder: Any, name: str) -> str:
    """What a Python class of UObjects says of its method of this urbiscript name."""
    device = getattr(holder, "kind", None)
    if not isinstance(device, type):
        return ""
    for _, method in inspect.getmembers(device, inspect.isfunction):
        if getattr(method, "__urbi_name__", None) == name:
            return method.__doc__ or ""
    return ""


def install(world: World, programs: Any) -> None:
    """Put ``documentation`` into System."""
    table = Table("System")
    docstrings = cache(lambda: Docstrings(world))

    @table.primitive("documentation")
    def documentation(world: World, this: Any, holder: Any, name: str) -> str:
        """The description of a slot of an object, as a String; empty if there is none."""
        return docstrings().of(holder, name)

    table.install(world, prototype(world, "System"))
