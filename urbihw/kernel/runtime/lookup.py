"""Where inherited slots are found, remembered so that a look-up costs the same at any depth.

Every object that was looked through as a prototype has a *cache*: slot name to the object that holds the slot, or
``NOWHERE``.  The look-up order is depth first, each object once.  Three facts keep the caches small and right:

- Of two objects one of which is the only prototype of the other, both find the same holder, unless the lower one has
  the slot itself.  So a search walks up the chain of first prototypes until an object knows the answer, and notes it at
  every ``STRIDE``-th object of the way; only objects with several prototypes need a depth-first search, and only when
  their first prototype has no answer.
- A slot that is added or removed can only change answers for its name, in objects that were looked through: those are
  dropped (``forget``).  New prototypes can change everything: all caches are dropped (``flush``), unless the object was
  never looked through, which is so while it is being built.
- A change of a value changes no answer.

Where prototypes inherit from each other in a circle, and several of them have the slot, the first prototype's own
answer goes before that of the others.  The objects are held weakly: a cache keeps nobody alive but ancestors.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Final
from weakref import ref

if TYPE_CHECKING:
    from urbihw.kernel.runtime.object import Obj
    from urbihw.kernel.runtime.world import World

STRIDE: Final = 32
"""An answer is noted at one of so many objects of a chain: that many steps a later search takes at most."""
MOST_NAMES: Final = 20_000
"""For how many names answers are remembered: a program may ask for names that it makes up."""


class Nowhere:
    """What caches say of a slot that no ancestor has; it has no slots, so that looking into them fails."""

    slots: ClassVar[dict[str, Any]] = {}


NOWHERE: Final[Any] = Nowhere()
NO_ANSWERS: Final[dict[str, Any]] = {}
"""The cache of an object that was looked through but has no answer noted; never written to."""


class Bag:
    """Objects held weakly; those that are gone are thrown out as it grows."""

    __slots__ = ("_refs", "_room")

    def __init__(self) -> None:
        self._refs: list[ref[Obj]] = []
        self._room = 64

    def add(self, obj: Obj) -> None:
        """Put an object in; it is not looked for."""
        refs = self._refs
        refs.append(ref(obj))
        if len(refs) > self._room:
            refs[:] = [each for each in refs if each() is not None]
            self._room = max(64, 2 * len(refs))

    def __iter__(self) -> Iterator[Obj]:
        for each in self._refs:
            obj = each()
            if obj is not None:
                yield obj


class Lookups:
    """The caches of one world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._seen = Bag()
        """Whoever has a cache."""
        self._named: dict[str, Bag] = {}
        """Whose caches have an answer for a name."""

    def search(self, start: Obj, name: str) -> Obj:
        """The first holder of a slot among ``start`` and its ancestors, or ``NOWHERE``; noted in the cache of
        ``start``, where it was not."""
        if len(self._named) > MOST_NAMES:
            self.flush()
        path: list[Obj] = []
        several = -1
        node, landmark, room = start, None, 4
        found: Obj = NOWHERE
        while True:
            if node.cache is None:
                self._mark(node)
            known = node.cache.get(name) if node.cache else None
            if known is not None and (known is NOWHERE or name in known.slots):
                found = known
                break
            if name in node.slots:
                found = node
                break
            path.append(node)
            protos = node.protos
            if not protos or node is landmark:
                break
            if several < 0 and len(protos) > 1:
                several = len(path) - 1
            if len(path) == room:  # prototypes may go round in a circle (Brent's algorithm)
                landmark, room = node, 2 * room
            node = protos[0] if protos[0].__class__ is not float else self._world.peek_obj(protos[0])
        if found is NOWHERE and several >= 0:
            found = self._search_all(path[several], name)
            if found is not NOWHERE:
                del path[several + 1 :]
        for node in path[::STRIDE] or [start]:
            self._note(node, name, found)
        return found

    def _search_all(self, start: Obj, name: str) -> Obj:
        """The first holder in a depth-first search."""
        seen: set[int] = set()
        todo: list[Any] = [start]
        while todo:
            node = todo.pop()
            if node.__class__ is float:
                node = self._world.peek_obj(node)
            if id(node) in seen:
                continue
            seen.add(id(node))
            if node.cache is None:
                self._mark(node)
            if name in node.slots:
                holder: Obj = node
                return holder
            todo += reversed(node.protos)
        return NOWHERE  # type: ignore[no-any-return]

    def _mark(self, node: Obj) -> None:
        node.cache = NO_ANSWERS
        self._seen.add(node)

    def _note(self, node: Obj, name: str, found: Obj) -> None:
        if node.cache is NO_ANSWERS or node.cache is None:
            node.cache = {}
        if name not in node.cache:
            bag = self._named.get(name)
            if bag is None:
                bag = self._named[name] = Bag()
            bag.add(node)
        node.cache[name] = found

    def forget(self, name: str) -> None:
        """A slot of this name came or went in an object with a cache."""
        for obj in self._named.pop(name, ()):
            if obj.cache:
                obj.cache.pop(name, None)

    def flush(self) -> None:
        """Prototypes changed: forget everything."""
        for obj in self._seen:
            obj.cache = None
        self._seen = Bag()
        self._named.clear()
