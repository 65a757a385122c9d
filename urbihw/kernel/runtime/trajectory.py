"""Trajectories: ``slot = target time: 1s`` and its kin move a value over time, in the job that says so.

The value is a staircase written at multiples of the generator's period P; a movement of length T is over at the first
step with T - t < P, where the target itself is written.  Open-loop kinds (time, speed, smooth, accel, sin, cos) write
f(t) whatever the place holds; closed-loop ones (time and speed with ``adaptive: true``) go on from what they find.
Time is the job's own: while it is frozen, it stands still.  The properties of the slot limit range and speed (see
``Limits``), and say how movements of the same place are blended (see ``blend``).  Source: manual, TrajectoryGenerator
and "Trajectories".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.blend import Blender

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Curve = Callable[[float], float]
KINDS = ("time", "speed", "accel", "smooth", "sin", "cos")
ATTRIBUTES = (*KINDS, "adaptive", "ampli", "phase")
_CLOSE = 1e-9


class Limits:
    """What the properties of a slot allow: ``rangemin``, ``rangemax``, ``speedmin``, ``speedmax`` (per second), and
    ``delta``, how near is near enough for a closed loop."""

    def __init__(self, properties: Mapping[str, Any]) -> None:
        def limit(name: str, default: float) -> float:
            value = properties.get(name)
            return value if value.__class__ is float else default

        self.rangemin = limit("rangemin", -math.inf)
        self.rangemax = limit("rangemax", math.inf)
        self.speedmin = max(0.0, limit("speedmin", 0.0))
        self.speedmax = max(0.0, limit("speedmax", math.inf))
        self.delta = limit("delta", -1.0)
        self.any = (self.rangemin, self.rangemax, self.speedmax) != (-math.inf, math.inf, math.inf)

    def inside(self, value: float) -> float:
        """The nearest value within the range."""
        return max(self.rangemin, min(self.rangemax, value))

    def speed(self, wanted: float) -> float:
        """The nearest speed allowed."""
        return min(max(wanted, self.speedmin), self.speedmax)

    def length(self, wanted: float, way: float) -> float:
        """The time nearest to the one wanted in which a way can be gone; ``way`` is a positive length."""
        if way and self.speedmin:
            wanted = min(wanted, way / self.speedmin)
        if way and self.speedmax < math.inf:
            wanted = max(wanted, way / self.speedmax) if self.speedmax else math.inf
        return wanted


class Trajectory:
    """One movement of one place."""

    def __init__(
        self,
        world: World,
        read: Callable[[], Any],
        write: Callable[[Any], Any],
        target: Any,
        attributes: dict[str, Any],
        properties: Mapping[str, Any] | None = None,
        blender: Blender | None = None,
    ) -> None:
        self._world = world
        self._read = read
        self._write = write
        self._blender = blender
        self._limits = Limits(properties or {})
        self._target = self._finite(self._limits.inside(self._number(target, "")))
        self._attributes = attributes
        unknown = [name for name in attributes if name not in ATTRIBUTES]
        kinds = [name for name in attributes if name in KINDS]
        if unknown or not kinds:
            raise errors.primitive(f"unknown trajectory attribute: {', '.join(unknown or attributes)}", None)
        self._kind = kinds[0]
        self._parameter = self._number(attributes[self._kind], self._kind)
        self._period = world.period

    def run(self) -> None:
        """Move; returns when the movement is over (never, for sin and cos)."""
        if self._blender is None:
            self._move()
            return
        with self._blender.movement() as movement:
            if movement is not None:
                self._write = movement.write
                self._move()

    def _move(self) -> None:
        adaptive = "adaptive" in self._attributes and bool(self._attributes["adaptive"])
        if adaptive and self._kind == "time":
            self._closed_time(self._parameter)
        elif adaptive and self._kind == "speed":
            self._closed_speed(self._parameter)
        else:
            curve, length = self._curve()
            self._follow(curve, length)

    # ---------------------------------------------------------------- open loop

    def _curve(self) -> tuple[Curve, float]:
        parameter, target = self._parameter, self._target
        if self._kind in ("sin", "cos"):
            amplitude = self._finite(self._number(self._attributes.get("ampli", 0.0), "ampli"))
            phase = self._finite(self._number(self._attributes.get("phase", 0.0), "phase"))
            wave = math.sin if self._kind == "sin" else math.cos
            return lambda t: target + amplitude * wave(2 * math.pi * t / parameter + phase), math.inf
        start = self._finite(self._number(self._read(), "-"))
        way = target - start
        if self._kind == "accel":
            if way * parameter < 0 or (parameter == 0 and way != 0):
                raise errors.primitive("argument has to be positive", "sqrt")
            length = math.sqrt(2 * way / parameter) if way else 0.0
            return lambda t: start + parameter * t * t / 2, length
        if self._kind == "speed":
            if parameter <= 0:
                raise errors.primitive(f"speed must be positive, got {parameter:g}", None)
            parameter = abs(way) / parameter
        if self._kind == "smooth":
            length = self._limits.length(parameter, abs(way) * math.pi / 2)
            return lambda t: start + way * (1 - math.cos(math.pi * t / length)) / 2, length
        length = self._limits.length(parameter, abs(way))
        return lambda t: start + way * t / length, length

    def _follow(self, curve: Curve, length: float) -> None:
        limits = self._limits
        if not limits.any:
            for t in self._steps():
                if length - t < self._period - _CLOSE:
                    self._write(self._target)
                    return
                self._write(curve(t))
        last = self._number(self._read(), "-")
        reach = limits.speedmax * self._period
        for t in self._steps():
            over = length - t < self._period - _CLOSE
            wanted = limits.inside(self._target if over else curve(t))
            last = min(max(wanted, last - reach), last + reach)
            self._write(last)
            if over and abs(wanted - last) < _CLOSE:
                return

    # ---------------------------------------------------------------- closed loop

    def _closed_time(self, length: float) -> None:
        for t in self._steps():
            value = self._number(self._read(), "-")
            way = self._target - value
            left = self._limits.length(length - t, abs(way))
            if left <= self._period + _CLOSE:
                self._write(self._target)
                if left > _CLOSE:
                    self._world.scheduler.sleep(left)
                return
            self._write(value + way * self._period / left)

    def _closed_speed(self, speed: float) -> None:
        if speed <= 0:
            raise errors.primitive(f"speed must be positive, got {speed:g}", None)
        reach = self._limits.speed(speed) * self._period
        for _ in self._steps():
            value = self._number(self._read(), "-")
            way = self._target - value
            if abs(way) <= self._limits.delta:
                return
            if abs(way) <= reach + _CLOSE:
                self._write(self._target)
                return
            self._write(value + math.copysign(reach, way))

    # ---------------------------------------------------------------- time

    def _steps(self) -> Any:
        scheduler = self._world.scheduler
        job = scheduler.running()
        begin = job.local_time(scheduler.clock.now())
        step = 0
        while True:
            yield step * self._period
            step += 1
            now = job.local_time(scheduler.clock.now())
            missed = int((now - begin) / self._period + _CLOSE)
            step = max(step, missed)
            scheduler.sleep(begin + step * self._period - now)

    def _number(self, value: Any, routine: str) -> float:
        if value.__class__ is not float:
            raise self._world.type_error(1, value, "Float", routine or None)
        if value != value:  # neither a place to go to nor a time to be there
            raise errors.bad_number("BadNumber", "expected a number, got nan")
        return float(value)

    def _finite(self, value: float) -> float:
        if math.isinf(value):
            raise errors.bad_number("BadNumber", f"expected a finite number, got {value:g}")
        return value
