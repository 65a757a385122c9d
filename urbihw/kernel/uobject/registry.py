"""State shared by all devices of one kernel: their names, statistics, threads, and the entry point for other
threads.
"""

from __future__ import annotations

import itertools
import logging
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, TypeVar
from weakref import WeakValueDictionary

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.uobject.stats import Stats
from urbihw.kernel.uobject.threads import Threads

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.uobject")

T = TypeVar("T")


class ModuleHost(Protocol):
    """Looks up variables and loads modules for the registry; implemented by the kernel's ``Host``."""

    def var(self, name: str) -> Any:
        """The variable (``UVar``) of a name.  Raises ValueError if there is no such object."""
        ...

    def load_module(self, name: str) -> Any:
        """Import a Python module and register its classes; raises DeviceError."""
        ...


class Registry:
    """The devices of one world: ``registry_of(world)``.

    ``holder`` is urbiscript's ``uobjects``; its slots are the classes and instances, by their unique names.
    ``hook_changed`` is ``UVar.hookChanged``: whether new variables have the ``changed`` event.  ``remove_throwing`` is
    ``UVar.removeThrowingCallbacks``, the initial value for new variables.
    """

    def __init__(self, world: World, holder: Obj, host: ModuleHost, hook_changed: bool) -> None:
        self.world = world
        self.host = host
        self.holder = holder
        self.stats = Stats()
        self.threads = Threads(world.scheduler)
        self.hook_changed = hook_changed
        self.remove_throwing = True
        self.thread = threading.get_ident()
        self.connections: dict[Any, Any] = {}
        """Lobby -> connection of the remote that uses the lobby."""
        self.owners: dict[Obj, Any] = {}
        """Object of a remote -> connection of the remote."""
        self.orphaned_objects: WeakValueDictionary[tuple[str, str], Obj] = WeakValueDictionary()
        """Token of a disconnected remote and name -> an object of it that is still referenced.  The object is reused if
        the remote connects again."""
        self.replaceable: dict[str, Obj] = {}
        """Classes of the server that a remote may replace by its own, by name; they are restored when the remote
        disconnects.
        """
        self.tickets = itertools.count(1)
        self.prefix = "object_"
        self._count = 0
        self._after: tuple[list[Callable[[], None]], list[Callable[[], None]]] = ([], [])
        self._hooked = False

    def fresh_name(self) -> str:
        """A name for a new instance: ``object_`` and a number."""
        while True:
            self._count += 1
            name = f"{self.prefix}{self._count}"
            if name not in self.holder.slots:
                return name

    def connection_with(self, name: str) -> Any:
        """The connection that owns a name of ``uobjects``; None if there is none."""
        return next((one for one in self.connections.values() if one.has_name(name)), None)

    def count_name(self, name: str) -> None:
        """Register a name that a remote has chosen, so that ``fresh_name`` does not return it."""
        head, _, number = name.rpartition("_")
        if head == "object" and number.isdigit() and len(number) < 12:
            self._count = max(self._count, int(number))

    def add(self, name: str, face: Obj) -> None:
        """Store an object in a slot of ``uobjects`` and set its name."""
        self.world.ops.put_slot(face, "__uobjectName", self.world.string(name))
        self.world.ops.put_slot(self.holder, name, face)

    def remove(self, name: str, face: Obj) -> None:
        """Remove an object from ``uobjects``; no error if it is not there."""
        if self.holder.slots.get(name) is face:
            self.world.ops.remove_slot(self.holder, name)
            if name in self.replaceable:
                self.world.ops.put_slot(self.holder, name, self.replaceable[name])

    def object(self, path: str) -> Any:
        """The value for a path of names, such as ``object_3`` or ``robot.arm``.  Raises ``lookup failed``."""
        world = self.world
        found: Any = world.global_
        for index, name in enumerate(path.split(".")):
            if index == 0 and name in self.holder.slots:
                found = self.holder.slots[name]
            elif not (index == 0 and name == "Global"):
                found = world.get_slot(found, name)
        return found

    def var(self, name: str) -> Any:
        """The variable of a name."""
        return self.host.var(name)

    def class_name(self, face: Any) -> str:
        """The class of a device, for messages."""
        python = getattr(face, "python", None)
        return "UObject" if python is None else python.urbi_class()

    # ---------------------------------------------------------------- running device code

    def guarded(self, action: Callable[[], Any], what: str) -> None:
        """Run device code and measure it.  An exception is logged in one line and is not propagated."""
        try:
            if self.stats.enabled:
                self.stats.timed(what, action)
            else:
                action()
        except errors.ThrownError as error:
            log.error("%s failed: %s", what, "; ".join(self.world.describe(error)))
        except Exception as error:
            log.error("%s failed: %s: %s", what, type(error).__name__, error)
            log.debug("its traceback", exc_info=error)

    def after_round(self, action: Callable[[], None], late: bool = False) -> None:
        """Run ``action`` once at the end of the present round of the scheduler; ``late`` actions run last."""
        if not self._hooked:
            self._hooked = True
            self.world.scheduler.add_round_hook(self._round_over)
        self._after[late].append(action)

    def _round_over(self) -> None:
        if self._after[0] or self._after[1]:
            actions = self._after[0] + self._after[1]
            self._after = ([], [])
            for action in actions:
                action()

    # ---------------------------------------------------------------- other threads

    @property
    def foreign(self) -> bool:
        """Whether the calling thread is not the kernel's thread."""
        return threading.get_ident() != self.thread

    def call(self, action: Callable[[], T]) -> T:
        """From any thread: run ``action`` in the kernel's thread and wait for its result or exception."""
        if threading.get_ident() == self.thread:
            return action()
        over = threading.Event()
        answers: list[T] = []
        errors: list[Exception] = []

        def run() -> None:
            try:
                answers.append(action())
            except Exception as error:
                errors.append(error)
            over.set()

        self.world.scheduler.post(run)
        over.wait()
        if errors:
            raise errors[0]
        return answers[0]


def registry_of(world: World) -> Registry:
    """The registry of a world."""
    return world.part(Registry)
