"""The words for a Bioloid at the console of `python -m urbihw_fakes bioloid`."""

from __future__ import annotations

from collections.abc import Callable

from urbihw_fakes.bioloid.kit import Bioloid
from urbihw_fakes.console import Command
from urbihw_fakes.dynamixel.ax12 import Ax12
from urbihw_fakes.dynamixel.axs1 import AxS1
from urbihw_fakes.dynamixel.unit import Unit
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.errors import UnknownRequest

SENSOR = 100
SHOWN = ("present_position", "ir_left", "ir_center", "ir_right")  # in the brief state


def commands(kit: Bioloid, clock: Callable[[], float]) -> dict[str, Command]:
    """The table for one kit; `clock` gives the time that it lives in."""

    def clap(words: list[str]) -> str:
        kit.sensor(_number(words, 1, SENSOR)).clap(clock(), int(words[0]) if words else 1)
        return "ok"

    def infrared(words: list[str]) -> str:
        left, center, right = _bytes(words[:3])
        kit.sensor(_number(words, 3, SENSOR)).ir(left, center, right)
        return "ok"

    def light(words: list[str]) -> str:
        left, center, right = _bytes(words[:3])
        kit.sensor(_number(words, 3, SENSOR)).light(left, center, right)
        return "ok"

    def sound(words: list[str]) -> str:
        (level,) = _bytes(words[:1])
        kit.sensor(_number(words, 1, SENSOR)).sound(level)
        return "ok"

    def remocon(words: list[str]) -> str:
        kit.sensor(_number(words, 1, SENSOR)).remocon(int(words[0], 0))
        return "ok"

    def load(words: list[str]) -> str:
        unit, torque = kit[int(words[0])], float(words[1])
        if isinstance(unit, Ax12):
            unit.load = torque
        elif isinstance(unit, XSeries):
            unit.motor.load = torque
        else:
            raise UnknownRequest(f"load {words[0]}: not a servo")
        return "ok"

    def temperature(words: list[str]) -> str:
        unit = kit[int(words[0])]
        celsius = None if words[1] == "free" else float(words[1])
        if isinstance(unit, Ax12 | XSeries):
            unit.heat(celsius)
        elif isinstance(unit, AxS1) and celsius is not None:
            unit.celsius = celsius
        return "ok"

    def voltage(words: list[str]) -> str:
        who = int(words[1]) if len(words) > 1 else None
        for unit in kit if who is None else [kit[who]]:
            if isinstance(unit, Ax12 | AxS1 | XSeries):
                unit.volts = float(words[0])
        return "ok"

    def state(words: list[str]) -> str:
        units = [kit[int(words[0])]] if words else list(kit)
        kit.tick(clock())
        return "\n".join(_state(unit, brief=not words) for unit in units)

    return {
        "clap": Command("[COUNT] [ID]", "clap near the sensor", clap),
        "ir": Command("LEFT CENTER RIGHT [ID]", "distances, 0..255, larger is nearer", infrared),
        "light": Command("LEFT CENTER RIGHT [ID]", "light, 0..255", light),
        "sound": Command("LEVEL [ID]", "microphone, 0..255, silence is 128", sound),
        "remocon": Command("WORD [ID]", "a remote-control word comes in", remocon),
        "load": Command("ID TORQUE", "push, -1..1 of stall torque, positive counter-clockwise", load),
        "temperature": Command("ID CELSIUS|free", "keep it that hot, or let it be", temperature),
        "voltage": Command("VOLTS [ID]", "supply of all units or one", voltage),
        "state": Command("[ID]", "where all are, or all registers of one", state),
    }


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
