"""The walk through the parts of a robot, and what a slot of a device is, seen from outside.

No function of a device is called and no device is asked: the kinds of values are those of the values that are known.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

from urbihw.kernel.library import (
    BinaryObject,
    Dictionary,
    Event,
    Executable,
    FloatObject,
    List,
    Obj,
    SlotMeta,
    String,
    Truth,
    Tuple,
    World,
    docstrings_of,
    find_property,
    peek_meta,
    prototype,
)
from urbihw.robot.device_slots import names_of
from urbihw.robot.interface import KindObject, Promise, kinds_of, provider
from urbihw.robot.interface_notes import TOLD
from urbihw.robot.localizer import LocalizerObject

Node = dict[str, Any]

MAX_DEPTH: Final = 20
"""Depth of a tree, in components."""
TIME_SLICE_S: Final = 0.005
"""Seconds without a turn for other jobs while a tree is made."""
MAX_NODES: Final = 1000
"""Components and devices of a tree."""
_EFFECTS: Final = {
    "AudioOut": ("val",),
    "Led": ("val",),
    "RGBLed": ("r", "g", "b", "val"),
    "Mobile": ("xSpeed", "ySpeed", "zSpeed", "yawSpeed", "pitchSpeed", "rollSpeed", "speed"),
}
"""Slots of interfaces that have an effect although no guard of the robot's motion checks a write of the device's own
variable: sound, light, and the speeds that a rule of the interface passes on."""
_STRUCTURE: Final = {"ownNames", "parent", "partNames", "step"}
"""Slots of a component that tell only where it is."""
_BINARIES: Final = {("VideoIn", "val"), ("AudioIn", "val"), ("AudioOut", "val")}
_KINDS: Final = (
    (Truth, "truth"), (String, "text"), (List, "list"), (Tuple, "list"), (Dictionary, "dictionary"),
    (BinaryObject, "binary"), (Event, "event"),
)  # fmt: skip


class DeviceSlot:
    """A slot of a device as its user sees it: what holds it, and its accessor, found through promises."""

    def __init__(self, world: World, device: Obj, name: str) -> None:
        self.name = name
        self._nil = world.nil
        self.value, self.meta = _resolve(world, device, name)
        self.accessor: Any = None if self.meta is None else self.meta.accessor

    def is_function(self) -> bool:
        """Whether only a call would tell something."""
        if isinstance(self.value, Promise) or self.accessor is not None:
            return False
        properties = self.meta.properties if self.meta is not None else None
        getter = self.meta is not None and self.meta.getter
        return isinstance(self.value, Executable) and not getter and not (properties and "unit" in properties)

    def content(self) -> Any:
        """The value that is known without asking the device; None for none."""
        if hasattr(self.accessor, "current"):
            return self.accessor.current(False)
        return None if isinstance(self.value, Executable) else self.value

    def is_missing(self) -> bool:
        """Whether the device does not have a slot that its interface promises: it is not provided, or it is nil."""
        if isinstance(self.value, Promise):
            return self.value.getter is None and self.value.default is self._nil
        return self.content() is self._nil and not (self.meta is not None and self.meta.getter)

    def is_writable(self) -> bool:
        """Whether an assignment is taken."""
        if self.meta is not None and self.meta.constant:
            return False
        if isinstance(self.value, Promise):
            return self.value.setter is not None  # else it is not provided
        if self.accessor is not None:
            return bool(getattr(self.accessor, "writable", True))
        return not isinstance(self.value, Executable | Event)

    def is_guarded(self) -> bool:
        """Whether the robot's authority over its motion checks a write."""
        return getattr(self.accessor, "effector", None) is not None


def _resolve(world: World, device: Obj, name: str) -> tuple[Any, SlotMeta | None]:
    """The value that a slot has, and its meta; for a promise those of the device's own slot, of the slot to which it
    points, or of the slot that its rule uses."""
    holder = device.find(name)
    if holder is None:
        return None, None
    value = holder.slots[name]
    if isinstance(value, Promise):
        for other in filter(None, (value.name, value.other)):
            found = provider(world, device, other)
            if found is not None:
                return found.slots[other], peek_meta(found, other)
        if value.setter is not None and value.basis and value.basis != name:
            based = _resolve(world, device, value.basis)
            if getattr(based[1] and based[1].accessor, "effector", None) is not None:
                return based
    return value, peek_meta(holder, name)


class TreeWalk:
    """Makes the nodes of one tree."""

    def __init__(self, world: World, with_slots: bool) -> None:
        self._world = world
        self._with_slots = with_slots
        self._count = 0
        self._component = prototype(world, "Component")
        self._meanings: dict[Any, str] = {}
        self.paths: dict[int, str] = {}
        """The path of each part by the identity of its object."""
        self.parts: dict[str, Obj] = {}
        """The object of each part by its path."""

    def node(self, part: Obj, path: str, name: str, place: Any, depth: int = 0) -> Node:
        """A component or a device, with its parts."""
        self.paths.setdefault(id(part), path)
        self.parts.setdefault(path, part)
        if self._world.scheduler.running().context is not None:
            self._world.scheduler.give_way(TIME_SLICE_S)
        self._count += 1
        made: Node = {
            "name": name, "place": place, "path": path, "global": self._global_name(part),
            "class": class_name(part), "interfaces": self._interfaces(part),
        }  # fmt: skip
        if self._with_slots and (made["interfaces"] or depth == 0):
            made["slots"] = self.slots(part)
            made["effectors"] = [slot["name"] for slot in made["slots"] if slot["effector"]]
        made["parts"] = [
            self.node(*branch, depth + 1)
            for branch in self._branches(part, path, name)
            if depth < MAX_DEPTH and self._count < MAX_NODES
        ]
        return made

    def _global_name(self, part: Obj) -> str:
        """The slot of Global that holds a part, "" for none: of several a name that somebody has given, such as
        ``wrist_roll``, rather than a number, such as ``motor5``."""
        names = [name for name, held in self._world.global_.slots.items() if held is part]
        return next((name for name in names if not name[-1].isdigit()), names[0] if names else "")

    def _branches(self, part: Obj, path: str, name: str) -> Iterator[tuple[Obj, str, str, Any]]:
        if isinstance(part, LocalizerObject):
            for place, inner in part.parts:
                shown = self._world.text(place)
                yield inner, f"{path}[{shown}]", name, place if place.__class__ is float else shown
        elif self._world.is_a(part, self._component):
            holder = part.find("partNames")
            names = None if holder is None else holder.slots["partNames"]
            for each in names.l if isinstance(names, List) else ():
                inner = part.slots.get(each.s) if isinstance(each, String) else None
                if isinstance(inner, Obj):
                    yield inner, f"{path}.{each.s}", each.s, None

    def _interfaces(self, part: Obj) -> list[str]:
        """The names of the interfaces of a part, without those from which its other interfaces derive."""
        kinds = kinds_of(self._world, part)
        return [
            kind.name for kind in kinds
            if not any(other is not kind and self._world.is_a(other, kind) for other in kinds)
        ]  # fmt: skip

    def slots(self, device: Obj) -> list[Node]:
        """The slots of a device, in alphabetical order, without its place in the tree."""
        kinds = kinds_of(self._world, device)
        names = {*names_of(self._world, device)} - _STRUCTURE
        holder = device.slots.get("partNames")
        parts = {name.s for name in holder.l if isinstance(name, String)} if isinstance(holder, List) else set()
        return [self._slot_row(device, name, kinds) for name in sorted(names - parts)]

    def _slot_row(self, device: Obj, name: str, kinds: list[KindObject]) -> Node:
        slot = DeviceSlot(self._world, device, name)
        unit = docstrings_of(self._world).unit(device, name)
        # The interface of this device that promises the slot; the most general one that has it names its meaning.
        promising = [kind.name for kind in kinds if isinstance(kind.slots.get(name), Promise)]
        kind = "function" if slot.is_function() else _kind(slot.content(), unit, name, promising)
        if isinstance(slot.value, Promise):
            told = TOLD.get(f"{slot.value.kind}.{name}")
            kind = told or ("function" if slot.value.getter is not None and not unit else kind)
        writable = slot.is_writable() and kind not in ("function", "event")
        return {
            "name": name,
            "kind": kind,
            "unit": unit,
            "min": _finite(find_property(device, name, "rangemin")),
            "max": _finite(find_property(device, name, "rangemax")),
            "meaning": self._meaning(device, name),
            "readable": kind not in ("function", "event") and (
                kind == "binary" or not (promising and slot.is_missing())
            ),
            "writable": writable,
            "effector": writable and (slot.is_guarded() or any(name in _EFFECTS.get(each, ()) for each in promising)),
        }


    def _meaning(self, device: Obj, name: str) -> str:
        """What is said of a slot; it is the same for all devices of a class that have no variable of another device."""
        value: Any = device.slots.get(name)
        shared = getattr(getattr(value, "holder", None), "kind", None), getattr(value, "name", "")
        key = (tuple(map(id, device.protos)), getattr(device, "kind", None), shared, name)
        found = self._meanings.get(key)
        if found is None:
            found = self._meanings[key] = docstrings_of(self._world).meaning(device, name)
        return found


def _kind(value: Any, unit: str, name: str, promising: list[str]) -> str:
    """What a value is, or will be where there is none yet."""
    if value.__class__ is float or isinstance(value, FloatObject):
        return "number"
    for cls, kind in _KINDS:
        if isinstance(value, cls):
            return kind
    if any((each, name) in _BINARIES for each in promising):
        return "binary"
    return "number" if unit else "object"


def class_name(part: Obj) -> str:
    holder = part.find("type")
    name = None if holder is None else holder.slots["type"]
    return name.s if isinstance(name, String) else ""


def _finite(value: Any) -> float | None:
    return value if value.__class__ is float and math.isfinite(value) else None


def platform_of(robot: Obj) -> Obj | None:
    """The object of the platform: the robot shares the slot that tells of its link with it."""
    holder = robot.find("link")
    owner = None if holder is None else getattr(holder.slots["link"], "holder", None)
    return owner if isinstance(owner, Obj) and owner is not robot else None
