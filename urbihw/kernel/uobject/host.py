"""What a platform holds of the kernel: register classes, make objects, run urbiscript, come back from other threads.

``Observer`` is told of everything that devices bind; in a process of their own it tells the server.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.uobject.modules import classes_of, import_module
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.uevent import UEvent
from urbihw.kernel.uobject.uobject import UObject, UObjectFace, UObjectHub, install_functions
from urbihw.kernel.uobject.uvalue import to_urbi
from urbihw.kernel.uobject.uvar import UVar

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.uobject")

RTP_MODULE = "urbi/rtp"

U = TypeVar("U", bound=UObject)
H = TypeVar("H", bound=UObjectHub)


class Programs(Protocol):
    """What runs urbiscript text (see ``lobby.shell.Programs``)."""

    def evaluate(self, text: str, this: Any, file: str | None = None) -> Any:
        """Run a program in the running job."""
        ...


class Observer:
    """Hears of what devices do; this one does nothing, as is right for devices in the process of the server."""

    def registered(self, face: UObjectFace) -> None:
        """There is one more class."""

    def made(self, device: UObject) -> None:
        """There is one more instance; its declarations are bound."""

    def bound_var(self, device: UObject, var: UVar) -> None:
        """A variable is bound."""

    def bound_event(self, device: UObject, name: str, event: UEvent) -> None:
        """An event is bound."""

    def bound_function(self, device: UObject, name: str, method: Callable[..., Any]) -> None:
        """A function is bound late."""

    def notified(self, device: UObject, var: UVar) -> None:
        """A device wants to hear of a variable."""

    def access_notified(self, device: UObject, var: UVar) -> None:
        """A device wants to hear when a variable is read."""

    def listened(self, device: UObject, event: UEvent, handler: Callable[..., Any] | None) -> None:
        """A device wants to hear of an event."""

    def destroyed(self, device: UObject) -> None:
        """An instance ended."""

    def put(self, holder: UObject | None, name: str, value: Any) -> None:
        """A plain slot of a device, or of Global, was set to an urbiscript value."""

    def find(self, path: str) -> Any:
        """The object that a path means, if the observer knows better; else None."""
        return None

    def adopt(self, var: UVar) -> None:
        """A variable was asked for by its name."""

    def send(self, text: str) -> bool:
        """Run urbiscript; false if the kernel at hand is to do it."""
        return False


class Host:
    """One kernel as seen by device code."""

    def __init__(self, world: World, programs: Programs) -> None:
        self.world = world
        self.registry = registry_of(world)
        self.registry.find_var = self.var
        self.registry.load_module = self.load_module
        self.observer = Observer()
        self.rtp = False
        """Whether the module ``urbi/rtp`` was loaded: values of devices in another process may travel by RTP."""
        self._programs = programs
        self._classes: dict[type[UObject], UObjectFace] = {}
        self._hubs: dict[type[UObject], UObjectHub] = {}

    def now(self) -> float:
        """Seconds of the kernel's clock."""
        return self.world.scheduler.clock.now()

    # ---------------------------------------------------------------- classes and instances

    def register(self, kind: type[UObject]) -> UObjectFace:
        """Make a device class known to urbiscript, as a slot of ``uobjects``, which everybody sees (UStart); once is
        enough.  Of a hub, the one instance is made."""
        known = self._classes.get(kind)
        if known is not None:
            return known
        name = kind.uname or kind.__name__
        face = UObjectFace(self.world, [self.world.uobject_proto], self, kind)
        face.slots["type"] = self.world.string(name)
        install_functions(self.world, kind, face)
        self.registry.add(name, face)
        self._classes[kind] = face
        if issubclass(kind, UObjectHub):
            hub = kind(self, face)
            face.python, face.lasting = hub, True
            self._hubs[kind] = hub
            self.observer.registered(face)
            hub.init()
        else:
            self.observer.registered(face)
        return face

    def classes(self) -> list[UObjectFace]:
        """The classes registered so far."""
        return list(self._classes.values())

    def load_module(self, name: str) -> list[UObjectFace]:
        """Import a module from URBI_UOBJECT_PATH and register its classes; raises BadConfig, one line that says why.

        ``urbi/rtp`` is a part of this package and switches RTP on.
        """
        if name == RTP_MODULE:
            self.rtp = True
            return []
        return [self.register(kind) for kind in classes_of(import_module(name))]

    def create(self, kind: type[U], name: str | None = None, *args: Any) -> U:
        """A new instance, as ``Class.new(args)`` would make it, but for this: no program may destroy it.

        ``name`` makes it a slot of Global.
        """
        face = self.register(kind).clone()
        face.lasting = True
        made = face.python
        assert isinstance(made, kind)
        made.init(*args)
        if name is not None:
            self.put(name, made)
        return made

    def hub(self, kind: type[H]) -> H:
        """The instance of a class of hubs (getUObjectHub)."""
        self.register(kind)
        found = self._hubs[kind]
        assert isinstance(found, kind)
        return found

    # ---------------------------------------------------------------- objects by name

    def var(self, name: str) -> UVar:
        """The variable ``object.slot``, hooked if need be; raises ValueError if there is no such object."""
        path, dot, slot = name.rpartition(".")
        return self.registry.call(lambda: self._var(path if dot else "Global", slot))

    def _var(self, path: str, slot: str) -> UVar:
        holder = self._object(path)
        known = holder.slots.get(slot)
        found = known if isinstance(known, UVar) else UVar(self.world, holder, slot, value=known)
        self.observer.adopt(found)
        return found

    def event(self, name: str) -> UEvent:
        """The event ``object.slot``, made if there is none; raises ValueError if there is no such object."""
        path, dot, slot = name.rpartition(".")
        return self.registry.call(lambda: self._event(path if dot else "Global", slot))

    def _event(self, path: str, slot: str) -> UEvent:
        holder = self._object(path)
        known = holder.slots.get(slot)
        if not isinstance(known, Event):
            known = Event(self.world, [self.world.event_proto])
            self.world.ops.put(holder, slot, known)
        return UEvent(self.world, known, f"{path}.{slot}")

    def _object(self, path: str) -> Obj:
        try:
            found = self.observer.find(path)
            return self.world.as_obj(self.registry.object(path) if found is None else found)
        except errors.UrbiError:
            raise ValueError(f"there is no object {path}") from None

    def put(self, name: str, value: Any) -> None:
        """Set a slot of Global to a Python value, a device (its face), or an urbiscript value."""
        self.put_slot(None, name, value)

    def put_slot(self, device: UObject | None, name: str, value: Any) -> None:
        """Set a plain slot of a device, or of Global if that is None."""
        made = to_urbi(self.world, value)
        self.world.ops.put(self.world.global_ if device is None else device.face, name, made)
        self.observer.put(device, name, made)

    # ---------------------------------------------------------------- running

    def run(self, text: str, file: str, done: Callable[[str], None] = lambda problem: None) -> None:
        """Run urbiscript of the robot itself in Global, in a job of its own, as if loaded from ``file``.

        What it changes in the library is what the library should be from then on (``record.adopt``).
        ``done(problem)`` is called at the end, with "" or one line that says what went wrong and where
        (``file:line.column: message``).
        """

        def body() -> None:
            try:
                self.world.record.adopt(lambda: self._programs.evaluate(text, self.world.global_, file))
            except Exception as error:
                done(self.world.describe(error)[0])
            else:
                done("")

        self.world.scheduler.spawn(body, file)

    def send(self, text: str, source: str) -> None:
        """Run urbiscript at the server, from any thread; ``source`` names the device in the log if it goes wrong."""

        def report(problem: str) -> None:
            if problem:
                log.error("urbiscript sent by %s: %s", source, problem)

        def run() -> None:
            if not self.observer.send(text):
                self.run(text, source, report)

        self.registry.call(run)

    def call(self, target: str, function: str, *args: Any) -> None:
        """Call ``target.function(args)`` at the server, in a job of its own, from any thread."""

        def body() -> None:
            self.world.send(self.registry.object(target), function, *(to_urbi(self.world, value) for value in args))

        def run() -> None:
            if not self.observer.send(self._call_text(target, function, args)):
                what = f"call of {target}.{function}"
                self.world.scheduler.spawn(lambda: self.registry.guarded(body, what), function)

        self.registry.call(run)

    def _call_text(self, target: str, function: str, args: tuple[Any, ...]) -> str:
        values = ", ".join(self.world.printable(to_urbi(self.world, value)) for value in args)
        return f"{target}.{function}({values}),"

    def each_round(self, action: Callable[[], None]) -> None:
        """Call ``action`` (outside any job; it must be quick) at the end of each round of the scheduler: the time to
        send in one message what all jobs wanted in that round."""
        self.world.scheduler.add_round_hook(action)

    def post(self, action: Callable[[], None]) -> None:
        """From any thread: run ``action`` in the kernel's thread, soon."""
        self.world.scheduler.post(lambda: self.guarded(action, "posted action"))

    def guarded(self, action: Callable[[], Any], what: str) -> None:
        """Run device code so that its errors are logged in one line and go no further."""
        self.registry.guarded(action, what)

    # ---------------------------------------------------------------- what devices tell

    def made(self, device: UObject) -> None:
        """An instance was made."""
        self.observer.made(device)

    def bound_var(self, device: UObject, var: UVar) -> None:
        """A variable was bound."""
        self.observer.bound_var(device, var)

    def bound_event(self, device: UObject, name: str, event: UEvent) -> None:
        """An event was bound."""
        self.observer.bound_event(device, name, event)

    def bound_function(self, device: UObject, name: str, method: Callable[..., Any]) -> None:
        """A function was bound late."""
        self.observer.bound_function(device, name, method)

    def notified(self, device: UObject, var: UVar) -> None:
        """A callback was set."""
        self.observer.notified(device, var)

    def access_notified(self, device: UObject, var: UVar) -> None:
        """An access callback was set."""
        self.observer.access_notified(device, var)

    def listened(self, device: UObject, event: UEvent, handler: Callable[..., Any] | None) -> None:
        """A handler of an event was set."""
        self.observer.listened(device, event, handler)

    def destroyed(self, device: UObject) -> None:
        """An instance ended."""
        name = device.unique_name
        self.registry.remove(name, device.face)
        self.observer.destroyed(device)
