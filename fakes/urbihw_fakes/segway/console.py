"""What can be typed at a running RMP, beside the words of all fakes."""

from __future__ import annotations

import math
from collections.abc import Mapping

from urbihw_fakes.console import Command
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.segway.rmp import SegwayRmp


def commands(base: SegwayRmp) -> Mapping[str, Command]:
    """The robot's own words."""

    def push(words: list[str]) -> str:
        base.body.push(math.radians(float(words[0])))
        return "ok"

    def battery(words: list[str]) -> str:
        base.body.volts = float(words[0])
        return "ok"

    def estop(words: list[str]) -> str:
        if words[0] not in ("on", "off"):
            raise UnknownRequest(f"estop {words[0]}: say on or off")
        base.estop = words[0] == "on"
        return "ok"

    def lift(words: list[str]) -> str:
        base.body.lift()
        return "ok"

    def blink(words: list[str]) -> str:
        base.blink = int(words[0]) if words else 1
        return "ok"

    def lose(words: list[str]) -> str:
        base.lose(None if words[0] == "any" else int(words[0], 16), int(words[1]) if len(words) > 1 else 1)
        return "ok"

    def show(words: list[str]) -> str:
        body = base.body
        motors = "motors on" if base.motors else "motors off"
        place = f"{body.forward:.3f} m, {math.degrees(body.yaw):.1f} deg"
        return f"mode {base.mode}, {motors}, {body.speed:.3f} m/s, {body.turn:.3f} rad/s, {place}, {body.volts:.1f} V"

    return {
        "push": Command("DEGREES", "lean on the body", push),
        "battery": Command("VOLTS", "charge or empty the battery", battery),
        "estop": Command("on|off", "press or release the emergency stop", estop),
        "blink": Command("[FRAMES]", "motors off for that many servo frames (1)", blink),
        "lose": Command("ID|any [EVERY]", "leave out a frame, in each (or every so many-th) cycle; 0 sends all", lose),
        "lift": Command("", "put a fallen base upright", lift),
        "show": Command("", "mode, speeds, way and battery", show),
    }
