"""The commands of a chain of Feetech servos at the console of `python -m urbihw_fakes feetech` and `so101`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import degrees, radians, tau

from urbihw_fakes.console import Command
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo

_SHOWN = ("present_position", "goal_position", "torque", "offset")


def commands(bus: FeetechBus, clock: Callable[[], float], names: Mapping[str, int]) -> dict[str, Command]:
    """Return the commands of one chain; `clock` gives its simulated time in seconds, `names` the joints by name."""
    actions = _Actions(bus, clock, names)
    return {
        "turn": Command("JOINT DEGREES", "turn the horn by hand (without torque), from where it is", actions.turn),
        "load": Command("JOINT TORQUE", "push a servo, -1..1 of stall torque, positive upwards", actions.load),
        "hold": Command("JOINT", "hold a servo by hand: its horn does not turn", actions.hold),
        "let": Command("JOINT", "let a servo go that is held by hand", actions.let_go),
        "temperature": Command("JOINT CELSIUS|free", "fix the temperature, or release it", actions.temperature),
        "voltage": Command("VOLTS [JOINT]", "set the supply voltage of all servos or one", actions.voltage),
        "state": Command("[JOINT]", "show the positions of all, or all registers of one", actions.state),
    }


class _Actions:
    """The actions of the commands: each gets the words behind the command and returns the answer."""

    def __init__(self, bus: FeetechBus, clock: Callable[[], float], names: Mapping[str, int]) -> None:
        self._bus = bus
        self._clock = clock
        self._names = names

    def turn(self, words: list[str]) -> str:
        servo = self._servo(words[0])
        servo.tick(self._clock())
        servo.motor.turn(radians(float(words[1])) / tau * 4096 if servo.steps == 4096 else float(words[1]) / 300 * 1024)
        return "ok"

    def load(self, words: list[str]) -> str:
        servo = self._servo(words[0])
        servo.tick(self._clock())
        servo.motor.load = float(words[1])
        return "ok"

    def hold(self, words: list[str]) -> str:
        self._servo(words[0]).motor.held = True
        return "ok"

    def let_go(self, words: list[str]) -> str:
        self._servo(words[0]).motor.held = False
        return "ok"

    def temperature(self, words: list[str]) -> str:
        self._servo(words[0]).heat(None if words[1] == "free" else float(words[1]))
        return "ok"

    def voltage(self, words: list[str]) -> str:
        for servo in [self._servo(words[1])] if len(words) > 1 else self._servos():
            servo.volts = float(words[0])
        return "ok"

    def state(self, words: list[str]) -> str:
        self._bus.tick(self._clock())
        if words:
            servo = self._servo(words[0])
            servo.sense()
            return " ".join(f"{row.name}={servo.registers.get(row.name)}" for row in servo.registers.rows)
        return "\n".join(self._line(servo) for servo in self._servos())

    def _line(self, servo: FeetechServo) -> str:
        servo.sense()
        power = "" if servo.powered else " (no power)"
        names = [name for name in _SHOWN if name in servo.registers.by_name]
        values = " ".join(f"{name}={servo.registers.get(name)}" for name in names)
        joint = {number: name for name, number in self._names.items()}.get(servo.id, servo.model)
        return f"{servo.id} {joint}{power} {values} angle={degrees(servo.motor.angle / servo.steps * tau):.1f}deg"

    def _servos(self) -> list[FeetechServo]:
        return [unit for unit in self._bus if isinstance(unit, FeetechServo)]

    def _servo(self, word: str) -> FeetechServo:
        return self._bus.servo(self._names[word] if word in self._names else int(word))
