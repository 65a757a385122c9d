"""Commands that a person types at a running fake: one line in, one line out.

The words here fit every robot; a robot brings its own as a table of `Command`s (see `urbihw_fakes.bioloid.console`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from urbihw_fakes.errors import FakeError, UnknownRequest
from urbihw_fakes.serving import Endpoint


@dataclass(frozen=True, slots=True)
class Command:
    """One word: what may follow it, what it does, and the function that takes the rest and returns what to print."""

    usage: str
    help: str
    run: Callable[[list[str]], str]


_FAULTS: Final = {
    "silence": ("", "it hears and obeys, and does not answer"),
    "checksum": ("", "the last byte of each answer is wrong"),
    "cut": ("BYTES", "only the first bytes of each answer arrive (half of them)"),
    "noise": ("BYTES", "garbage comes before each answer (4 bytes)"),
    "late": ("SECONDS", "each answer comes later (0.05 s)"),
    "echo": ("", "the adapter sends back what it is sent"),
}
"""Word of a fault -> its amount, and what happens (`urbihw_fakes.faults`)."""


def spans(numbers: Sequence[int]) -> str:
    """Return numbers in words: "1 to 18, 100"."""
    runs: list[list[int]] = []
    for number in sorted(numbers):
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    return ", ".join(str(first) if first == last else f"{first} to {last}" for first, last in runs)


class Console:
    """Carries out lines for one endpoint; `own` are the robot's own words."""

    def __init__(self, endpoint: Endpoint, own: Mapping[str, Command]) -> None:
        self._endpoint = endpoint
        self._device = endpoint.device
        numbers = self._device.numbers()
        whose, of_unit = ("[ID]", f" of one unit ({spans(numbers)}), or of all") if numbers else ("", "")
        self._commands: dict[str, Command] = {
            **{word: self._fault(word, numbers) for word in _FAULTS},
            "heal": Command(whose, f"end the faults{of_unit}", self._heal),
            "power": Command(f"on|off {whose}".strip(), f"give or cut the power{of_unit}", self._power),
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

    def _fault(self, word: str, numbers: Sequence[int]) -> Command:
        amount, meaning = _FAULTS[word]
        chosen = bool(numbers) and word != "echo"

        def run(words: list[str]) -> str:
            given = words[:]
            who = None
            if chosen and given:
                first = given.pop(0)
                who = None if first == "all" else self._unit(first)
            self._device.faults.start(word, who, amount=float(given[0]) if amount and given else None)
            return "ok"

        usage = [f"[ID|all{f' [{amount}]' if amount else ''}]"] if chosen else [f"[{amount}]"] if amount else []
        return Command(" ".join(usage), f"{meaning}; ID: {spans(numbers)}" if chosen else meaning, run)

    def _heal(self, words: list[str]) -> str:
        self._device.faults.stop(who=self._unit(words[0]) if words else None)
        return "ok"

    def _unit(self, word: str) -> int:
        """The number of a unit of the robot.  Raises UnknownRequest if it has none of that number."""
        number, numbers = int(word), self._device.numbers()
        if numbers and number not in numbers:
            raise UnknownRequest(f"there is no {number}: say one of {spans(numbers)}")
        return number

    def _power(self, words: list[str]) -> str:
        switch = {"on": self._device.power_on, "off": self._device.power_off}.get(words[0])
        if switch is None:
            raise UnknownRequest(f"power {words[0]}: say on or off")
        switch(self._endpoint.clock(), self._unit(words[1]) if len(words) > 1 else None)
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
