"""What all devices of one kernel share: their names, statistics, threads, and the way in from other threads."""

from __future__ import annotations

import itertools
import logging
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar
from weakref import WeakValueDictionary

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.uobject.stats import Stats
from urbihw.kernel.uobject.threads import Threads

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.uobject")

T = TypeVar("T")


class Registry:
    """The devices of one world; ``world.uobjects``.

    ``holder`` is urbiscript's ``uobjects``, whose slots are the classes and instances by their unique names.
    ``hook_changed`` is ``UVar.hookChanged``: whether variables made from now on have the ``changed`` event.
    """

    def __init__(self, world: World, holder: Obj) -> None:
        self.world = world
        self.holder = holder
        self.stats = Stats()
        self.threads = Threads(world.scheduler)
        self.hook_changed = True
        self.thread = threading.get_ident()
        self.find_var: Callable[[str], Any] = lambda name: None
        """Finds a variable by its name (``UVar``); the host knows how."""
        self.load_module: Callable[[str], Any] = _no_host
        self.connections: dict[Any, Any] = {}
        """Lobby to the remote behind it."""
        self.owners: dict[Obj, Any] = {}
        """Object of a remote to its connection."""
        self.left: WeakValueDictionary[tuple[str, str], Obj] = WeakValueDictionary()
        """Token of a remote that is gone and name to an object of it that somebody still holds: if it comes back, they
        are what they were."""
        self.replaceable: dict[str, Obj] = {}
        """Classes of the server of which a remote may have its own, by name; they are back when it is gone."""
        self.open_port: Any = None
        """Makes what carries RTP packets; the remote protocol says what."""
        self.midnight = 0.0
        """Seconds from ``System.timeReference`` to the moment at which the clock showed zero."""
        self.tickets = itertools.count(1)
        self.prefix = "object_"
        self._count = 0
        self._after: tuple[list[Callable[[], None]], list[Callable[[], None]]] = ([], [])
        self._hooked = False

    def fresh_name(self) -> str:
        """A name for one more instance: ``object_`` and a number."""
        while True:
            self._count += 1
            name = f"{self.prefix}{self._count}"
            if name not in self.holder.slots:
                return name

    def connection_with(self, name: str) -> Any:
        """The connection to which a name of ``uobjects`` belongs, None if to none."""
        return next((one for one in self.connections.values() if one.has_name(name)), None)

    def count_name(self, name: str) -> None:
        """A name was taken by somebody else: do not give it out again."""
        head, _, number = name.rpartition("_")
        if head == "object" and number.isdigit() and len(number) < 12:
            self._count = max(self._count, int(number))

    def add(self, name: str, face: Obj) -> None:
        """Make an object a slot of ``uobjects``; it learns its name."""
        self.world.ops.put(face, "__uobjectName", self.world.string(name))
        self.world.ops.put(self.holder, name, face)

    def remove(self, name: str, face: Obj) -> None:
        """Take an object out of ``uobjects``; harmless if it is not there."""
        if self.holder.slots.get(name) is face:
            self.world.ops.remove_slot(self.holder, name)
            if name in self.replaceable:
                self.world.ops.put(self.holder, name, self.replaceable[name])

    def object(self, path: str) -> Any:
        """The value that a path of names means, ``object_3`` or ``robot.arm``; raises ``lookup failed``."""
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
        return self.find_var(name)

    def class_name(self, face: Any) -> str:
        """The class of a device, for messages."""
        return type(face.python).__name__ if getattr(face, "python", None) is not None else "UObject"

    # ---------------------------------------------------------------- running device code

    def guarded(self, action: Callable[[], Any], what: str) -> None:
        """Run device code so that it is measured, and its errors are logged in one line and go no further."""
        try:
            if self.stats.enabled:
                self.stats.timed(what, action)
            else:
                action()
        except errors.UrbiError as error:
            log.error("%s failed: %s", what, "; ".join(self.world.describe(error)))
        except Exception as error:
            log.error("%s failed: %s: %s", what, type(error).__name__, error)
            log.debug("its traceback", exc_info=error)

    def after_round(self, action: Callable[[], None], late: bool = False) -> None:
        """Run ``action`` once at the end of the present round of the scheduler, those that are ``late`` last."""
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
        """Whether this is another thread than the kernel's."""
        return threading.get_ident() != self.thread

    def call(self, action: Callable[[], T]) -> T:
        """From any thread: run ``action`` in the kernel's thread and wait for what it gives or raises."""
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


def _no_host(name: str) -> Any:
    raise RuntimeError("this world has no host")


def registry_of(world: World) -> Registry:
    """The registry of a world."""
    found: Any = world.uobjects
    assert isinstance(found, Registry)
    return found
