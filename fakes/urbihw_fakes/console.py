"""Commands that a person types at a running fake: one line in, one line out.

The words here fit every robot; a robot brings its own as a table of `Command`s (see `urbihw_fakes.bioloid.console`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from urbihw_fakes.errors import FakeError, UnknownRequest
from urbihw_fakes.faults import WORDS
from urbihw_fakes.serving import Endpoint


@dataclass(frozen=True, slots=True)
class Command:
    """One word: what may follow it, what it does, and the function that takes the rest and returns what to print."""

    usage: str
    help: str
    run: Callable[[list[str]], str]


class Console:
    """Carries out lines for one endpoint; `own` are the robot's own words."""

    def __init__(self, endpoint: Endpoint, own: Mapping[str, Command]) -> None:
        self._endpoint = endpoint
        self._device = endpoint.device
        self._commands: dict[str, Command] = {
            **{word: self._fault(word) for word in WORDS},
            "heal": Command("[ID]", "end the faults of one unit, or all", self._heal),
            "power": Command("on|off [ID]", "give or cut power", self._power),
            "unplug": Command("", "take the adapter away", lambda _: self._say(self._endpoint.unplug)),
            "plug": Command("", "bring the adapter back", lambda _: self._say(self._endpoint.plug)),
            "log": Command("[COUNT]", "the last pieces of traffic (10)", self._log),
            "help": Command("", "these lines", lambda _: self._help()),
            **own,
        }

    def line(self, text: str) -> str:
        """Carry out one line; return the answer, `ok` or `error: ...`. An empty line does nothing."""
        words = text.split()
        if not words:
            return ""
        command = self._commands.get(words[0])
        if command is None:
            return f"error: {words[0]!r} is not a word here; say help"
        try:
            return command.run(words[1:])
        except FakeError as error:
            return f"error: {error}"
        except (ValueError, IndexError, TypeError):
            return f"error: usage: {words[0]} {command.usage}"

    def words(self) -> list[dict[str, str]]:
        """The words, for programs: name, parameters and meaning of each."""
        return [
            {"name": word, "parameters": command.usage, "meaning": command.help}
            for word, command in self._commands.items()
        ]

    def _fault(self, word: str) -> Command:
        def run(words: list[str]) -> str:
            who = int(words[0]) if words and words[0] != "all" else None
            amount = float(words[1]) if len(words) > 1 else None
            self._device.faults.start(word, who, amount=amount)
            return "ok"

        if word == "echo":
            return Command("", "fault: the adapter echoes", run)
        return Command("[ID|all] [AMOUNT]", f"fault: {word}", run)

    def _heal(self, words: list[str]) -> str:
        self._device.faults.stop(who=int(words[0]) if words else None)
        return "ok"

    def _power(self, words: list[str]) -> str:
        switch = {"on": self._device.power_on, "off": self._device.power_off}.get(words[0])
        if switch is None:
            raise UnknownRequest(f"power {words[0]}: say on or off")
        switch(self._endpoint.clock(), int(words[1]) if len(words) > 1 else None)
        return "ok"

    def _log(self, words: list[str]) -> str:
        count = int(words[0]) if words else 10
        return "\n".join(str(traffic) for traffic in list(self._device.log)[-count:])

    def _say(self, action: Callable[[], None]) -> str:
        action()
        return "ok"

    def _help(self) -> str:
        rows = [(f"{word} {command.usage}".strip(), command.help) for word, command in self._commands.items()]
        return "\n".join(f"{usage:32} {meaning}" for usage, meaning in rows)
