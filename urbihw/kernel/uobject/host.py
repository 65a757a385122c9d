"""The kernel as a platform sees it: it registers classes, makes objects, runs urbiscript and accepts calls from other
threads.

``Observer`` is notified of everything that devices bind; the observer of a remote process forwards it to the server.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.clock import LedClock
from urbihw.kernel.sched.signals import JobSignal
from urbihw.kernel.uobject.modules import classes_of, import_module
from urbihw.kernel.uobject.registry import Registry
from urbihw.kernel.uobject.uevent import UEvent
from urbihw.kernel.uobject.uobject import UObject, UObjectFace, UObjectHub, install_functions
from urbihw.kernel.uobject.uvalue import to_urbi
from urbihw.kernel.uobject.uvar import UVar

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.uobject")

RTP_MODULE = "urbi/rtp"
HOOK_CHANGED = "URBI_UVAR_HOOK_CHANGED"
"""The environment variable that switches off the event ``changed`` of new variables."""

U = TypeVar("U", bound=UObject)
H = TypeVar("H", bound=UObjectHub)


class TextRunner(Protocol):
    """Runs urbiscript text; implemented by ``lobby.shell.Programs``."""

    def evaluate(self, text: str, this: Any, file: str | None = None) -> Any:
        """Run a program in the running job."""
        ...


class Observer:
    """Is notified of the actions of devices.  This base class does nothing, which is right for devices in the server's
    process.
    """

    def registered(self, face: UObjectFace) -> None:
        """A class was registered."""

    def made(self, device: UObject) -> None:
        """An instance was made; its declarations are bound."""

    def bound_var(self, device: UObject, var: UVar) -> None:
        """A variable was bound."""

    def bound_event(self, device: UObject, name: str, event: UEvent) -> None:
        """An event was bound."""

    def bound_function(self, device: UObject, name: str, method: Callable[..., Any]) -> None:
        """A function was bound after construction."""

    def notified(self, device: UObject, var: UVar) -> None:
        """A device has set a change callback on a variable."""

    def access_notified(self, device: UObject, var: UVar) -> None:
        """A device has set an access callback on a variable."""

    def listened(self, device: UObject, event: UEvent, handler: Callable[..., Any] | None) -> None:
        """A device has added a handler to an event."""

    def destroyed(self, device: UObject) -> None:
        """An instance was destroyed."""

    def put(self, holder: UObject | None, name: str, value: Any) -> None:
        """A plain slot of a device, or of Global if ``holder`` is None, was set to an urbiscript value."""

    def find(self, path: str) -> Any:
        """The object for a path, if the observer knows another one than the kernel; else None."""
        return None

    def looked_up(self, var: UVar) -> None:
        """A variable was looked up by its name."""

    def send(self, text: str) -> bool:
        """Run urbiscript; returns false if this kernel must run it."""
        return False


class Host:
    """One kernel as device code sees it."""

    def __init__(self, world: World, programs: TextRunner) -> None:
        self.world = world
        holder = world.global_.slots["uobjects"]
        assert isinstance(holder, Obj)
        self.registry = Registry(world, holder, self, HOOK_CHANGED not in os.environ)
        world.install_part(self.registry)
        self.observer = Observer()
        self.rtp = False
        """Whether the module ``urbi/rtp`` is loaded: values of devices in another process may then be sent by RTP."""
        self._programs = programs
        self._classes: dict[type[UObject], UObjectFace] = {}
        self._hubs: dict[type[UObject], UObjectHub] = {}

    def now(self) -> float:
        """Present time of the kernel's clock, in seconds."""
        return self.world.scheduler.clock.now()

    # ---------------------------------------------------------------- time that a simulation leads

    def lead_time(self, seconds: float) -> None:
        """It is this time of the kernel's clock, until the next call; it has no effect on a clock that is not led."""
        clock = self.world.scheduler.clock
        if isinstance(clock, LedClock):
            clock.lead(seconds)

    def release_time(self) -> None:
        """The simulation is gone: the kernel's clock runs by itself."""
        clock = self.world.scheduler.clock
        if isinstance(clock, LedClock):
            clock.release()
            self.world.scheduler.post(lambda: None)

    def is_idle(self) -> bool:
        """Whether no job wants to run at the present time of the clock."""
        scheduler = self.world.scheduler
        return not scheduler.ready and scheduler.timers.soonest > scheduler.clock.now()

    # ---------------------------------------------------------------- classes and instances

    def register(self, kind: type[UObject]) -> UObjectFace:
        """Make a device class known to urbiscript as a slot of ``uobjects``, visible to all connections (UStart).  A
        second call has no effect.  For a hub class, its single instance is made too."""
        known = self._classes.get(kind)
        if known is not None:
            return known
        name = kind.urbi_class()
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
        """Import a module from URBI_UOBJECT_PATH and register its classes.  Raises BadConfig with the reason in one
        line.

        ``urbi/rtp`` is built in and enables RTP.
        """
        if name == RTP_MODULE:
            self.rtp = True
            return []
        return [self.register(kind) for kind in classes_of(import_module(name))]

    def create(self, kind: type[U], name: str | None = None, *args: Any) -> U:
        """Make an instance as ``Class.new(args)`` does, except that urbiscript programs cannot destroy it.

        With ``name``, the instance is also stored in that slot of Global.
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
        """The single instance of a hub class (getUObjectHub)."""
        self.register(kind)
        found = self._hubs[kind]
        assert isinstance(found, kind)
        return found

    # ---------------------------------------------------------------- objects by name

    def var(self, name: str) -> UVar:
        """The variable ``object.slot``; a plain slot is hooked.  Raises ValueError if there is no such object."""
        path, dot, slot = name.rpartition(".")
        return self.registry.call(lambda: self._var(path if dot else "Global", slot))

    def _var(self, path: str, slot: str) -> UVar:
        holder = self._object(path)
        known = holder.slots.get(slot)
        found = known if isinstance(known, UVar) else UVar(self.world, holder, slot, value=known)
        self.observer.looked_up(found)
        return found

    def event(self, name: str) -> UEvent:
        """The event ``object.slot``; it is made if the slot does not exist.  Raises ValueError if there is no such
        object.
        """
        path, dot, slot = name.rpartition(".")
        return self.registry.call(lambda: self._event(path if dot else "Global", slot))

    def _event(self, path: str, slot: str) -> UEvent:
        holder = self._object(path)
        known = holder.slots.get(slot)
        if not isinstance(known, Event):
            known = Event(self.world, [self.world.event_proto])
            self.world.ops.put_slot(holder, slot, known)
        return UEvent(self.world, known, f"{path}.{slot}")

    def _object(self, path: str) -> Obj:
        try:
            found = self.observer.find(path)
            return self.world.as_obj(self.registry.object(path) if found is None else found)
        except errors.ThrownError:
            raise ValueError(f"there is no object {path}") from None

    def has_slot(self, name: str) -> bool:
        """Whether Global has a slot of this name."""
        return name in self.world.global_.slots

    def device(self, name: str) -> UObject | None:
        """The device in a slot of Global; None if the slot does not exist or holds no device."""
        face = self.world.global_.slots.get(name)
        return face.python if isinstance(face, UObjectFace) else None

    def name_of(self, device: UObject) -> str | None:
        """The name of the first slot of Global that holds a device; None if there is none."""
        return self.world.global_name(device.face)

    def put(self, name: str, value: Any) -> None:
        """Set a slot of Global to a Python value, a device or an urbiscript value."""
        self.put_slot(None, name, value)

    def put_slot(self, device: UObject | None, name: str, value: Any) -> None:
        """Set a plain slot of a device, or of Global if that is None."""
        made = to_urbi(self.world, value)
        self.world.ops.put_slot(self.world.global_ if device is None else device.face, name, made)
        self.observer.put(device, name, made)

    # ---------------------------------------------------------------- running

    def run(
        self,
        text: str,
        file: str,
        done: Callable[[str], None] = lambda problem: None,
        ordered: int | None = None,
    ) -> None:
        """Run urbiscript of the platform in Global, in a job of its own, as if it was loaded from ``file``.

        Its changes to the library become part of the library's protected state (``record.adopt``).  ``done(problem)``
        is called at the end, with "" or with one line that states the error and its place (``file:line.column:
        message``).  ``ordered``: ``Job.ordered``, None for now.
        """

        def body() -> None:
            try:
                self.world.record.adopt(lambda: self._programs.evaluate(text, self.world.global_, file))
            except JobSignal:
                done(f"{file}: its job was ended")
                raise
            except Exception as error:
                done(self.world.describe(error)[0])
            else:
                done("")

        self.world.scheduler.spawn(body, file).begin_statement(ordered)

    def _ordered(self) -> int:
        """The ``Job.ordered`` of what a device does: that of the running job, 0 outside of jobs, as in a timer."""
        job = self.world.scheduler.current
        return 0 if job is None else job.ordered

    def send(self, text: str, source: str) -> None:
        """Run urbiscript at the server, from any thread; ``source`` names the device in the log if the code fails."""

        def report(problem: str) -> None:
            if problem:
                log.error("urbiscript sent by %s: %s", source, problem)

        def run() -> None:
            if not self.observer.send(text):
                self.run(text, source, report, self._ordered())

        self.registry.call(run)

    def call(self, target: str, function: str, *args: Any) -> None:
        """Call ``target.function(args)`` at the server, in a job of its own, from any thread."""
        self._call(target, function, args, self._ordered)

    def order(self, target: str, function: str, *args: Any) -> None:
        """The same for an order of somebody else, such as a program on the robot that calls a module of ours."""
        self._call(target, function, args, lambda: None)

    def _call(self, target: str, function: str, args: tuple[Any, ...], ordered: Callable[[], int | None]) -> None:
        def body() -> None:
            self.world.send(self.registry.object(target), function, *(to_urbi(self.world, value) for value in args))

        def run() -> None:
            if not self.observer.send(self._call_text(target, function, args)):
                what = f"call of {target}.{function}"
                job = self.world.scheduler.spawn(lambda: self.registry.guarded(body, what), function)
                job.begin_statement(ordered())

        self.registry.call(run)

    def _call_text(self, target: str, function: str, args: tuple[Any, ...]) -> str:
        values = ", ".join(self.world.printable(to_urbi(self.world, value)) for value in args)
        return f"{target}.{function}({values}),"

    def each_round(self, action: Callable[[], None]) -> None:
        """Call ``action`` at the end of each round of the scheduler, outside any job; it must return quickly.  It can
        send the requests of all jobs of that round in one message."""
        self.world.scheduler.add_round_hook(action)

    def post(self, action: Callable[[], None]) -> None:
        """From any thread: run ``action`` in the kernel's thread as soon as possible."""
        self.world.scheduler.post(lambda: self.guarded(action, "posted action"))

    def guarded(self, action: Callable[[], Any], what: str) -> None:
        """Run device code.  An exception is logged in one line and is not propagated."""
        self.registry.guarded(action, what)

    # ---------------------------------------------------------------- what devices tell

    def made(self, device: UObject) -> None:
        """Notify the observer of a new instance."""
        self.observer.made(device)

    def bound_var(self, device: UObject, var: UVar) -> None:
        """Notify the observer of a bound variable."""
        self.observer.bound_var(device, var)

    def bound_event(self, device: UObject, name: str, event: UEvent) -> None:
        """Notify the observer of a bound event."""
        self.observer.bound_event(device, name, event)

    def bound_function(self, device: UObject, name: str, method: Callable[..., Any]) -> None:
        """Notify the observer of a function that was bound after construction."""
        self.observer.bound_function(device, name, method)

    def notified(self, device: UObject, var: UVar) -> None:
        """Notify the observer of a change callback."""
        self.observer.notified(device, var)

    def access_notified(self, device: UObject, var: UVar) -> None:
        """Notify the observer of an access callback."""
        self.observer.access_notified(device, var)

    def listened(self, device: UObject, event: UEvent, handler: Callable[..., Any] | None) -> None:
        """Notify the observer of an event handler."""
        self.observer.listened(device, event, handler)

    def destroyed(self, device: UObject) -> None:
        """Notify the observer of a destroyed instance."""
        name = device.unique_name
        self.registry.remove(name, device.face)
        self.observer.destroyed(device)
