"""Look-up of inherited slots, with caches that make its cost independent of the depth.

Each object that was searched as a prototype has a *cache* from slot names to the objects that hold the slots, or
``NOWHERE``.  The order of look-up is depth first, each object once.  Three facts keep the caches small and correct:

- An object with a single prototype finds the same holder as the prototype, unless it has the slot itself.  So a search
  follows the chain of first prototypes until a cache has the answer, and stores the answer in each ``STRIDE``-th object
  of the chain.  Only objects with several prototypes need a depth-first search, and only when the first one has no
  answer.
- Adding or removing a slot can change only the answers for its name, in objects that have a cache: these answers are
  dropped (``forget_slot``).  New prototypes can change all answers: all caches are dropped (``flush``), unless the
  object was never searched, as while it is being built.
- Changing a value changes no answer.

Where prototypes inherit from each other in a circle and several of them have the slot, the answer of the first
prototype counts.  References to the objects are weak: a cache keeps only ancestors alive.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Final
from weakref import ref

if TYPE_CHECKING:
    from urbihw.kernel.runtime.object import Obj
    from urbihw.kernel.runtime.world import World

STRIDE: Final = 32
"""Answers are stored at every so many objects of a chain, which is the maximum number of steps of a later search."""
MAX_NAMES: Final = 20_000
"""Maximum number of names with stored answers, since a program may look up generated names."""


class Nowhere:
    """The answer for a slot that no ancestor has.  It has no slots, so that reading from it fails."""

    slots: ClassVar[dict[str, Any]] = {}
    meta: ClassVar[None] = None


NOWHERE: Final[Any] = Nowhere()
NO_ANSWERS: Final[dict[str, Any]] = {}
"""The cache of an object that was searched but has no stored answer; never written to."""


class Bag:
    """Weak references to objects; dead references are removed as the bag grows."""

    __slots__ = ("_refs", "_room")

    def __init__(self) -> None:
        self._refs: list[ref[Obj]] = []
        self._room = 64

    def add(self, obj: Obj) -> None:
        """Add an object, without a check whether it is there already."""
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
        """The objects that have a cache."""
        self._named: dict[str, Bag] = {}
        """The objects whose caches have an answer, by name."""
        self.library: dict[Obj, list[dict[str, Any]]] = {}
        """The slots of an object of the library and of its ancestors, all of them of the library, once asked for."""

    def search(self, start: Obj, name: str) -> Obj:
        """The first holder of a slot among ``start`` and its ancestors, or ``NOWHERE``.  The answer is stored in the
        cache of ``start``, in which the caller has not found it.
        """
        if len(self._named) > MAX_NAMES:
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
            if len(path) == room:  # prototypes may form a circle (Brent's algorithm)
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

    def forget_slot(self, name: str) -> None:
        """Drop the answers for a name, after a slot of this name was added to or removed from an object with a
        cache.
        """
        for obj in self._named.pop(name, ()):
            if obj.cache:
                obj.cache.pop(name, None)

    def flush(self) -> None:
        """Drop all caches, because prototypes have changed."""
        for obj in self._seen:
            obj.cache = None
        self._seen = Bag()
        self._named.clear()
        self.library.clear()
