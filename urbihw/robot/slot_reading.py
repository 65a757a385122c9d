"""Slots by their path, such as ``motor6.val`` or ``robot.joint[6].val``, read again and again without a compiler.

A path only reads: it takes values, variables of devices, getters, and functions that are declared to tell a number
(they have a unit).  No other function is called, so that no client stops a robot by subscribing ``robot.stop``.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final, NamedTuple

from urbihw.kernel.library import (
    GroupObject,
    Obj,
    SlotMeta,
    String,
    Value,
    World,
    described_property,
    errors,
    find_property,
    peek_meta,
    prototype,
)
from urbihw.robot.interface import Promise, provider
from urbihw.robot.interface_notes import TOLD
from urbihw.robot.localizer import LocalizerObject

MAX_PATH_LENGTH: Final = 200
"""Maximum length of a path in characters."""
_FIRST: Final = re.compile(r"([A-Za-z_]\w*)", re.ASCII)
_NEXT: Final = re.compile(
    r"\.([A-Za-z_]\w*)|\[(?:(-?\d{1,9})|\"([^\"\\\]]*)\"|([A-Za-z_]\w*))\]", re.ASCII
)  # fmt: skip


_FUNCTION: Final = "{} is a function: its result cannot be subscribed, but that of a getter can"


class PathStep(NamedTuple):
    """One step of a path: the slot ``name``, or ``index`` in a container or (a place, such as left) in a Localizer;
    ``end`` is the column behind it.
    """

    name: str
    index: Any
    end: int


class Unreadable(Exception):
    """A step of a path cannot be taken; the message is one line with its place in the path."""


def parse_path(world: World, text: str) -> list[PathStep]:
    """The steps of a path.  Raises an urbiscript error for any other text."""
    match = _FIRST.match(text) if len(text) <= MAX_PATH_LENGTH else None
    steps: list[PathStep] = []
    while match is not None:
        name, number, word, place = (*match.groups(), None, None, None)[:4]
        index: Any = None if number is None else float(number)
        if word is not None:
            index = world.string(word)
        elif place is not None:
            index = prototype(world, "Localization").slots.get(place)
        if name is None and index is None:
            break
        steps.append(PathStep(name or "", index, match.end()))
        if match.end() == len(text):
            return steps
        match = _NEXT.match(text, match.end())
    shown = text if len(text) <= MAX_PATH_LENGTH else text[: MAX_PATH_LENGTH - 3] + "..."
    raise errors.primitive(f"\"{shown}\" is no path of a slot, such as motor6.val or robot.joint[6].val")


def make_reader(world: World, this: Value, steps: list[PathStep]) -> Callable[[], Value]:
    """A function that reads the slot of a path.  It raises Unreadable or what a getter raises."""
    read_slot = make_slot_reader(world)

    def read() -> Value:
        value = this
        for name, index, end in steps:
            if index is None:
                try:
                    value = read_slot(value, name)
                except _Refusal as refusal:
                    raise Unreadable(f"1.1-{end}: {refusal}") from None
            else:
                value = world.send1(value, "get" if isinstance(value, LocalizerObject) else "[]", index)
        return value

    return read


class _Refusal(Exception):
    """A slot cannot be read; the message has no place yet."""


def make_slot_reader(world: World) -> Callable[[Value, str], Value]:
    """A function ``read(target, name)`` that reads a slot, and calls no function without a unit.  A slot of a group is
    a List with those of its members, in their order; a function of the group, such as ``load``, hides none."""

    def read_slot(target: Value, name: str) -> Value:
        obj: Obj = world.peek_obj(target) if target.__class__ is float else target
        holder = obj if name in obj.slots else obj.find(name)
        if holder is None:
            if isinstance(obj, LocalizerObject):
                obj = obj.group()
            if isinstance(obj, GroupObject) and obj.members:
                return read_members(obj, name)
            raise _Refusal(f"lookup failed: {name}")
        if isinstance(obj, GroupObject) and obj.members and is_function(holder, name):
            with suppress(_Refusal):
                return read_members(obj, name)
        value = holder.slots[name]
        if value.__class__ is float or not value.runs:
            return value
        meta = peek_meta(holder, name)
        if meta is None:
            raise _Refusal(_FUNCTION.format(name))
        accessor = meta.accessor
        if accessor is None:
            if not (meta.getter or _has_unit(meta)):
                raise _Refusal(_FUNCTION.format(name))
            return world.invoke(value, target, (), name)
        return read_promise(target, accessor) if isinstance(accessor, Promise) else accessor.read(target)

    def read_members(group: GroupObject, name: str) -> Value:
        return world.new_list([read_slot(member, name) for member in group.members])

    def is_function(holder: Obj, name: str) -> bool:
        value = holder.slots[name]
        return value.__class__ is not float and value.runs and peek_meta(holder, name) is None

    def read_promise(target: Value, promise: Promise) -> Value:
        """A slot of an interface: that of the device, or what the rule of the interface tells."""
        for name in filter(None, (promise.name, promise.other)):
            holder = provider(world, target, name)
            if holder is not None:
                return read_held(target, holder, name, promise)
        if promise.getter is not None and not is_told(world, target, promise):
            raise _Refusal(_FUNCTION.format(promise.name))
        return promise.read(target)

    def read_held(target: Value, holder: Obj, name: str, promise: Promise) -> Value:
        value = holder.slots[name]
        if value.__class__ is float or not value.runs:
            return value
        meta = peek_meta(holder, name)
        if meta is not None and meta.accessor is not None:
            return meta.accessor.read(target)
        if not (meta is not None and meta.getter or is_told(world, target, promise)):
            raise _Refusal(_FUNCTION.format(name))
        return world.invoke(value, target, (), name)

    return read_slot


def _has_unit(meta: SlotMeta) -> bool:
    unit = meta.properties.get("unit") if meta.properties else None
    return isinstance(unit, String) and bool(unit.s)


def is_told(world: World, target: Value, promise: Promise) -> bool:
    """Whether a function that provides a promised slot only tells a value: the slot has a unit, or is known as one."""
    unit = described_property(world, target, promise.name, "unit")
    return isinstance(unit, String) and bool(unit.s) or f"{promise.kind}.{promise.name}" in TOLD


def unit_of(world: World, this: Value, steps: list[PathStep]) -> str:
    """The unit of the slot of a path; "" if it has none, or cannot be found now."""
    last = steps[-1]
    if last.index is not None:
        return ""
    try:
        holder = make_reader(world, this, steps[:-1])()
    except (Unreadable, errors.ThrownError):
        return ""
    unit = find_property(world.peek_obj(holder), last.name, "unit")
    return unit.s if isinstance(unit, String) else ""
