"""Who may move a robot: the motion epoch, the leases of clients, and where each effector write came from.

A robot has one ``Motion``.  Its *epoch* is a number that each stop advances.  Whatever is to move the robot carries an
``Origin``: the epoch in which it was written and the client that asked for it.  An origin of an older epoch, or of a
client that is gone, is dead; what carries it is dropped wherever it waits: in a job, in a device, on the way to the bus
worker.  So nobody keeps a list of what a stop has to end.

A statement is as old as the moment in which it began (``Job.epoch``).  A statement that began before a stop and tries
to move the robot after it gets an error that says why; a program that catches it goes on as if begun anew.

A client (a lobby) holds a *lease* on the effectors that it wrote last.  When its connection ends they are stopped,
and also when it ends its sending side, because then it cannot stop them any more.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import calling_frame, current_stack
from urbihw.kernel.uobject.declarations import event, reading
from urbihw.kernel.uobject.uobject import UObject
from urbihw.kernel.uobject.uvar import UVar

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.sched.job import Job

ROBOT = "robot"
"""The client of what no connection asked for: files loaded at start, devices in the server."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Where an effector write came from.

    Attributes:
        epoch: of the robot when it was written.
        client: name of the connection, its address behind it; ``ROBOT`` for none.
        tag: the innermost tag of the user's, "" for none.
        place: where the statement stands, such as ``3.1-20``; "" where no program of a user's is.
        time: when the statement first wrote this effector, in seconds of the kernel's clock.
        lease: the lobby, None for the robot itself.
        mark: tells what was written before a device was stopped alone from what came after it.
    """

    epoch: int
    client: str
    tag: str
    place: str
    time: float
    lease: Any = None
    mark: int = 0

    def __str__(self) -> str:
        tag = f", tag {self.tag}" if self.tag else ""
        return f"{self.client}{tag}" + (f", at {self.place}" if self.place else "")


class Motion:
    """The authority over the motion of one robot, as the kernel sees it; the bus worker has the last word.

    Attributes:
        epoch: as the bus worker counts it.
        stops: how many stops of any kind there were, of parts of the robot too.
        reason: why it was last stopped.
        latched: why an emergency stop holds, "" if none does.
        keep: motion goes on when the client that asked for it is gone.
        held: device -> why it may not move at present.
        at_rest: nothing was let through since the last stop.
    """

    def __init__(self, world: World, name: str, release: Callable[[tuple[Hashable, ...], str], None]) -> None:
        """``release(devices, reason)`` stops the devices of a client that is gone."""
        self._world = world
        self._name = name
        self._release = release
        self.epoch = 0
        self.stops = 0
        self.reason = ""
        self.latched = ""
        self.keep = False
        self.held: dict[Hashable, str] = {}
        self.at_rest = False
        self._mark = 0
        self._ended: dict[Hashable, tuple[int, str]] = {}
        self._moved_by: dict[Hashable, Origin] = {}
        world.client_gone.append(self._client_gone)

    def close(self) -> None:
        """Hear no more of clients."""
        if self._client_gone in self._world.client_gone:
            self._world.client_gone.remove(self._client_gone)

    # ---------------------------------------------------------------- stopping

    def asked(self) -> str:
        """Who asks for a stop now, in words."""
        return f"stop asked by {self.origin()}"

    def advance(self, reason: str, epoch: int | None = None) -> None:
        """The robot is stopped: all that was written before is dead.  ``epoch`` is the worker's new one."""
        if epoch is not None and epoch <= self.epoch:
            return
        scheduler = self._world.scheduler
        self.epoch = self.epoch + 1 if epoch is None else epoch
        scheduler.epoch += 1
        self._mark = scheduler.epoch
        self.reason = reason
        self.stops += 1
        self.at_rest = True
        self._moved_by.clear()

    def end(self, device: Hashable, reason: str) -> None:
        """The movements of one device are over: statements that began before may not move it any more."""
        self._world.scheduler.epoch += 1
        self._ended[device] = self._world.scheduler.epoch, reason
        self._moved_by.pop(device, None)

    def renew(self) -> None:
        """The running job knows of the stop: what it does from now on is new."""
        job = self._world.scheduler.current
        if job is not None:
            job.renew()

    def check(self) -> None:
        """Raise the error that a statement gets which began before the last stop."""
        job = self._world.scheduler.current
        if job is not None and job.epoch < self._mark:
            raise errors.Stopped(f"{self._name} was stopped after this statement had begun: {self.reason}")

    # ---------------------------------------------------------------- writing

    @property
    def running(self) -> Job | None:
        """The running job."""
        return self._world.scheduler.current

    def admit(self, device: Hashable, last: Origin | None = None, statement: object = None) -> Origin:
        """The running job writes an effector of ``device``: where that comes from.

        ``last`` serves again if it is of the same ``statement``.  Raises an urbiscript error when the statement began
        before the last stop, an emergency stop holds, or the client is gone.
        """
        self.check()
        self.check_device(device)
        origin = last
        if origin is None or origin.epoch != self.epoch or statement is None:
            origin = self.origin()
        if not self._lease_lasts(origin):
            gone = f"the connection of {origin.client} is closed on its side"
            raise errors.Refused(f"{gone}, so it cannot move {self._name}")
        self._moved_by[device] = origin
        self.at_rest = False
        return origin

    def since(self, device: Hashable) -> int:
        """``Job.epoch`` of the oldest statement that may move a device."""
        return max(self._mark, self._ended.get(device, (0, ""))[0])

    def check_device(self, device: Hashable) -> None:
        """Raise the error of what may not move this device now: an emergency stop, its heat, its loss."""
        if self.latched:
            why = f"{self._name} is held by an emergency stop ({self.latched}): release it first"
            raise errors.Refused(why)
        if device in self.held:
            raise errors.Refused(f"{device} is held by {self.held[device]}")
        job = self._world.scheduler.current
        mark, reason = self._ended.get(device, (0, ""))
        if job is not None and job.epoch < mark:
            raise errors.Stopped(f"the movement of {device} is over: {reason}")

    def is_live(self, origin: Origin, device: Hashable = None) -> bool:
        """Whether what carries this origin may still move the robot, or this device of it."""
        if origin.epoch != self.epoch or self.latched or not self._lease_lasts(origin):
            return False
        return device not in self._ended or origin.mark >= self._ended[device][0]

    def now(self) -> float:
        """The time of the present round, in seconds of the kernel's clock."""
        return self._world.scheduler.now

    def own(self) -> Origin:
        """The origin of what the robot does by itself now."""
        scheduler = self._world.scheduler
        return Origin(self.epoch, ROBOT, "", "", scheduler.clock.now(), None, scheduler.epoch)

    def _lease_lasts(self, origin: Origin) -> bool:
        return self.keep or origin.lease is None or bool(getattr(origin.lease, "in_command", True))

    def origin(self) -> Origin:
        """Where something comes from that is written now."""
        job = self._world.scheduler.current
        if job is None:
            return self.own()
        stack = current_stack()
        # The statement itself, rather than the function that it has come to.
        place = str((stack.calls[-1].location if stack.calls else stack.location) or "")
        scheduler = self._world.scheduler
        client, now = _client(job.context), scheduler.clock.now()
        return Origin(self.epoch, client, _tag(job), place, now, job.context, scheduler.epoch)

    # ---------------------------------------------------------------- leases

    def _client_gone(self, lease: Any) -> None:
        if self.keep:
            return
        devices = tuple(device for device, origin in self._moved_by.items() if origin.lease is lease)
        if devices:
            for device in devices:
                del self._moved_by[device]
            self.stops += 1
            self._release(devices, f"the connection of {_client(lease)} is closed, which moved it")


OFF: Final = "off"
"""``limitedBy`` of what is written to a device that is switched off."""


class Effector:
    """What guards one variable that moves the robot: see ``EffectorDevice``.

    Attributes:
        origin: of the last write that was let through.
        device: what it moves, by the name that the bus worker knows.
        met: what a limit of the worker has left of the last write, and the name of the limit: so it is with what is
            written until the worker tells something else, or a stop.  None while no limit acts.
    """

    def __init__(self, motion: Motion, device: Hashable, var: UVar, face: EffectorDevice) -> None:
        self.origin = motion.own()
        self._motion = motion
        self.device = device
        self._var = var
        self._face = face
        self._statement: object = None
        self._met: tuple[int, Any, str] | None = None
        var.effector = self

    def admit(self, wanted: Any, value: Any) -> None:
        """Somebody assigns ``wanted``, of which the range of the slot leaves ``value``.

        Raises an urbiscript error for what may not move the robot (see ``Motion.admit``) or is no finite number.
        """
        if wanted.__class__ is float and not math.isfinite(wanted):
            raise errors.primitive(f"takes a finite number, not {wanted:g}", self._var.name)
        frame, job = calling_frame(), self._motion.running
        statement = None if frame is None else (id(job), frame.f_code, frame.f_lasti)
        known = self.origin if statement == self._statement else None
        self.origin = self._motion.admit(self.device, known, statement)
        self._statement = statement
        self._face.wrote(self, wanted, value)

    @property
    def met(self) -> tuple[Any, str] | None:
        """See above."""
        return None if self._met is None or self._met[0] != self._motion.stops else self._met[1:]

    def meet(self, value: Any, limit: str) -> None:
        """The worker tells what a limit has left of what was written; "" for none."""
        self._met = (self._motion.stops, value, limit) if limit else None

    @property
    def since(self) -> int:
        """``Job.epoch`` of the oldest statement that may move it."""
        return self._motion.since(self.device)

    def limits(self) -> str:
        """The range of the slot, in words."""
        least, most = (self._var.get_property(name) for name in ("rangemin", "rangemax"))
        return f"range of {self._var.name}: {least:g} to {most:g}"


class EffectorDevice(UObject):
    """A device that moves: it shows what was asked of it, what became of that, and who asked.

    ``requested`` and ``applied`` are the last value written and what the limits left of it, in the unit of the slot
    that was written; ``limitedBy`` names the limit, "" when there was none; ``why`` tells who wrote it.  ``limited``
    is emitted with the name of the limit when a write meets one that the write before did not meet.

    A write while the device is switched off is limited by ``OFF``: ``applied`` is nan, ``why`` says how to switch it
    on, and so does one warning to each client that writes meanwhile, or, where ``off_is_error``, the error that the
    device raises for each such write.
    """

    off_is_error: ClassVar[bool] = False

    requested = reading(math.nan)
    applied = reading(math.nan)
    limitedBy = reading("")
    why = reading("")
    limited = event()

    def guard(self, motion: Motion, device: Hashable, var: UVar) -> Effector:
        """Let a variable be written only by who may move ``device`` now."""
        self.notify_access(self.why, self._tell_why)
        return Effector(motion, device, var, self)

    def wrote(self, effector: Effector, wanted: Any, value: Any) -> None:
        """A write was let through."""
        self._last_effector = effector
        self.requested.sense(wanted)
        off = self.explain_off()
        if off:
            self.show_applied(math.nan, OFF)
            if not self.off_is_error:
                self._warn(effector.origin, off)
            return
        if self._warned:
            self._warned = []
        met = effector.met
        if met is not None:
            self.show_applied(*met)
        else:
            self.show_applied(value, effector.limits() if value is not wanted and value != wanted else "")

    def limit_applied(self, value: Any, limit: str) -> None:
        """The worker tells what the limits left of the last write, and which did; "" when it has left a limit."""
        if self._last_effector is not None:
            self._last_effector.meet(value, limit)
        if self.limitedBy.sensed != OFF:
            self.show_applied(value, limit)

    def show_applied(self, value: Any, limit: str) -> None:
        """What became of the last write, and which limit acted on it."""
        self.applied.sense(value)
        if limit != self.limitedBy.sensed:
            self.limitedBy.sense(limit)
            if limit:
                self.limited.emit(limit)

    def explain_off(self) -> str:
        """Why nothing moves although it is told to, and how to switch it on, in words; "" while it is on; override."""
        return ""

    _last_effector: Effector | None = None
    _warned: Sequence[Any] = ()
    """The clients that were told since it is off."""

    def _warn(self, origin: Origin, text: str) -> None:
        """Tell the client that wrote, once: a trajectory writes with each of its steps."""
        output = getattr(origin.lease, "output", None)
        if output is not None and all(lease is not origin.lease for lease in self._warned):
            present = [lease for lease in self._warned if getattr(lease, "connected", True)]
            self._warned = [*present, origin.lease]
            place = f"{origin.place}: " if origin.place else ""
            output.line(f"!!! {place}warning: {text}", "warning")

    def _tell_why(self) -> None:
        if self._last_effector is not None:
            origin = self._last_effector.origin
            off = self.explain_off() if self.limitedBy.sensed == OFF else ""
            self.why.sense(f"{origin}, {origin.time:.3f} s" + (f"; {off}" if off else ""))


def _client(lease: Any) -> str:
    """The name of a client."""
    tag = getattr(lease, "tag", None)
    if tag is None:
        return ROBOT
    who = ", ".join(text for text in (getattr(lease, "user", ""), getattr(lease, "peer", None)) if text)
    return str(tag.tag.name) + (f" ({who})" if who else "")


def _tag(job: Job) -> str:
    """The innermost tag of a job that a user has named."""
    lobby = getattr(getattr(job.context, "tag", None), "tag", None)
    for entry in reversed(job.entries):
        name = entry.tag.name
        if entry.tag is not lobby and name not in _UNNAMED:
            return name
    return ""


_UNNAMED = frozenset({"scope", "tag", "loop"})
"""What the kernel calls the tags that it makes by itself."""
