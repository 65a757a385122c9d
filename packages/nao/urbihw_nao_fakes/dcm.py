"""DCM: dated commands to actuators, and aliases for several of them.

A command is a point of a timeline of its actuator.  In each cycle of 10 ms the actuator gets the value that the
straight line from the last point that has passed to the next one has at that time; with no point ahead it keeps the
last value.  A point that is dated in the past acts in the next cycle.  The line begins at the last point even if that
is long ago, so a client that sends only a point ahead lets the joint leap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from urbihw_nao_fakes.body import Body, Joint
from urbihw_nao_fakes.memory import PREFIX
from urbihw_nao_fakes.services import Failed, Service, as_list, method

WRAP = 1 << 32
"""Milliseconds after which the time begins anew: it has 32 bits, with a sign."""
CYCLE = 10
"""Milliseconds between two commands to the actuators."""
SUFFIX = "/Actuator/Value"
POSITION, HARDNESS = "Position", "Hardness"
CLEAR, MERGE = "ClearAll", "Merge"


@dataclass
class Timeline:
    """The commands of one actuator: points ahead, and the last that has passed; milliseconds and values."""

    last: tuple[int, float]
    points: list[tuple[int, float]] = field(default_factory=list)

    def add(self, update: str, points: list[tuple[int, float]]) -> None:
        """New points; of two of one time the later one counts."""
        kept = {} if update == CLEAR else dict(self.points)
        self.points = sorted((kept | dict(points)).items())

    def value_at(self, now: int) -> float:
        """The command at a time; what has passed is dropped."""
        while self.points and self.points[0][0] <= now:
            self.last = self.points.pop(0)
        begun, value = self.last
        if not self.points:
            return value
        due, goal = self.points[0]
        return value + (goal - value) * (now - begun) / (due - begun)


class Dcm(Service):
    """DCM of a body.

    Attributes:
        started: its time at second 0 of ``clock``, ms.
        aliases: actuators by the name of their alias.
        writes: how many messages have brought commands; points: the dates of all points, in ms ahead of their arrival.
    """

    name = "DCM"

    def __init__(self, body: Body, clock: Callable[[], float]) -> None:
        super().__init__()
        self.body, self.clock = body, clock
        self.started = 0
        self.aliases: dict[str, list[str]] = {}
        self.writes = 0
        self.points: list[int] = []
        self._timelines: dict[str, Timeline] = {}
        self._cycle = 0
        body.on_step.append(self._command)

    def _now(self, seconds: float | None = None) -> int:
        return self.started + round((self.clock() if seconds is None else seconds) * 1000)

    def _command(self, seconds: float) -> None:
        """At the beginning of a cycle, each actuator with points that have not passed gets its command."""
        now = self._now(seconds)
        if now // CYCLE == self._cycle:
            return
        self._cycle = now // CYCLE
        for name, timeline in self._timelines.items():
            if timeline.points:
                joint, what = self._find(name)
                _set(joint, what, timeline.value_at(now))

    def _find(self, key: str) -> tuple[Joint, str]:
        joint, _, what = key.removeprefix(PREFIX).removesuffix(SUFFIX).partition("/")
        if joint not in self.body.joints or what not in (POSITION, HARDNESS):
            raise Failed(f"DCM: unknown actuator {key}")
        return self.body.joints[joint], what

    def _knows(self, key: str) -> bool:
        try:
            self._find(key)
        except Failed:
            return False
        return True

    @method("getTime", "(i)", "i")
    def get_time(self, offset: int) -> int:
        """Milliseconds, as 32 bits with a sign."""
        return (self._now() + offset + WRAP // 2) % WRAP - WRAP // 2

    @method("createAlias", "(m)", "m")
    def create_alias(self, command: Any) -> Any:
        """[name, keys]: a copy in which an unknown key is empty."""
        name, keys = command
        found = [key if self._knows(key) else "" for key in as_list(keys)]
        self.aliases[str(name)] = [key for key in found if key]
        return [name, found]

    @method("set", "(m)")
    def set_actuators(self, command: Any) -> None:
        """[key or alias, update, [[value, time] ...]]: the same points for all."""
        name, update, points = command
        keys = self.aliases.get(name, [name])
        self._add(keys, update, [points] * len(keys))

    @method("setAlias", "(m)")
    def set_alias(self, command: Any) -> None:
        """[alias, update, "time-mixed", points of each actuator]."""
        name, update, mode, rows = command
        if name not in self.aliases:
            raise Failed(f"DCM: unknown alias {name}")
        if mode != "time-mixed" or len(rows) != len(self.aliases[name]):
            raise Failed(f"DCM: {len(rows)} rows of {mode} for the {len(self.aliases[name])} actuators of {name}")
        self._add(self.aliases[name], update, rows)

    def _add(self, keys: list[str], update: str, rows: list[Any]) -> None:
        if update not in (CLEAR, MERGE) or not all(rows):
            raise Failed(f"DCM: no commands, or no update {update}")
        now = self._now()
        self.writes += 1
        for key, row in zip(keys, rows, strict=True):
            joint, what = self._find(key)
            points = []
            for value, time, *_ in row:
                ahead = (int(time) - now + WRAP // 2) % WRAP - WRAP // 2
                self.points.append(ahead)
                points.append((now + ahead, float(value)))
            known = self._timelines.get(key)
            if known is None:
                value = joint.command if what == POSITION else joint.stiffness
                known = self._timelines[key] = Timeline((self.started, value))
            known.add(update, points)


def _set(joint: Joint, what: str, value: float) -> None:
    if what == POSITION:
        joint.order(value, 1.0)
    else:
        joint.stiffness = min(max(value, 0.0), 1.0)
