"""The commands of a Bioloid at the console of `python -m urbihw_fakes bioloid`."""

from __future__ import annotations

from collections.abc import Callable

from urbihw_fakes.bioloid.kit import Bioloid
from urbihw_fakes.bodies.humanoid import Humanoid, describe
from urbihw_fakes.bodies.scene import scene_word
from urbihw_fakes.console import Command
from urbihw_fakes.dynamixel.ax12 import DEGREES, Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.servo import Shaft
from urbihw_fakes.dynamixel.unit import Unit
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.dynamixel.xtables import STEPS
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.feetech.servo import FeetechServo

SENSOR = 100
SHOWN = ("present_position", "ir_left", "ir_center", "ir_right")  # in the brief state


def commands(kit: Bioloid, clock: Callable[[], float]) -> dict[str, Command]:
    """Return the commands of one kit; `clock` gives its simulated time in seconds."""
    actions = _Actions(kit, clock)
    return {
        "clap": Command("[COUNT] [ID]", "clap near the sensor", actions.clap),
        "ir": Command("LEFT CENTER RIGHT [ID]", "set the distances, 0..255, larger is nearer", actions.infrared),
        "light": Command("LEFT CENTER RIGHT [ID]", "set the light, 0..255", actions.light),
        "sound": Command("LEVEL [ID]", "set the level of the microphone, 0..255, silence is 128", actions.sound),
        "remocon": Command("WORD [ID]", "receive a remote-control word", actions.remocon),
        "load": Command("ID TORQUE", "push a servo, -1..1 of stall torque, positive counter-clockwise", actions.load),
        "hold": Command("ID", "hold a servo by hand: its horn does not turn", actions.hold),
        "let": Command("ID", "let a servo go that is held by hand", actions.let_go),
        "temperature": Command("ID CELSIUS|free", "fix the temperature, or release it", actions.temperature),
        "voltage": Command("VOLTS [ID]", "set the supply voltage of all units or one", actions.voltage),
        "connect": Command("NUMBER...|all", "plug in only these units, counted from 1", actions.connect),
        "turn": Command("ID DEGREES", "turn the horn by hand (without torque), from where it is", actions.turn),
        "state": Command("[ID]", "show the positions of all, or all registers of one", actions.state),
    }


def in_world(kit: Humanoid, words: dict[str, Command]) -> dict[str, Command]:
    """The commands of a kit that is a humanoid in a world: what the world decides is not set by hand."""
    kept = {word: command for word, command in words.items() if word not in ("ir", "turn")}

    def stand(_: list[str]) -> str:
        kit.stand()
        return "ok"

    def push(words: list[str]) -> str:
        forward, left = (float(word) for word in (*words, "0")[:2])
        kit.push(forward, left)
        return "ok"

    # The requests of the bus move it on.
    return {
        **kept,
        **scene_word(kit.simulation, lambda: None),
        "stand": Command("", "put it on its feet where it started; limp joints as at the start", stand),
        "push": Command("FORWARD [LEFT]", "push its chest for 0.1 s, N", push),
        "where": Command("", "where it is, and whether it stands", lambda _: describe(kit)),
        "time": Command("", "how long its world has been simulated, s", lambda _: f"{kit.simulation.time:.3f}"),
    }


class _Actions:
    """The actions of the commands: each gets the words behind the command and returns the answer."""

    def __init__(self, kit: Bioloid, clock: Callable[[], float]) -> None:
        self._kit = kit
        self._clock = clock
        self._box = list(kit)  # all units, plugged in or not

    def clap(self, words: list[str]) -> str:
        self._kit.sensor(_number(words, 1, SENSOR)).clap(self._clock(), int(words[0]) if words else 1)
        return "ok"

    def infrared(self, words: list[str]) -> str:
        left, center, right = _bytes(words[:3])
        self._kit.sensor(_number(words, 3, SENSOR)).ir(left, center, right)
        return "ok"

    def light(self, words: list[str]) -> str:
        left, center, right = _bytes(words[:3])
        self._kit.sensor(_number(words, 3, SENSOR)).light(left, center, right)
        return "ok"

    def sound(self, words: list[str]) -> str:
        (level,) = _bytes(words[:1])
        self._kit.sensor(_number(words, 1, SENSOR)).sound(level)
        return "ok"

    def remocon(self, words: list[str]) -> str:
        self._kit.sensor(_number(words, 1, SENSOR)).remocon(int(words[0], 0))
        return "ok"

    def load(self, words: list[str]) -> str:
        unit, torque = self._kit[int(words[0])], float(words[1])
        if isinstance(unit, Ax12):
            unit.load = torque
        elif isinstance(unit, XSeries):
            unit.motor.load = torque
        else:
            raise UnknownRequest(f"load {words[0]}: not a servo")
        return "ok"

    def hold(self, words: list[str]) -> str:
        return self._set_held(words[0], True)

    def let_go(self, words: list[str]) -> str:
        return self._set_held(words[0], False)

    def _set_held(self, word: str, held: bool) -> str:
        unit = self._kit[int(word)]
        unit.tick(self._clock())
        if isinstance(unit, XSeries | FeetechServo):
            unit.motor.held = held
        elif isinstance(unit, Ax12 | Shaft):
            unit.held = held
        else:
            raise UnknownRequest(f"hold {word}: not a servo")
        return "ok"

    def temperature(self, words: list[str]) -> str:
        unit = self._kit[int(words[0])]
        celsius = None if words[1] == "free" else float(words[1])
        if isinstance(unit, Ax12 | XSeries):
            unit.heat(celsius)
        elif isinstance(unit, AxS1) and celsius is not None:
            unit.celsius = celsius
        return "ok"

    def voltage(self, words: list[str]) -> str:
        who = int(words[1]) if len(words) > 1 else None
        for unit in self._kit if who is None else [self._kit[who]]:
            if isinstance(unit, Ax12 | AxS1 | XSeries):
                unit.volts = float(words[0])
        return "ok"

    def connect(self, words: list[str]) -> str:
        numbers = range(1, len(self._box) + 1) if words == ["all"] else [int(word) for word in words]
        if not numbers or not all(1 <= number <= len(self._box) for number in numbers):
            raise ValueError(words)
        now, plugged = self._clock(), list(self._kit)
        for number, unit in enumerate(self._box, 1):
            if unit in plugged and number not in numbers:
                unit.power_off(now)
                self._kit.remove(unit)
            elif unit not in plugged and number in numbers:
                self._kit.add(unit)
                unit.power_on(now)
        return "ok"

    def turn(self, words: list[str]) -> str:
        unit, degrees = self._kit[int(words[0])], float(words[1])
        unit.tick(self._clock())
        if unit.powered and "torque_enable" in unit.registers.by_name and unit.registers.get("torque_enable"):
            raise UnknownRequest(f"turn {words[0]}: its torque is on, it holds")
        if isinstance(unit, Ax12):
            unit.position = max(0.0, min(1023.0, unit.position + degrees / DEGREES))
        elif isinstance(unit, XSeries):
            unit.motor.position += degrees / 360 * STEPS
        elif isinstance(unit, Shaft):
            unit.position += degrees / 360 * unit.family.counts
        else:
            raise UnknownRequest(f"turn {words[0]}: not a servo")
        return "ok"

    def state(self, words: list[str]) -> str:
        units = [self._kit[int(words[0])]] if words else list(self._kit)
        self._kit.tick(self._clock())
        return "\n".join(_state(unit, brief=not words) for unit in units)


def _number(words: list[str], place: int, default: int) -> int:
    return int(words[place]) if len(words) > place else default


def _bytes(words: list[str]) -> list[int]:
    values = [int(word) for word in words]
    if any(not 0 <= value <= 255 for value in values):
        raise ValueError(words)
    return values


def _state(unit: Unit, *, brief: bool) -> str:
    unit.sense()
    get = unit.registers.get
    if not brief:
        rows = (row.name for row in unit.registers.rows if not row.name.startswith("indirect_"))
        return " ".join(f"{name}={get(name)}" for name in rows)
    power = "" if unit.powered else " (no power)"
    names = [name for name in SHOWN if name in unit.registers.by_name]
    return f"{unit.id} {type(unit).__name__}{power} " + " ".join(f"{name}={get(name)}" for name in names)
