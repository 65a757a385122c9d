"""The words for a Nao at the console of `python -m urbihw_fakes nao`."""

from __future__ import annotations

import math
from collections.abc import Callable

from urbihw_fakes.bodies.scene import scene_word
from urbihw_fakes.console import Command
from urbihw_fakes.errors import UnknownRequest
from urbihw_nao_fakes.audio import Tone
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.legged import LeggedBody, describe
from urbihw_nao_fakes.memory import TOUCHES
from urbihw_nao_fakes.services import Failed


class Words:
    """What each word does with one robot; `clock` gives the time of its world."""

    def __init__(self, robot: Nao, clock: Callable[[], float]) -> None:
        self._robot, self._body, self._clock = robot, robot.body, clock

    def touch(self, words: list[str]) -> str:
        """A sensor of touch."""
        if words[0] not in TOUCHES:
            raise UnknownRequest(f"touch {words[0]}: say one of {', '.join(TOUCHES)}")
        self._robot.memory.touch(words[0], float(words[1]) if len(words) > 1 else 1.0)
        return "ok"

    def set_sonars(self, words: list[str]) -> str:
        """Set the distances that the sonars measure."""
        self._body.sonars[:] = float(words[0]), float(words[1])
        return "ok"

    def raise_event(self, words: list[str]) -> str:
        """An event of ALMemory."""
        self._robot.memory.raise_event(words[0], float(words[1]))
        return "ok"

    def push(self, words: list[str]) -> str:
        """Let the robot fall to a side."""
        self._robot.advance(self._clock())
        self._body.standing = True
        self._body.slack()
        self._robot.advance(self._clock() + 0.01)
        return "ok"

    def set_charge(self, words: list[str]) -> str:
        """Set the charge of the battery, in percent."""
        self._body.charge = min(1.0, max(0.0, float(words[0]) / 100))
        return "ok"

    def tell_place(self, words: list[str]) -> str:
        """Place, heading, and what it does."""
        self._robot.advance(self._clock())
        body = self._body
        return f"{body.x:.3f} {body.y:.3f} {math.degrees(body.heading):.1f} {body.doing}"

    def hear(self, words: list[str]) -> str:
        """Somebody says one of several words."""
        pairs = [(word, float(confidence)) for word, confidence in zip(words[::2], words[1::2], strict=True)]
        return "ok" if self._robot.recognition.hear(pairs) else "not heard"

    def whistle(self, words: list[str]) -> str:
        """A tone for the microphones."""
        self._robot.audio.room.tones.append(Tone(self._clock(), float(words[0]), float(words[1])))
        return "ok"

    def tell_sound(self, words: list[str]) -> str:
        """What the loudspeakers have played."""
        audio = self._robot.audio
        seconds = sum(piece.seconds for piece in audio.played)
        return f"{seconds:.2f} s in {len(audio.played)} pieces, {len(audio.gaps())} gaps"

    def tell_light(self, words: list[str]) -> str:
        """A light, or a group."""
        try:
            return f"{self._robot.leds.colour(words[0]):06x}"
        except Failed as error:
            raise UnknownRequest(f"light {words[0]}: there is no such light or group") from error

    def tell_speech(self, words: list[str]) -> str:
        """All texts that the robot has spoken."""
        return "\n".join(self._robot.speech.said) or "nothing"

    def tell_joints(self, words: list[str]) -> str:
        """The angles and stiffnesses of all joints."""
        self._robot.advance(self._clock())
        joints = self._body.joints.values()
        return "\n".join(f"{joint.name:16} {joint.angle:8.3f} stiffness {joint.stiffness:.2f}" for joint in joints)

    def tell_calls(self, words: list[str]) -> str:
        """Count the calls of one method of any service, or of all methods."""
        calls = [service.calls for service in self._robot.services.values()]
        return str(sum(each[words[0]] if words else each.total() for each in calls))


def commands(robot: Nao, clock: Callable[[], float]) -> dict[str, Command]:
    """The table for one robot; `clock` gives the time of its world."""
    words = Words(robot, clock)
    return {
        "touch": Command("SENSOR [0|1]", "touch it, or no longer", words.touch),
        "sonar": Command("LEFT RIGHT", "what is ahead, in m", words.set_sonars),
        "event": Command("NAME NUMBER", "raise an event of ALMemory", words.raise_event),
        "push": Command("", "let it fall", words.push),
        "battery": Command("PERCENT", "charge or drain it", words.set_charge),
        "where": Command("", "where it is, and what it does", words.tell_place),
        "hear": Command("WORD CONFIDENCE ...", "say this to it; less likely words behind", words.hear),
        "whistle": Command("HERTZ SECONDS", "a tone for its microphones", words.whistle),
        "played": Command("", "what its loudspeakers have played", words.tell_sound),
        "light": Command("NAME", "the colour of a light", words.tell_light),
        "said": Command("", "what it has said", words.tell_speech),
        "calls": Command("[METHOD]", "how often a method was called, or all of them", words.tell_calls),
        "joints": Command("", "angles and stiffnesses", words.tell_joints),
    }


def in_world(robot: Nao, body: LeggedBody, words: dict[str, Command], clock: Callable[[], float]) -> dict[str, Command]:
    """The table for one robot with a body in a world: what the world decides is not set by hand."""

    def advance() -> None:
        robot.advance(clock())

    def stand(_: list[str]) -> str:
        advance()
        body.stand()
        return "ok"

    def place(words: list[str]) -> str:
        x, y, degrees = (float(word) for word in words[:3])
        advance()
        body.put(x, y, math.radians(degrees))
        return "ok"

    def push(words: list[str]) -> str:
        forward, left = (float(word) for word in (*words, "0")[:2])
        advance()
        body.push(forward, left)
        return "ok"

    def where(_: list[str]) -> str:
        advance()
        return describe(body)

    def box(words: list[str]) -> str:
        x, y, *size = (float(word) for word in words[:3])
        body.simulation.add_crate(x, y, *size)
        return "ok"

    def unbox(_: list[str]) -> str:
        if not body.simulation.crates:
            raise UnknownRequest("unbox: there is no crate to take away")
        body.simulation.remove_crate()
        return "ok"

    kept = {word: command for word, command in words.items() if word != "sonar"}
    return kept | scene_word(body.simulation, advance) | {
        "stand": Command("", "put it on its feet where it started; slack joints as for standing", stand),
        "place": Command("X Y DEGREES", "put it on its feet somewhere in its world, its joints as they are", place),
        "push": Command("FORWARD [LEFT]", "push its chest for 0.1 s, N", push),
        "where": Command("", "where it is: m, m, degrees; and what it does", where),
        "box": Command("X Y [SIZE]", "add a crate to the world", box),
        "unbox": Command("", "remove the crate that was added last", unbox),
    }  # fmt: skip
