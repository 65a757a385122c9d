"""System.documentation: the docstring of a slot, for consoles.  Not in the manual.

The docstrings are collected at the first call, so that they do not delay the start of a server.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterator
from typing import Any

from urbihw.kernel.runtime.code import Executable, Primitive
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import String
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import Libraries, prototype
from urbihw.kernel.stdlib.properties import describers_of, find_property
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
        for library in world.part(Libraries):
            for module in library.imported():
                self._read_module(module)
            for _, text in library.texts():
                self._read_urbiscript(text)

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
        text = self._of_slot(self._world.peek_obj(this), holder, name)
        if not text and not isinstance(value, Executable):
            text = self._of_value(value)
        measures = " ".join(self._measures(self._world.peek_obj(this), name))
        return "\n".join(filter(None, (inspect.cleandoc(text).replace("``", ""), measures)))

    def _measures(self, this: Obj, name: str) -> Iterator[str]:
        """The unit and the range of a slot, in words."""
        unit, span = self.unit(this, name), self.range(this, name)
        if unit:
            yield "Unit: none." if unit == "1" else f"Unit: {unit}."
        if span:
            yield f"Range: {span}."

    def unit(self, this: Obj, name: str) -> str:
        """The unit of a slot, from the properties of the slot or of the interfaces of its object."""
        unit = find_property(this, name, "unit")
        return unit.s if isinstance(unit, String) else ""

    def range(self, this: Obj, name: str) -> str:
        """The range of a slot."""
        least, most = (find_property(this, name, end) for end in ("rangemin", "rangemax"))
        if least.__class__ is float and most.__class__ is float and (math.isfinite(least) or math.isfinite(most)):
            return f"{least:g} to {most:g}"
        return ""

    def meaning(self, this: Obj, name: str) -> str:
        """What is said of a slot, in one line: the first paragraph."""
        holder = this.find(name)
        text = "" if holder is None else inspect.cleandoc(self._of_slot(this, holder, name))
        return text.partition("\n\n")[0].replace("\n", " ").replace("``", "")

    def noted(self, prototype: Value) -> set[str]:
        """The slots with an entry in ``NOTES``; some of them are slots of instances and not of the class."""
        holder = id(self._world.peek_obj(prototype))
        return {slot for place, slot in self._slots if place == holder}

    def of_objects(self, prototype: Value, name: str) -> str:
        """The description of a slot that only instances of the class have."""
        return self._slots[id(self._world.peek_obj(prototype)), name]

    def _of_slot(self, this: Obj, holder: Obj, name: str) -> str:
        """What is said of a slot itself, not of the class of its value."""
        value = holder.slots[name]
        text = _of_device_function(holder, name) or self._meaning(this, holder, name)
        if not text and isinstance(value, Executable):
            text = self._functions.get(id(value), "")
        if not text and isinstance(value, Primitive):
            text = value.source.__doc__ or ""
        return text

    def _meaning(self, this: Obj, holder: Obj, name: str) -> str:
        """What a device's class, a note, or a prototype that describes its heirs says of a slot."""
        # A variable of a device may be shared with other objects, under other names.
        value = holder.slots[name]
        text = ""
        for place, own in ((holder, name), (getattr(value, "holder", None), getattr(value, "name", "")), (this, name)):
            describe = getattr(getattr(place, "kind", None), "describe_slot", None)
            text = text or ("" if describe is None else describe(own)[0])
        if not text:
            text = self._noted(holder, name) or self._noted(this, name)
        for one in describers_of(this):
            text = text or self._slots.get((id(one), name), "")
        return text

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
    describe = getattr(getattr(holder, "kind", None), "describe_function", None)
    return "" if describe is None else str(describe(name))


def docstrings_of(world: World) -> Docstrings:
    """The docstrings of a world, collected at the first call."""
    if not world.has_part(Docstrings):
        world.install_part(Docstrings(world))
    return world.part(Docstrings)


def install(world: World, programs: Any) -> None:
    """Install ``documentation`` in System."""
    table = Table("System")

    @table.primitive("documentation")
    def documentation(world: World, this: Value, holder: Value, name: str) -> str:
        """The description of a slot of an object, as a String; empty if there is none."""
        return docstrings_of(world).of(holder, name)

    table.install(world, prototype(world, "System"))
