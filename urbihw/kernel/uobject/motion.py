"""Who may move a robot: the motion epoch, the leases of clients, and the origin of each effector write.

A robot has one ``Motion``.  Its *epoch* is a number that is incremented by each stop.  Each request for a movement
carries an ``Origin``: the epoch in which it was written and the client that wrote it.  An origin of an older epoch, or
of a client that has disconnected, is invalid; a request with an invalid origin is dropped wherever it waits: in a job,
in a device, on the way to the bus worker.  So no list of movements has to be searched at a stop.

The age of a statement is the epoch in which it began (``Job.era``).  If a statement began before a stop and tries to
move the robot after it, it gets an error with the reason; a program that catches the error continues like a new
statement.

A *movement*, such as ``go`` of a mobile robot, is controlled by the jobs of a tag.  It has the devices that these jobs
have written; the first write to one of them by anybody else ends the movement, and everything it moves stands before
that write takes effect.

A client (a lobby) holds a *lease* on the effectors that it wrote last.  They are stopped when its connection ends.
They are also stopped when the client closes its sending side, because it then cannot stop them any more.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

from urbihw.frozen import frozen
from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import NO_STACK, Stack, later_stack
from urbihw.kernel.uobject.arming import Arming

if TYPE_CHECKING:
    from urbihw.kernel.sched.job import Job
    from urbihw.kernel.uobject.host import Host

ROBOT = "robot"
"""The client name of writes without a connection: files loaded at start, and devices in the server."""


def no_stack() -> Stack:
    """The call stack of a write outside user programs."""
    return NO_STACK


WARNING_PERIOD_S: Final = 10.0
"""Seconds after which the same warning is given to the same client again."""


@frozen
class Origin:
    """The origin of an effector write.

    Attributes:
        epoch: epoch of the robot at the time of the write.
        client: name and address of the connection; ``ROBOT`` for writes without a connection.
        tag: the innermost tag made by the user, "" for none.
        stack: the calls that led to the write, looked up when somebody asks for ``place``.
        time: time of the statement's first write to this effector, in seconds of the kernel's clock.
        lobby: that of the client, None for the robot itself.
        mark: distinguishes writes before a stop of a single device from writes after it.
        pace: the highest speed of the movement that writes, in units of its slot per second; inf for a plain write.
    """

    epoch: int
    client: str
    tag: str
    stack: Callable[[], Stack]
    time: float
    lobby: Any = None
    mark: int = 0
    pace: float = math.inf

    @property
    def place(self) -> str:
        """Location of the statement, not of a function that it has called, such as ``3.1-20``; "" outside user
        programs.
        """
        stack = self.stack()
        return str((stack.calls[-1].location if stack.calls else stack.location) or "")

    def __str__(self) -> str:
        tag, place = f", tag {self.tag}" if self.tag else "", self.place
        return f"{self.client}{tag}" + (f", at {place}" if place else "")

    def warn(self, text: str) -> None:
        """Print a warning for the client that wrote, with the place in its program."""
        output = getattr(self.lobby, "output", None)
        if output is not None:
            place = self.place
            output.line(f"!!! {place}{': ' if place else ''}warning: {text}", "warning")


@dataclass(slots=True)
class GuardedMovement:
    """A movement in progress: the tag of the jobs that control it, what ends it, and the devices that it has moved."""

    tag: Any
    end: Callable[[], Any]
    devices: set[Hashable] = field(default_factory=set)


class Motion:
    """The authority over the motion of one robot in the kernel; the bus worker checks each command again.

    Attributes:
        epoch: the epoch number, as counted by the bus worker.
        stops: number of stops of any kind, including stops of parts of the robot.
        reason: reason of the last stop.
        latched: reason of the active emergency stop, "" if there is none; ``release`` ends it.
        keep: whether a movement continues when its client has disconnected.
        held: device -> reason why it may not move at present.
        absent: device, None for all -> why writes to it do not act at present, and the lowest ``Job.era`` of a
            statement that began after the loss (``set_absent``).
        absences: how often ``absent`` has changed.
        at_rest: whether no write was accepted since the last stop.
        arming: what may move the robot after the release of an emergency stop.
    """

    def __init__(self, host: Host, name: str, stop_devices: Callable[[tuple[Hashable, ...], str], None]) -> None:
        """``stop_devices(devices, reason)`` stops what a client moves whose lease is over."""
        self._world = host.world
        self._name = name
        self._stop_devices = stop_devices
        self.epoch = 0
        self.stops = 0
        self.reason = ""
        self.latched = ""
        self.keep = False
        self.held: dict[Hashable, str] = {}
        self.absent: dict[Hashable, tuple[str, int]] = {}
        self.absences = 0
        self.at_rest = False
        self._mark = 0
        self.arming = Arming(host.world, name)
        self._ended: dict[Hashable, tuple[int, str]] = {}
        self._moved_by: dict[Hashable, Origin] = {}
        self._movements: list[GuardedMovement] = []
        self._warnings: list[tuple[Any, str, float]] = []
        self._told: list[tuple[Any, str]] = []
        self._limits_told: list[tuple[Any, str]] = []
        self._world.client_gone.append(self._client_gone)
        self._world.devices_released.append(self._client_lets_go)

    def close(self) -> None:
        """Unsubscribe from the lobbies."""
        if self._client_gone in self._world.client_gone:
            self._world.client_gone.remove(self._client_gone)
            self._world.devices_released.remove(self._client_lets_go)

    # ---------------------------------------------------------------- stopping

    def person(self) -> str:
        """Who runs the present statement, whatever connection is used: ``Lobby.person``, or ``ROBOT``."""
        job = self._world.scheduler.current
        lobby = None if job is None else job.context
        return str(getattr(lobby, "person", ROBOT))

    def hold(self, holders: Iterable[str]) -> None:
        """An emergency stop of ``holders`` holds: nothing moves until ``release``."""
        self.latched = " and ".join(holders)

    def asked(self) -> str:
        """The requester of the present stop, in words."""
        return f"stop asked by {self.origin()}"

    def advance(self, reason: str, epoch: int | None = None) -> None:
        """Register a stop of the robot: all earlier writes become invalid.  ``epoch`` is the worker's new epoch."""
        # A stop that began here comes back as the worker's report: it is registered already.
        if epoch is not None and epoch <= self.epoch:
            return
        scheduler = self._world.scheduler
        self.epoch = self.epoch + 1 if epoch is None else epoch
        # Two numbers: that of the worker counts stops of this robot, that of the scheduler orders statements.  Jobs of
        # earlier statements keep the older number, so a loop that runs on cannot move the robot again.
        self._mark = scheduler.begin_era()
        self.reason = reason
        self.stops += 1
        self.at_rest = True
        self._moved_by.clear()

    def release(self) -> None:
        """The emergency stop is over.  What was ordered until now may not move the robot any more, even if it catches
        errors or is an ``at`` that waits: a motion without an order is not expected.
        """
        if self.latched:
            self.latched = ""
            self.arming.release()

    def end(self, device: Hashable, reason: str) -> None:
        """End the movements of one device: statements that began before may not move it any more."""
        self._ended[device] = self._world.scheduler.begin_era(), reason
        self._moved_by.pop(device, None)

    def renew(self) -> None:
        """Make the running job valid again after a stop: its next writes count as new."""
        job = self._world.scheduler.current
        if job is not None:
            job.renew()

    def check(self) -> None:
        """Raise the error for a statement that began before the last stop, or before its client let go."""
        job = self._world.scheduler.current
        if job is None:
            return
        self.arming.check(job)
        if job.era < self._mark:
            raise errors.MovementStopped(f"{self._name} was stopped after this statement had begun: {self.reason}")
        silence = getattr(job.context, "silence", "")
        if silence:
            raise errors.MovementRefused(f"{_client(job.context)} {silence}, so it cannot move {self._name}")
        if job.era < getattr(job.context, "released_at", 0):
            raise errors.MovementStopped(
                f"{_client(job.context)} has released its devices after this statement had begun"
            )

    # ---------------------------------------------------------------- writing

    @property
    def running(self) -> Job | None:
        """The job that runs at present."""
        return self._world.scheduler.current

    def admit(
        self, device: Hashable, last: Origin | None = None, statement: object = None, pace: float = math.inf
    ) -> Origin:
        """Check a write of the running job to an effector of ``device``, and return the origin of the write.

        ``last`` is reused if it belongs to the same ``statement``; ``pace`` is that of the movement.  Raises an
        urbiscript error when the statement began before the last stop, an emergency stop is active, or the client has
        disconnected.
        """
        self.check()
        self.check_device(device)
        origin = last
        if origin is None or statement is None or not self.is_live(origin, device):
            origin = self.origin()
        if origin.pace != pace:
            origin = replace(origin, pace=pace)
        if not self._lease_lasts(origin):
            gone = f"the connection of {origin.client} is closed on its side"
            raise errors.MovementRefused(f"{gone}, so it cannot move {self._name}")
        if self._movements:
            self._give_way(device)
        self._moved_by[device] = origin
        self.at_rest = False
        return origin

    # ---------------------------------------------------------------- what cannot act

    def set_absent(self, device: Hashable, reason: str) -> None:
        """Say why writes to a device (None for all) do not act from now on; "" when they act again."""
        if reason:
            self.absent.setdefault(device, (reason, self._world.scheduler.begin_era()))
        else:
            back, _ = self.absent.pop(device, ("", 0))
            self._told = [(lobby, told) for lobby, told in self._told if told != back]
        self.absences += 1

    def is_absent(self, device: Hashable) -> bool:
        """Whether writes to a device do not act at present."""
        return None in self.absent or device in self.absent

    def explain_absence(self, device: Hashable) -> str:
        """Why writes to a device do not act at present, "" if they do."""
        return (self.absent.get(None) or self.absent.get(device, ("", 0)))[0]

    def warn_of_absence(self, device: Hashable, origin: Origin) -> None:
        """Warn the client that wrote to an absent device, once of each loss, also if many devices are lost with it.

        There is no warning for a statement that began before the loss, because it continues when the device is back;
        nor for a movement (``begin_movement``), which reports the loss itself.
        """
        reason, mark = self.absent.get(None) or self.absent.get(device, ("", 0))
        job = self._world.scheduler.current
        if not reason or job is None or job.era < mark or self.in_movement:
            return
        if not any(lobby is origin.lobby and told == reason for lobby, told in self._told):
            present = [each for each in self._told if getattr(each[0], "connected", True)]
            self._told = [*present, (origin.lobby, reason)]
            origin.warn(reason)

    def warn(self, origin: Origin, text: str) -> None:
        """Warn the client that wrote, with the same text at most every WARNING_PERIOD_S seconds."""
        now = self.now()
        self._warnings = [each for each in self._warnings if now - each[2] < WARNING_PERIOD_S]
        if not any(lobby is origin.lobby and text == told for lobby, told, _ in self._warnings):
            self._warnings.append((origin.lobby, text, now))
            origin.warn(text)

    def warn_of_limit(self, limit: str, origin: Origin) -> None:
        """Warn the client that wrote of a limit of the settings, once of each: a trajectory meets it at each step."""
        if origin.lobby is not None and not any(
            lobby is origin.lobby and limit == told for lobby, told in self._limits_told
        ):
            present = [each for each in self._limits_told if getattr(each[0], "connected", True)]
            self._limits_told = [*present, (origin.lobby, limit)]
            origin.warn(f"limited by {limit}")

    # ---------------------------------------------------------------- movements

    def begin_movement(self, tag: Any, end: Any) -> None:
        """Begin a movement controlled by the jobs of an urbiscript tag; the urbiscript function ``end`` ends it.

        Raises ValueError if ``tag`` is no tag.
        """
        kernel_tag = getattr(tag, "tag", None)
        if kernel_tag is None:
            raise ValueError("a movement needs the tag of its jobs")
        self.end_movement(tag)
        self._movements.append(GuardedMovement(kernel_tag, lambda: self._world.invoke(end, end, (), "end")))

    def end_movement(self, tag: Any) -> None:
        """The movement of a tag is over; nothing happens if there is none."""
        kernel_tag = getattr(tag, "tag", None)
        self._movements = [each for each in self._movements if each.tag is not kernel_tag]

    def _give_way(self, device: Hashable) -> None:
        """Add a device to the movement of the running job, and end the other movements that have moved it."""
        job = self._world.scheduler.current
        for movement in list(self._movements):
            if job is not None and any(entry.tag is movement.tag for entry in job.entries):
                movement.devices.add(device)
            elif device in movement.devices:
                self._movements.remove(movement)
                movement.end()

    @property
    def in_movement(self) -> bool:
        """Whether the running job controls a movement."""
        job = self._world.scheduler.current
        tags = [movement.tag for movement in self._movements]
        return job is not None and any(entry.tag in tags for entry in job.entries)

    def since(self, device: Hashable) -> int:
        """The lowest ``Job.era`` of a statement that may move a device."""
        return max(self._mark, self._ended.get(device, (0, ""))[0])

    def check_device(self, device: Hashable) -> None:
        """Raise the error for a device that may not move now: emergency stop, overheating, lost device."""
        if self.latched:
            why = f"{self._name} is held by an emergency stop ({self.latched}): release it first"
            raise errors.MovementRefused(why)
        if device in self.held:
            raise errors.MovementRefused(f"{device} is held by {self.held[device]}")
        job = self._world.scheduler.current
        mark, reason = self._ended.get(device, (0, ""))
        if job is not None and job.era < mark:
            raise errors.MovementStopped(f"the movement of {device} is over: {reason}")

    def is_live(self, origin: Origin, device: Hashable = None) -> bool:
        """Whether a request with this origin may still move the robot, or the given device of it."""
        if origin.epoch != self.epoch or self.latched or not self._lease_lasts(origin):
            return False
        if origin.mark < getattr(origin.lobby, "released_at", 0):
            return False
        return device not in self._ended or origin.mark >= self._ended[device][0]

    def now(self) -> float:
        """The time of the present round, in seconds of the kernel's clock."""
        return self._world.scheduler.now

    def own(self) -> Origin:
        """The origin of movements that the robot starts by itself."""
        scheduler = self._world.scheduler
        return Origin(self.epoch, ROBOT, "", no_stack, scheduler.clock.now(), None, scheduler.era)

    def _lease_lasts(self, origin: Origin) -> bool:
        return self.keep or origin.lobby is None or bool(getattr(origin.lobby, "in_command", True))

    def origin(self) -> Origin:
        """The origin of a write at this moment."""
        job = self._world.scheduler.current
        if job is None:
            return self.own()
        scheduler = self._world.scheduler
        client, now = _client(job.context), scheduler.clock.now()
        return Origin(self.epoch, client, _tag(job), later_stack(), now, job.context, scheduler.era)

    # ---------------------------------------------------------------- leases

    def _client_gone(self, lobby: Any) -> None:
        self.arming.client_gone(lobby)
        if not self.keep:
            self._end_of_lease(lobby, f"the connection of {_client(lobby)} is closed, which moved it")

    def _client_lets_go(self, lobby: Any) -> None:
        self._end_of_lease(lobby, f"{_client(lobby)} {getattr(lobby, 'silence', '') or 'has released it'}")

    def _end_of_lease(self, lobby: Any, reason: str) -> None:
        devices = tuple(device for device, origin in self._moved_by.items() if origin.lobby is lobby)
        if devices:
            for device in devices:
                del self._moved_by[device]
            self.stops += 1
            self._stop_devices(devices, reason)


def _client(lobby: Any) -> str:
    """The name of a client."""
    return str(getattr(lobby, "title", ROBOT))


def _tag(job: Job) -> str:
    """The name of the innermost user-made tag of a job."""
    lobby = getattr(getattr(job.context, "tag", None), "tag", None)
    for entry in reversed(job.entries):
        name = entry.tag.name
        if entry.tag is not lobby and name not in _UNNAMED:
            return name
    return ""


_UNNAMED = frozenset({"scope", "tag", "loop", "movement"})
"""The names of tags that the kernel makes itself."""
