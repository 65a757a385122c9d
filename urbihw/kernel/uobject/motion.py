"""Who may move a robot: the motion epoch, the leases of clients, and the origin of each effector write.

A robot has one ``Motion``.  Its *epoch* is a number that is incremented by each stop.  Each request for a movement
carries an ``Origin``: the epoch in which it was written and the client that wrote it.  An origin of an older epoch, or
of a client that has disconnected, is invalid; a request with an invalid origin is dropped wherever it waits: in a job,
in a device, on the way to the bus worker.  So no list of movements has to be searched at a stop.

The age of a statement is the epoch in which it began (``Job.epoch``).  If a statement began before a stop and tries to
move the robot after it, it gets an error with the reason; a program that catches the error continues like a new
statement.

A client (a lobby) holds a *lease* on the effectors that it wrote last.  They are stopped when its connection ends.
They are also stopped when the client closes its sending side, because it then cannot stop them any more.
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
from urbihw.kernel.uobject.uvalue import from_urbi
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uobject.values import finite_number

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.uobject.host import Host

ROBOT = "robot"
"""The client name of writes without a connection: files loaded at start, and devices in the server."""


@dataclass(frozen=True, slots=True)
class Origin:
    """The origin of an effector write.

    Attributes:
        epoch: epoch of the robot at the time of the write.
        client: name and address of the connection; ``ROBOT`` for writes without a connection.
        tag: the innermost tag made by the user, "" for none.
        place: location of the statement, such as ``3.1-20``; "" outside user programs.
        time: time of the statement's first write to this effector, in seconds of the kernel's clock.
        lease: the lobby, None for the robot itself.
        mark: distinguishes writes before a stop of a single device from writes after it.
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

    def warn(self, text: str) -> None:
        """Print a warning for the client that wrote, with the place in its program."""
        output = getattr(self.lease, "output", None)
        if output is not None:
            place = f"{self.place}: " if self.place else ""
            output.line(f"!!! {place}warning: {text}", "warning")


class Motion:
    """The authority over the motion of one robot in the kernel; the bus worker checks each command again.

    Attributes:
        epoch: the epoch number, as counted by the bus worker.
        stops: number of stops of any kind, including stops of parts of the robot.
        reason: reason of the last stop.
        latched: reason of the active emergency stop, "" if there is none.
        keep: whether a movement continues when its client has disconnected.
        held: device -> reason why it may not move at present.
        at_rest: whether no write was accepted since the last stop.
    """

    def __init__(self, host: Host, name: str, release: Callable[[tuple[Hashable, ...], str], None]) -> None:
        """``release(devices, reason)`` stops the devices of a client that has disconnected."""
        self._world = host.world
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
        self._world.client_gone.append(self._client_gone)

    def close(self) -> None:
        """Unsubscribe from the lobbies."""
        if self._client_gone in self._world.client_gone:
            self._world.client_gone.remove(self._client_gone)

    # ---------------------------------------------------------------- stopping

    def asked(self) -> str:
        """The requester of the present stop, in words."""
        return f"stop asked by {self.origin()}"

    def advance(self, reason: str, epoch: int | None = None) -> None:
        """Register a stop of the robot: all earlier writes become invalid.  ``epoch`` is the worker's new epoch."""
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
        """End the movements of one device: statements that began before may not move it any more."""
        self._world.scheduler.epoch += 1
        self._ended[device] = self._world.scheduler.epoch, reason
        self._moved_by.pop(device, None)

    def renew(self) -> None:
        """Make the running job valid again after a stop: its next writes count as new."""
        job = self._world.scheduler.current
        if job is not None:
            job.renew()

    def check(self) -> None:
        """Raise the error for a statement that began before the last stop."""
        job = self._world.scheduler.current
        if job is not None and job.epoch < self._mark:
            raise errors.Stopped(f"{self._name} was stopped after this statement had begun: {self.reason}")

    # ---------------------------------------------------------------- writing

    @property
    def running(self) -> Job | None:
        """The running job."""
        return self._world.scheduler.current

    def admit(self, device: Hashable, last: Origin | None = None, statement: object = None) -> Origin:
        """Check a write of the running job to an effector of ``device``, and return the origin of the write.

        ``last`` is reused if it belongs to the same ``statement``.  Raises an urbiscript error when the statement began
        before the last stop, an emergency stop is active, or the client has disconnected.
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
        """The lowest ``Job.epoch`` of a statement that may move a device."""
        return max(self._mark, self._ended.get(device, (0, ""))[0])

    def check_device(self, device: Hashable) -> None:
        """Raise the error for a device that may not move now: emergency stop, overheating, lost device."""
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
        """Whether a request with this origin may still move the robot, or the given device of it."""
        if origin.epoch != self.epoch or self.latched or not self._lease_lasts(origin):
            return False
        return device not in self._ended or origin.mark >= self._ended[device][0]

    def now(self) -> float:
        """The time of the present round, in seconds of the kernel's clock."""
        return self._world.scheduler.now

    def own(self) -> Origin:
        """The origin of movements that the robot starts by itself."""
        scheduler = self._world.scheduler
        return Origin(self.epoch, ROBOT, "", "", scheduler.clock.now(), None, scheduler.epoch)

    def _lease_lasts(self, origin: Origin) -> bool:
        return self.keep or origin.lease is None or bool(getattr(origin.lease, "in_command", True))

    def origin(self) -> Origin:
        """The origin of a write at this moment."""
        job = self._world.scheduler.current
        if job is None:
            return self.own()
        stack = current_stack()
        # The statement itself, not the function that it has called.
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
"""Value of ``limitedBy`` for writes to a device that is switched off."""


class Effector:
    """The guard of one variable that moves the robot (see ``EffectorDevice``).

    Attributes:
        origin: origin of the last accepted write.
        device: the device that it moves, by its name in the bus worker.
        limited: the last write as limited by the worker, and the name of the limit.  It is valid until the next report
            of the worker or the next stop.  None while no limit acts.
    """

    def __init__(self, motion: Motion, device: Hashable, var: UVar, face: EffectorDevice) -> None:
        self.origin = motion.own()
        self._motion = motion
        self.device = device
        self._var = var
        self._face = face
        self._statement: object = None
        self._limited: tuple[int, Any, str] | None = None
        var.effector = self

    def admit(self, wanted: Any, value: Any) -> None:
        """Check a write.  ``wanted`` is the assigned value, ``value`` what the range of the slot leaves of it.

        Raises an urbiscript error if the writer may not move the robot (see ``Motion.admit``) or the value is no finite
        number.
        """
        if wanted.__class__ is not float:
            self._check_number(wanted)
        elif not math.isfinite(wanted):
            raise errors.primitive(f"takes a finite number, not {wanted:g}", self._var.name)
        frame, job = calling_frame(), self._motion.running
        statement = None if frame is None else (id(job), frame.f_code, frame.f_lasti)
        known = self.origin if statement == self._statement else None
        self.origin = self._motion.admit(self.device, known, statement)
        self._statement = statement
        self._face.wrote(self, wanted, value)

    def _check_number(self, wanted: Any) -> None:
        """Raise the error for a value that is neither a number nor a truth value; nothing was requested by it."""
        try:
            finite_number(from_urbi(wanted))
        except ValueError as error:
            raise errors.primitive(str(error), self._var.name) from error

    @property
    def limited(self) -> tuple[Any, str] | None:
        """The limited value and the name of the limit; None while no limit acts."""
        return None if self._limited is None or self._limited[0] != self._motion.stops else self._limited[1:]

    def set_limited(self, value: Any, limit: str) -> None:
        """Store the worker's report: the limited value and the name of the limit, "" for none."""
        self._limited = (self._motion.stops, value, limit) if limit else None

    @property
    def since(self) -> int:
        """The lowest ``Job.epoch`` of a statement that may move this effector."""
        return self._motion.since(self.device)

    def limits(self) -> str:
        """The range of the slot, in words."""
        least, most = (self._var.get_property(name) for name in ("rangemin", "rangemax"))
        return f"range of {self._var.name}: {least:g} to {most:g}"


class EffectorDevice(UObject):
    """A device with effectors: it shows the requested value, the applied value and the writer.

    ``requested`` and ``applied`` are the last written value and the value after the limits, in the unit of the written
    slot; ``limitedBy`` is the name of the limit, "" if there was none; ``why`` describes the writer.  ``limited`` is
    emitted with the name of the limit when a write is limited and the write before was not.

    A write while the device is switched off is limited by ``OFF``: ``applied`` is nan and ``why`` explains how to
    switch the device on.  Each client that writes gets the same explanation once as a warning or, if ``off_is_error``
    is set, as the error of each such write.
    """

    off_is_error: ClassVar[bool] = False
    slot_words = {
        "requested": ("value last written", "1"),
        "applied": ("value last written after the limits, nan while the device is off", "1"),
        "limitedBy": ("limit that changed the value last written, empty for none", ""),
        "why": ("who wrote last: connection, tag, place in the program, time", ""),
        "limited": ("event: a limit begins to act; with its name", ""),
    }

    requested = reading(math.nan)
    applied = reading(math.nan)
    limitedBy = reading("")
    why = reading("")
    limited = event()

    def guard(self, motion: Motion, device: Hashable, var: UVar) -> Effector:
        """Guard a variable: only a writer that may move ``device`` at that time can write it."""
        self.notify_access(self.why, self._tell_why)
        return Effector(motion, device, var, self)

    def wrote(self, effector: Effector, wanted: Any, value: Any) -> None:
        """A write was accepted."""
        self._last_effector = effector
        self.requested.sense(wanted)
        off = self.explain_off()
        if off:
            self.show_applied(math.nan, OFF)
            if not self.off_is_error:
                self.warn(effector.origin, off)
            return
        if self._warned:
            self._warned = []
        limited = effector.limited
        if limited is not None:
            self.show_applied(*limited)
        else:
            self.show_applied(value, effector.limits() if value is not wanted and value != wanted else "")

    def limit_applied(self, value: Any, limit: str) -> None:
        """Store the worker's report about the last write: the limited value and the name of the limit, "" when no limit
        acts any more.
        """
        if self._last_effector is not None:
            self._last_effector.set_limited(value, limit)
        if self.limitedBy.sensed != OFF:
            self.show_applied(value, limit)

    def show_applied(self, value: Any, limit: str) -> None:
        """Set ``applied`` and ``limitedBy`` after a write."""
        self.applied.sense(value)
        if limit != self.limitedBy.sensed:
            self.limitedBy.sense(limit)
            if limit:
                self.limited.emit(limit)

    def explain_off(self) -> str:
        """The reason why the device ignores writes and how to switch it on, in words; "" while it is on.  Override."""
        return ""

    _last_effector: Effector | None = None
    _warned: Sequence[Any] = ()
    """The clients that were warned since the device was switched off."""

    def warn(self, origin: Origin, text: str) -> None:
        """Warn the writing client once; a trajectory writes at each of its steps."""
        if origin.lease is not None and all(lease is not origin.lease for lease in self._warned):
            present = [lease for lease in self._warned if getattr(lease, "connected", True)]
            self._warned = [*present, origin.lease]
            origin.warn(text)

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
    """The name of the innermost user-made tag of a job."""
    lobby = getattr(getattr(job.context, "tag", None), "tag", None)
    for entry in reversed(job.entries):
        name = entry.tag.name
        if entry.tag is not lobby and name not in _UNNAMED:
            return name
    return ""


_UNNAMED = frozenset({"scope", "tag", "loop"})
"""The names of tags that the kernel makes itself."""
