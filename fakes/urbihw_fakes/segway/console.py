"""The commands of an RMP at the console of `python -m urbihw_fakes segway`."""

from __future__ import annotations

import math
from collections.abc import Mapping

from urbihw_fakes.bodies.balance import BalancingBody
from urbihw_fakes.bodies.words import world_words
from urbihw_fakes.console import Command
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.segway.rmp import SegwayRmp


def commands(base: SegwayRmp) -> Mapping[str, Command]:
    """Return the commands of one base."""
    actions = _Actions(base)
    words = {
        "push": Command("DEGREES", "tilt the body", actions.push),
        "battery": Command("VOLTS", "set the voltage of the battery", actions.battery),
        "estop": Command("on|off", "press or release the emergency stop", actions.estop),
        "blink": Command("[FRAMES]", "switch the motors off for a number of servo frames (1)", actions.blink),
        "lose": Command("ID|any [EVERY]", "drop a frame in each, or each EVERY-th, cycle; 0 drops none", actions.lose),
        "slip": Command("SHARE", "set the share 0..1 of the wheels' rotation that is lost to slip", actions.slip),
        "where": Command("", "show the true position since power-on: m, m, degrees", actions.where),
        "lift": Command("", "put a fallen base upright", actions.lift),
        "show": Command("", "show mode, speeds, distance and battery", actions.show),
    }
    if isinstance(base.body, BalancingBody):
        # What the world decides is not set by hand.
        kept = {word: command for word, command in words.items() if word != "slip"}
        # The machine moves on by itself, a frame each 10 ms.
        return kept | world_words(base.body, lambda: None)
    return words


class _Actions:
    """The actions of the commands: each gets the words behind the command and returns the answer."""

    def __init__(self, base: SegwayRmp) -> None:
        self._base = base

    def push(self, words: list[str]) -> str:
        self._base.body.push(math.radians(float(words[0])))
        return "ok"

    def battery(self, words: list[str]) -> str:
        self._base.body.volts = float(words[0])
        return "ok"

    def estop(self, words: list[str]) -> str:
        if words[0] not in ("on", "off"):
            raise UnknownRequest(f"estop {words[0]}: say on or off")
        self._base.estop = words[0] == "on"
        return "ok"

    def lift(self, words: list[str]) -> str:
        self._base.body.lift()
        return "ok"

    def blink(self, words: list[str]) -> str:
        self._base.blink = int(words[0]) if words else 1
        return "ok"

    def lose(self, words: list[str]) -> str:
        identifier = None if words[0] == "any" else int(words[0], 16)
        self._base.drop_frames(identifier, int(words[1]) if len(words) > 1 else 1)
        return "ok"

    def slip(self, words: list[str]) -> str:
        self._base.body.slip = float(words[0])
        return "ok"

    def where(self, words: list[str]) -> str:
        body = self._base.body
        return f"{body.x:.3f} {body.y:.3f} {math.degrees(body.heading):.1f}"

    def show(self, words: list[str]) -> str:
        base, body = self._base, self._base.body
        motors = "motors on" if base.motors else "motors off"
        place = f"{body.forward:.3f} m, {math.degrees(body.yaw):.1f} deg"
        return f"mode {base.mode}, {motors}, {body.speed:.3f} m/s, {body.turn:.3f} rad/s, {place}, {body.volts:.1f} V"
