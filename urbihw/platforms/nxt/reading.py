"""What is read over and over: each watch is a job with a pace of its own, the one that is overdue longest goes first.

A job sends one telegram when it is due, or, for a sensor on the I2C bus, one of several in turn.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, Final

from urbihw.buses.errors import BadFrame, BadValue
from urbihw.platforms.nxt import protocol as p
from urbihw.platforms.nxt.i2c import Ultrasonic

BRICK: Final = "brick"

Values = dict[str, Any]


class Job(ABC):
    """One device's items, read together every ``period`` seconds, but not twice in a tick."""

    in_steps = False
    """Whether a reading takes several telegrams, which may follow each other in one tick."""

    def __init__(self, device: Any, period: float, now: float) -> None:
        self.device = device
        self.period = period
        self.due = now

    @abstractmethod
    def telegram(self, now: float) -> bytes:
        """What to send now."""

    @abstractmethod
    def take(self, reply: bytes, now: float) -> Values | None:
        """The values in a reply, None if there are none yet.  Raises BadFrame, Refused."""

    def failed(self, now: float) -> Values | None:
        """No reply came, or a bad one."""
        self.due = now + self.period
        return None

    def rest_until(self, when: float) -> None:
        """Nothing more in this tick."""
        if not self.in_steps:
            self.due = max(self.due, when)

    def _done(self, now: float) -> None:
        # From now, not from when it was due: what the wire cannot carry must not pile up.
        self.due = max(self.due + self.period, now)


class OutputJob(Job):
    """A motor."""

    def telegram(self, now: float) -> bytes:
        """See ``Job``."""
        return p.output_state(p.OUTPUTS.index(self.device))

    def take(self, reply: bytes, now: float) -> Values | None:
        """See ``Job``."""
        self._done(now)
        state = p.parse_output_state(reply)
        if state.port != p.OUTPUTS.index(self.device):
            raise BadFrame(f"the reply is about motor {state.port}, not {self.device}")
        return {"power": state.power, "mode": state.mode, "run_state": state.run_state, "rotation": state.rotation}


class InputJob(Job):
    """An analog sensor; while the brick settles after a change of the type there are no values."""

    def telegram(self, now: float) -> bytes:
        """See ``Job``."""
        return p.input_values(self.device - 1)

    def take(self, reply: bytes, now: float) -> Values | None:
        """See ``Job``."""
        self._done(now)
        values = p.parse_input_values(reply)
        if values.port != self.device - 1:
            raise BadFrame(f"the reply is about port {values.port + 1}, not {self.device}")
        if not values.valid:
            return None
        return {
            "kind": values.kind,
            "mode": values.mode,
            "raw": values.raw,
            "normalised": values.normalised,
            "scaled": values.scaled,
        }


class DistanceJob(Job):
    """An ultrasonic sensor."""

    in_steps = True

    def __init__(self, device: Any, period: float, now: float) -> None:
        super().__init__(device, period, now)
        self._steps = Ultrasonic(device - 1, now)

    def telegram(self, now: float) -> bytes:
        """See ``Job``."""
        return self._steps.telegram(now)

    def take(self, reply: bytes, now: float) -> Values | None:
        """See ``Job``."""
        distance = self._steps.take(reply, now, self.period)
        self.due = self._steps.due
        return None if distance is None else {"distance": distance}

    def failed(self, now: float) -> Values | None:
        """See ``Job``."""
        distance = self._steps.failed(now)
        self.due = self._steps.due
        return {"distance": distance}


class BatteryJob(Job):
    """The battery."""

    def telegram(self, now: float) -> bytes:
        """See ``Job``."""
        return p.battery()

    def take(self, reply: bytes, now: float) -> Values | None:
        """See ``Job``."""
        self._done(now)
        return {"millivolts": p.parse_battery(reply)}


_KINDS: Final[dict[type[Job], tuple[str, ...]]] = {
    OutputJob: ("power", "mode", "run_state", "rotation"),
    InputJob: ("kind", "mode", "raw", "normalised", "scaled"),
    DistanceJob: ("distance",),
    BatteryJob: ("millivolts",),
}
_DEVICES: Final[dict[type[Job], tuple[Any, ...]]] = {
    OutputJob: p.OUTPUTS,
    InputJob: p.INPUTS,
    DistanceJob: p.INPUTS,
    BatteryJob: (BRICK,),
}


class Plan:
    """All jobs of a brick."""

    def __init__(self) -> None:
        self._periods: dict[tuple[Any, type[Job]], float] = {}
        self._jobs: dict[tuple[Any, type[Job]], Job] = {}

    def watch(self, device: Any, items: Iterable[str], period: float | None, now: float) -> None:
        """Read items from now on, or with None no more.  Raises BadValue for what no brick has."""
        for item in items:
            key = (device, _kind_of(device, item))
            if period is None:
                self._periods.pop(key, None)
                self._jobs.pop(key, None)
            else:
                self._periods[key] = period
                self._jobs[key] = key[1](device, period, now)

    def restart(self, now: float) -> None:
        """The link is new: begin everything anew."""
        self._jobs = {key: key[1](key[0], period, now) for key, period in self._periods.items()}

    def next(self, now: float) -> Job | None:
        """The job that is overdue longest, if one is due."""
        job = min(self._jobs.values(), key=lambda each: each.due, default=None)
        return job if job is not None and job.due <= now else None

    def holds(self, job: Job) -> bool:
        """Whether the job is still wanted."""
        return job in self._jobs.values()


def _kind_of(device: Any, item: str) -> type[Job]:
    for kind, items in _KINDS.items():
        if item in items and device in _DEVICES[kind]:
            return kind
    raise BadValue(f"port {device!r} of an NXT has no {item!r}")
