"""Periodic readings: each watch is a job with its own period, and the job that is overdue longest is executed first.

A job sends one telegram when it is due; for a sensor on the I2C bus, one step of several.
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


class ReadingJob(ABC):
    """The items of one device, read together every ``period`` seconds, at most once per tick."""

    in_steps = False
    """Whether a reading takes several telegrams; several of them may be sent in one tick."""

    def __init__(self, device: Any, period: float, now: float) -> None:
        self.device = device
        self.period = period
        self.due = now

    @abstractmethod
    def telegram(self, now: float) -> bytes:
        """Return the telegram to send now."""

    @abstractmethod
    def parse_reply(self, reply: bytes, now: float) -> Values | None:
        """Return the values in a reply, None if there are none yet.  Raises BadFrame, Refused."""

    def failed(self, now: float) -> Values | None:
        """Handle a missing or bad reply; return values if the failure means a value."""
        self.due = now + self.period
        return None

    def rest_until(self, when: float) -> None:
        """Send nothing before a time: the start of the next tick."""
        if not self.in_steps:
            self.due = max(self.due, when)

    def _done(self, now: float) -> None:
        # Count from now, not from the due time: otherwise late readings pile up on a slow link.
        self.due = max(self.due + self.period, now)


class OutputJob(ReadingJob):
    """Reads the state of a motor."""

    def telegram(self, now: float) -> bytes:
        """Return GETOUTPUTSTATE of the motor."""
        return p.output_state(p.OUTPUTS.index(self.device))

    def parse_reply(self, reply: bytes, now: float) -> Values | None:
        """Return power, mode, run state and rotation.  Raises BadFrame for another motor's reply."""
        self._done(now)
        state = p.parse_output_state(reply)
        if state.port != p.OUTPUTS.index(self.device):
            raise BadFrame(f"the reply is about motor {state.port}, not {self.device}")
        return {"power": state.power, "mode": state.mode, "run_state": state.run_state, "rotation": state.rotation}


class InputJob(ReadingJob):
    """Reads an analog sensor; there are no values while the brick settles after a change of the type."""

    def telegram(self, now: float) -> bytes:
        """Return GETINPUTVALUES of the port."""
        return p.input_values(self.device - 1)

    def parse_reply(self, reply: bytes, now: float) -> Values | None:
        """Return the values of the sensor, None while the brick marks them invalid."""
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


class DistanceJob(ReadingJob):
    """Reads an ultrasonic sensor."""

    in_steps = True

    def __init__(self, device: Any, period: float, now: float) -> None:
        super().__init__(device, period, now)
        self._steps = Ultrasonic(device - 1, now)

    def telegram(self, now: float) -> bytes:
        """Return the telegram of the present step of the measurement."""
        return self._steps.telegram(now)

    def parse_reply(self, reply: bytes, now: float) -> Values | None:
        """Advance the measurement; return the distance after its last step."""
        distance = self._steps.parse_reply(reply, now, self.period)
        self.due = self._steps.due
        return None if distance is None else {"distance": distance}

    def failed(self, now: float) -> Values | None:
        """Return the distance of a sensor without an echo; the measurement starts again."""
        distance = self._steps.failed(now)
        self.due = self._steps.due
        return {"distance": distance}


class BatteryJob(ReadingJob):
    """Reads the voltage of the battery."""

    def telegram(self, now: float) -> bytes:
        return p.battery()

    def parse_reply(self, reply: bytes, now: float) -> Values | None:
        """Return the voltage in mV."""
        self._done(now)
        return {"millivolts": p.parse_battery(reply)}


_KINDS: Final[dict[type[ReadingJob], tuple[str, ...]]] = {
    OutputJob: ("power", "mode", "run_state", "rotation"),
    InputJob: ("kind", "mode", "raw", "normalised", "scaled"),
    DistanceJob: ("distance",),
    BatteryJob: ("millivolts",),
}
_DEVICES: Final[dict[type[ReadingJob], tuple[Any, ...]]] = {
    OutputJob: p.OUTPUTS,
    InputJob: p.INPUTS,
    DistanceJob: p.INPUTS,
    BatteryJob: (BRICK,),
}


class Plan:
    """All jobs of a brick."""

    def __init__(self) -> None:
        self._periods: dict[tuple[Any, type[ReadingJob]], float] = {}
        self._jobs: dict[tuple[Any, type[ReadingJob]], ReadingJob] = {}

    def watch(self, device: Any, items: Iterable[str], period: float | None, now: float) -> None:
        """Begin to read items; with the period None, end it.  Raises BadValue for an unknown item."""
        for item in items:
            key = (device, _kind_of(device, item))
            if period is None:
                self._periods.pop(key, None)
                self._jobs.pop(key, None)
            else:
                self._periods[key] = period
                self._jobs[key] = key[1](device, period, now)

    def restart(self, now: float) -> None:
        """Restart all jobs, on a new link."""
        self._jobs = {key: key[1](key[0], period, now) for key, period in self._periods.items()}

    def next_job(self, now: float) -> ReadingJob | None:
        """Return the job that is overdue longest, None if none is due."""
        job = min(self._jobs.values(), key=lambda each: each.due, default=None)
        return job if job is not None and job.due <= now else None

    def is_wanted(self, job: ReadingJob) -> bool:
        """Return whether the job is still watched."""
        return job in self._jobs.values()


def _kind_of(device: Any, item: str) -> type[ReadingJob]:
    for kind, items in _KINDS.items():
        if item in items and device in _DEVICES[kind]:
            return kind
    raise BadValue(f"port {device!r} of an NXT has no {item!r}")
