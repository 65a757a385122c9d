"""What a slot may have beside its value: constness, properties, a changed event, watchers, an accessor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from urbihw.kernel.runtime.blend import Blender
    from urbihw.kernel.runtime.object import Obj
    from urbihw.kernel.runtime.watch import Watch


class Accessor(Protocol):
    """A slot whose reads and writes go to code: a UVar, a getter and setter pair."""

    def read(self, target: Any) -> Any:
        """The value seen by whoever reads the slot of ``target``."""
        ...

    def write(self, target: Any, value: Any) -> Any:
        """Somebody assigned the slot; returns the value of the assignment."""
        ...


class SlotMeta:
    """The rarer half of one slot of one object."""

    __slots__ = ("accessor", "blender", "changed", "constant", "properties", "watchers")

    def __init__(self) -> None:
        self.constant = False
        self.properties: dict[str, Any] | None = None
        self.changed: Any = None
        self.watchers: dict[Watch, None] | None = None
        self.accessor: Accessor | None = None
        self.blender: Blender | None = None


def meta_of(target: Obj, name: str) -> SlotMeta:
    """The meta of a slot, made if need be; ``name`` "" stands for the content of a container."""
    if target.meta is None:
        target.meta = {}
    meta = target.meta.get(name)
    if meta is None:
        meta = target.meta[name] = SlotMeta()
    return meta


def peek_meta(target: Obj, name: str) -> SlotMeta | None:
    """The meta of a slot if it has one."""
    return None if target.meta is None else target.meta.get(name)
