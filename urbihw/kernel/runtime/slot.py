"""The optional parts of a slot beside its value: constness, properties, a changed event, watchers, an accessor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.blend import Blender
    from urbihw.kernel.runtime.object import Obj
    from urbihw.kernel.runtime.watch import ConditionWatch


class Accessor(Protocol):
    """Code that handles the reads and writes of a slot: a UVar, or a getter and a setter."""

    def read(self, target: Value) -> Value:
        """The value of the slot of ``target`` for a reader."""
        ...

    def write(self, target: Value, value: Value) -> Value:
        """Handle an assignment to the slot of ``target``; returns the value of the assignment."""
        ...


class SlotMeta:
    """The optional parts of one slot of one object.

    ``getter``: whether a function in the slot is its getter, which is called by a read, and not a method.
    """

    __slots__ = ("accessor", "blender", "changed", "constant", "getter", "properties", "watchers")

    def __init__(self) -> None:
        self.constant = False
        self.getter = False
        self.properties: dict[str, Any] | None = None
        self.changed: Any = None
        self.watchers: dict[ConditionWatch, bool] | None = None
        self.accessor: Accessor | None = None
        self.blender: Blender | None = None


def meta_of(target: Obj, name: str) -> SlotMeta:
    """The meta of a slot, made if there is none; ``name`` "" stands for the content of a container."""
    if target.meta is None:
        target.meta = {}
    meta = target.meta.get(name)
    if meta is None:
        meta = target.meta[name] = SlotMeta()
    return meta


def peek_meta(target: Obj, name: str) -> SlotMeta | None:
    """The meta of a slot, or None."""
    return None if target.meta is None else target.meta.get(name)
