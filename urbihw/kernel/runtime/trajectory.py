"""Trajectories: ``slot = target time: 1s`` and the like move a value over time, in the job of the statement.

A value is written at each multiple of the generator's period P.  A movement of length T ends at the first step with T -
t < P, which writes the target itself.  Open-loop kinds (time, speed, smooth, accel, sin, cos) write f(t) whatever the
present value is.  Closed-loop kinds (time and speed with ``adaptive: true``) continue from the present value, and
``adaptive: true`` alone waits until a device has reached the target.  A speed that is not
above 0 and a period of 0 are errors; a duration of 0 or below writes the target at once.  Time is the job's own: while
it is frozen, it stands still.  The properties of the slot limit range and speed (see ``SlotLimits``),
and define how movements of the same variable are blended (module ``blend``).  Source: manual, TrajectoryGenerator and
"Trajectories".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.blend import Blender, Movement
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Curve = Callable[[float], float]
KINDS = ("time", "speed", "accel", "smooth", "sin", "cos")
ATTRIBUTES = (*KINDS, "adaptive", "ampli", "phase")
LAG_S = 0.5
"""How far a device may lag behind the written value before the movement waits for it, in seconds of the movement; more
than the delays of bus, controller and inertia together."""
MIN_LEAD = 0.25
"""Minimum distance that the written value may be ahead of the device, as a share of the whole distance: motors do not
react to the small errors of a slow movement."""
_CLOSE = 1e-9
_PACE_SHARE = 1.05
"""How much faster than its curve a movement may be while it makes up for values that arrived late; a body then stays
within a tenth of the speed that was asked for."""
_BEGIN_S = 1.0
"""Seconds in which a sine wave may be led from where its variable is to where it begins."""


class SlotLimits:
    """The limits from the properties of a slot: ``rangemin``, ``rangemax``, ``speedmin``, ``speedmax`` (per second),
    and ``delta``, the tolerance at which a closed loop ends.
    """

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
        """The nearest allowed speed."""
        return min(max(wanted, self.speedmin), self.speedmax)

    def length(self, wanted: float, way: float) -> float:
        """The allowed duration nearest to ``wanted`` (seconds) for a distance; ``way`` is positive."""
        if way and self.speedmin:
            wanted = min(wanted, way / self.speedmin)
        if way and self.speedmax < math.inf:
            wanted = max(wanted, way / self.speedmax) if self.speedmax else math.inf
        return wanted


class Trajectory:
    """One movement of one variable."""

    def __init__(
        self,
        world: World,
        read: Callable[[], Any],
        write: Callable[[Any], Any],
        target: Value,
        attributes: dict[str, Any],
        properties: Mapping[str, Any] | None = None,
        blender: Blender | None = None,
        variable: object = None,
    ) -> None:
        """``variable``: what is behind the slot, if the values go into it as they are."""
        self._world = world
        self._read = read
        self._write = write
        self._blender = blender
        self._variable = variable
        self._limits = SlotLimits(properties or {})
        self._target = self._finite(self._limits.inside(self._number(target, "")))
        self._attributes = attributes
        unknown = [name for name in attributes if name not in ATTRIBUTES]
        kinds = [name for name in attributes if name in KINDS]
        self._adaptive = "adaptive" in attributes and bool(attributes["adaptive"])
        if unknown or not (kinds or self._adaptive):
            raise errors.primitive(f"unknown trajectory attribute: {', '.join(unknown or attributes)}", None)
        self._kind = kinds[0] if kinds else ""
        self._parameter = self._number(attributes[self._kind], self._kind) if kinds else 0.0
        self._check_parameter()
        self._movement: Movement | None = None
        self._written: float | None = None
        """The value that a closed loop wrote and the variable does not have yet."""
        self._pace = 0.0
        """The speed of a closed loop, in units per second."""
        self._later_pace = math.nan
        """The highest speed of a wave that has been led to its beginning, where that is lower; nan if not."""

    def run(self) -> None:
        """Run the movement; returns when it is over (never for sin and cos)."""
        if self._blender is None:
            self._move()
            return
        with self._blender.movement() as movement:
            if movement is not None:
                self._write = movement.write
                self._movement = movement
                self._move()

    def _move(self) -> None:
        job = self._world.scheduler.running()
        before = job.movement
        try:
            self._write_all()
        finally:
            job.movement = before

    def _set_pace(self, speed: float) -> None:
        """Declare the highest speed of the movement.

        A device keeps it, however late the values arrive: a neighbour may hold the interpreter for a second, and the
        next value is then far ahead.
        """
        speed = max(speed * _PACE_SHARE, _CLOSE)
        if self._movement is not None:
            self._movement.pace = speed
        self._world.scheduler.running().movement = self._variable, speed

    def _write_all(self) -> None:
        if self._adaptive and self._kind == "time":
            self._closed_time(self._parameter)
        elif self._adaptive and self._kind == "speed":
            self._closed_speed(self._parameter)
        elif not self._kind:
            self._closed()
        else:
            curve, length, speed = self._curve()
            self._set_pace(min(speed, self._limits.speedmax))
            self._follow(curve, length)

    # ---------------------------------------------------------------- open loop

    def _curve(self) -> tuple[Curve, float, float]:
        """The value over time, its duration in seconds, and its highest speed per second."""
        parameter, target = self._parameter, self._target
        if self._kind in ("sin", "cos"):
            amplitude = self._finite(self._number(self._attributes.get("ampli", 0.0), "ampli"))
            phase = self._finite(self._number(self._attributes.get("phase", 0.0), "phase"))
            wave = math.sin if self._kind == "sin" else math.cos
            speed = abs(2 * math.pi * amplitude / parameter)
            way = abs(target + amplitude * wave(phase) - self._world.as_float(self._read(), 1, "-"))
            if way / _BEGIN_S > speed and way < math.inf:  # not for nan
                self._later_pace, speed = speed, way / _BEGIN_S
            return lambda t: target + amplitude * wave(2 * math.pi * t / parameter + phase), math.inf, speed
        start = self._finite(self._present())
        way = target - start
        if self._kind == "accel":
            if way * parameter < 0 or (parameter == 0 and way != 0):
                raise errors.primitive("argument has to be positive", "sqrt")
            length = math.sqrt(2 * way / parameter) if way else 0.0
            return lambda t: start + parameter * t * t / 2, length, abs(parameter) * length
        if self._kind == "speed":
            parameter = abs(way) / parameter
        if self._kind == "smooth":
            length = self._limits.length(parameter, abs(way) * math.pi / 2)
            speed = abs(way) * math.pi / 2 / length if length > 0 else math.inf
            return lambda t: start + way * (1 - math.cos(math.pi * t / length)) / 2, length, speed
        length = self._limits.length(parameter, abs(way))
        return lambda t: start + way * t / length, length, abs(way) / length if length > 0 else math.inf

    def _follow(self, curve: Curve, length: float) -> None:
        limits = self._limits
        if not limits.any:
            for t in self._steps():
                if length - t < self._period - _CLOSE:
                    self._write(self._target)
                    return
                self._begin_wave(t)
                self._write(curve(t))
        last = self._world.as_float(self._read(), 1, "-")
        if math.isnan(last):
            # The position of a lost device is unknown: the limit of the speed can only act from the first value on.
            last = limits.inside(curve(0.0))
        for t in self._steps():
            self._begin_wave(t)
            reach = limits.speedmax * self._period
            over = length - t < self._period - _CLOSE
            wanted = limits.inside(self._target if over else curve(t))
            # The limit counts from what was written, not from what is measured: a device lags behind its target.
            last = min(max(wanted, last - reach), last + reach)
            self._write(last)
            if over and abs(wanted - last) < _CLOSE:
                return

    def _begin_wave(self, t: float) -> None:
        """A wave has its own highest speed from then on when it has been led to its beginning."""
        if t > 2 * _BEGIN_S and not math.isnan(self._later_pace):
            self._set_pace(min(self._later_pace, self._limits.speedmax))
            self._later_pace = math.nan

    # ---------------------------------------------------------------- closed loop

    def _closed_time(self, length: float) -> None:
        for t, value in self._found():
            way = self._target - value
            left = self._limits.length(length - t, abs(way))
            if left <= self._period + _CLOSE:
                self._write(self._target)
                if left > _CLOSE:
                    self._world.scheduler.sleep(left)
                return
            if not t:
                self._set_pace(abs(way) / left)
            self._pace = abs(way) / left
            self._write_found(value + way * self._period / left)

    def _closed_speed(self, speed: float) -> None:
        speed = self._limits.speed(speed)
        self._pace = speed
        self._set_pace(speed)
        for _, value in self._found():
            reach = speed * self._period
            way = self._target - value
            if abs(way) <= reach + _CLOSE:
                self._write(self._target)
                return
            self._write_found(value + math.copysign(reach, way))

    def _closed(self) -> None:
        """Write the target; returns when the value has reached it, or comes no nearer."""
        self._write(self._target)
        nearest, since = math.inf, 0.0
        for t in self._steps():
            way = abs(self._target - self._present())
            if way <= max(self._limits.delta, _CLOSE):
                return
            if way < nearest - _CLOSE:
                nearest, since = way, t
            elif t - since >= LAG_S:
                return

    def _found(self) -> Iterator[tuple[float, float]]:
        """The times of the steps, and the value from which each continues; a speed ends when the value is near enough.

        If the variable keeps the written value, the step continues from its present value.  A device lags behind, so
        the step continues from the written value, which is never behind the device and no further ahead than LAG_S and
        MIN_LEAD allow. So the movement keeps its speed, and waits for a blocked device.  While a device does not move,
        the lead grows at half the speed, so that a device that does not react to small errors cannot keep the movement
        from ending.
        """
        nearest = least = slack = 0.0
        for t in self._steps():
            value = self._present()
            way = abs(self._target - value)
            if self._kind == "speed" and way <= self._limits.delta:
                return
            if not t:
                nearest, least = way, way * MIN_LEAD
            slack = slack + self._pace * self._period / 2 if way >= nearest - _CLOSE else 0.0
            nearest = min(nearest, way)
            written = self._written
            if written is None or (written - value) * (self._target - value) <= 0:
                yield t, value
            else:
                lead = max(self._pace * LAG_S, least) + slack
                yield t, value + math.copysign(min(abs(written - value), lead), written - value)

    def _write_found(self, value: float) -> None:
        """Write the value of a step, and check whether the variable keeps it."""
        self._write(value)
        self._written = None if self._read() == value else value

    def _check_parameter(self) -> None:
        """Raise the error for a parameter with which the movement would never end or has no meaning."""
        kind, parameter = self._kind, self._parameter
        if kind == "speed" and parameter <= 0:
            raise errors.primitive(f"speed must be above 0, got {parameter:g}", None)
        if kind in ("sin", "cos") and parameter == 0:
            raise errors.primitive(f"{kind} must not be 0: it is the period in seconds", None)

    # ---------------------------------------------------------------- time

    @property
    def _period(self) -> float:
        """Seconds between two steps now: those of a bus change with its rate."""
        return self._world.period

    def _steps(self) -> Any:
        scheduler = self._world.scheduler
        job = scheduler.running()
        begin = job.local_time(scheduler.clock.now())
        since, step, period = 0.0, 0, self._period
        while True:
            yield since + step * period
            if period != self._period:
                since, step, period = since + step * period, 0, self._period
            step += 1
            now = job.local_time(scheduler.clock.now())
            # Steps have absolute times, so that delays do not add up; late steps are left out, not made up for.
            missed = int((now - begin - since) / period + _CLOSE)
            step = max(step, missed)
            scheduler.sleep(begin + since + step * period - now)

    def _number(self, value: Value, routine: str) -> float:
        number = self._world.as_float(value, 1, routine or None)
        if number != number:  # neither a target nor a duration
            raise errors.bad_number("BadNumber", "expected a number, got nan", number)
        return number

    def _present(self) -> float:
        """The value now, where the movement begins.  Raises BadNumber while it is unknown."""
        number = self._world.as_float(self._read(), 1, "-")
        if number != number:
            raise errors.bad_number("BadNumber", "the present value is unknown (nan), so no movement can begin")
        return number

    def _finite(self, value: float) -> float:
        if math.isinf(value):
            raise errors.bad_number("BadNumber", f"expected a finite number, got {value:g}", value)
        return value
