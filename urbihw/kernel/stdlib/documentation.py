"""System.documentation: the docstring of a slot, for consoles.  Not in the manual.

The docstrings are collected at the first call, so that they do not delay the start of a server.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from importlib.resources import files
from typing import Any

from urbihw.kernel.runtime.code import Executable, Primitive
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import peek_meta
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import MODULES, prototype
from urbihw.kernel.value import Value

_COMMENTED = re.compile(r"((?:^//.*\n)+)^(?:function (\w+(?:\.\w+)*)\.|class )(\w+)", re.MULTILINE)


class Docstrings:
    """The docstrings of one world's library, by object.

    The description of a primitive is the docstring of its Python function, that of an urbiscript function the comment
    above it, that of a class the first line of its module.  ``NOTES`` of the module has the remaining and the longer
    descriptions.
    """

    def __init__(self, world: World) -> None:
        self._world = world
        self._slots: dict[tuple[int, str], str] = {}
        self._functions: dict[int, str] = {}
        self._prototypes: dict[int, str] = {}
        for name in MODULES:
            self._read_module(import_module(f"urbihw.kernel.stdlib.{name}"))
            source = files("urbihw.kernel.stdlib").joinpath(name + ".u")
            if source.is_file():
                self._read_urbiscript(source.read_text("latin-1"))

    def _read_module(self, module: Any) -> None:
        subject, _, text = (module.__doc__ or "").partition(": ")
        known = self._world.global_.slots
        for word in re.findall(r"\w+(?:\.\w+)*", subject):
            if word.partition(".")[0] in known:
                self._prototypes.setdefault(id(self._prototype(word)), text.partition("\n\n")[0])
        for path, said in getattr(module, "NOTES", {}).items():
            holder, _, slot = path.rpartition(".")
            self._note(self._prototype(holder or "Global"), slot, said)

    def _note(self, holder: Obj, slot: str, said: str) -> None:
        self._slots[id(holder), slot] = said
        value = holder.slots.get(slot)
        if isinstance(value, Executable):
            self._functions[id(value)] = said
        elif isinstance(value, Obj) and (slot[0].isupper() or holder is self._world.global_):
            self._prototypes[id(value)] = said

    def _prototype(self, path: str) -> Obj:
        """The object with this path, whose slots are described."""
        return self._world.peek_obj(prototype(self._world, path))

    def _read_urbiscript(self, text: str) -> None:
        for comment, holder, slot in _COMMENTED.findall(text):
            said = " ".join(line.removeprefix("//").strip() for line in comment.splitlines())
            self._note(self._prototype(holder or "Global"), slot, said)

    def about(self, this: Value) -> str:
        """The description of a class, or of the class of a value; "" if there is none."""
        return inspect.cleandoc(self._of_value(this)).replace("``", "")

    def of(self, this: Value, name: str) -> str:
        """The description of a slot; "" if there is none."""
        holder = self._world.peek_obj(this).find(name)
        if holder is None:
            return ""
        value = holder.slots[name]
        text = _of_device_function(holder, name) or self._noted(holder, name)
        if not text and isinstance(value, Executable):
            text = self._functions.get(id(value), "")
        if not text and isinstance(value, Primitive):
            text = value.source.__doc__ or ""
        if not text and not isinstance(value, Executable):
            text = self._of_value(value)
        measures = " ".join(self._measures(self._world.peek_obj(this), name))
        return "\n".join(filter(None, (inspect.cleandoc(text).replace("``", ""), measures)))

    def _measures(self, this: Obj, name: str) -> Iterator[str]:
        """The unit and the range of a slot, from the properties of the slot or of the interfaces of its object."""
        unit = self._property(this, name, "unit")
        if isinstance(unit, String) and unit.s:
            yield "Unit: none." if unit.s == "1" else f"Unit: {unit.s}."
        least, most = (self._property(this, name, end) for end in ("rangemin", "rangemax"))
        if least.__class__ is float and most.__class__ is float and (math.isfinite(least) or math.isfinite(most)):
            yield f"Range: {least:g} to {most:g}."

    def _property(self, this: Obj, name: str, wanted: str) -> Value:
        """A property of a slot, or of the slot of that name in the first prototype that has the property; None if there
        is none.
        """
        seen: dict[int, Obj] = {}
        waiting = [this]
        while waiting:
            one = waiting.pop()
            if id(one) in seen:
                continue
            seen[id(one)] = one
            meta = peek_meta(one, name)
            if meta is not None and meta.properties and wanted in meta.properties:
                return meta.properties[wanted]
            waiting += [proto for proto in reversed(one.protos) if isinstance(proto, Obj)]
        return None

    def noted(self, prototype: Value) -> set[str]:
        """The slots with an entry in ``NOTES``; some of them are slots of instances and not of the class."""
        holder = id(self._world.peek_obj(prototype))
        return {slot for place, slot in self._slots if place == holder}

    def of_objects(self, prototype: Value, name: str) -> str:
        """The description of a slot that only instances of the class have."""
        return self._slots[id(self._world.peek_obj(prototype)), name]

    def _noted(self, holder: Obj, name: str) -> str:
        """The entry in ``NOTES`` for a slot, or for the slot of that name in a prototype."""
        places = (holder, *holder.protos)
        return next((self._slots[id(one), name] for one in places if (id(one), name) in self._slots), "")

    def _of_value(self, value: Value) -> str:
        """The description of the class of a value."""
        device = getattr(value, "kind", None)
        if isinstance(device, type):
            return device.__doc__ or ""
        protos = [proto for proto in self._world.protos_of(value) if proto is not self._world.object]
        for one in (value, *protos):
            if id(one) in self._prototypes:
                return self._prototypes[id(one)]
            init = one.slots.get("init") if isinstance(one, Obj) else None
            if isinstance(init, Primitive):
                return init.source.__doc__ or ""
        return ""


def _of_device_function(holder: Value, name: str) -> str:
    """The docstring of the method of a Python UObject class that has this urbiscript name."""
    device = getattr(holder, "kind", None)
    if not isinstance(device, type):
        return ""
    for _, method in inspect.getmembers(device, inspect.isfunction):
        if getattr(method, "__urbi_name__", None) == name:
            return method.__doc__ or ""
    return ""


def install(world: World, programs: Any) -> None:
    """Install ``documentation`` in System."""
    table = Table("System")
    docstrings = cache(lambda: Docstrings(world))

    @table.primitive("documentation")
    def documentation(world: World, this: Value, holder: Value, name: str) -> str:
        """The description of a slot of an object, as a String; empty if there is none."""
        return docstrings().of(holder, name)

    table.install(world, prototype(world, "System"))
