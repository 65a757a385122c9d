"""The dialogues in the documents: fenced blocks of urbiscript with the answers that were really given.

A block is fenced as ``urbiscript``, followed by the world it is played in and, if several are talking, by the window::

    ```urbiscript bioloid second
    motor6.load;
    [00012345] 1
    ```

The worlds: none (a kernel without a robot), ``servo`` (the class of docs/examples/servo.py, with three simulated
motors), or that of a platform (its simulated robot).  The blocks of a page that name the same world are played in
it, in order; each window is a connection of its own.  Answers look as in the transcripts
(``tests/lang/transcript.py``), and so does the rule for their stamps; with a robot, whose times are those of a person's
hands, stamps are never compared.  Nor are the positions in error messages, which count the lines of a connection (a
page shows some of them); nor which connection asked for a stop.

The pages are played twice in one life of the server, the second time by new connections.  A block whose answers
rightly are others then says why, at the end of its fence::

    ```urbiscript p3dx differs: the motors are on by then

A line ``// robot: WORDS`` is what is typed at the console of the fake (``python -m urbihw_fakes``) at that moment.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from lang.transcript import Unit, compare, read, unstamped

from urbihw import platforms

WORLDS = ("", "servo", *(folder.name for folder in platforms.folders()))

_BLOCK = re.compile(r"^```urbiscript *(\w*) *(\w*)(?: +differs: ([^\n]+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_FENCE = re.compile(r"^```urbiscript\b", re.MULTILINE)
_ROBOT = re.compile(r"^// robot: (.*)$", re.MULTILINE)
_CLIENT = re.compile(r"Lobby_\d+(?: \([\d.]+\))?(?:, tag \w+)?, at [\d.-]+(?:, [\d.]+ s)?")
_POSITION = re.compile(r"(!!! (?: *called from: )?)[\d.]+(?:-[\d.]+)?: ")


@dataclass(frozen=True)
class Block:
    """One dialogue; ``line`` is where it begins in the page, ``window`` tells the connections apart, ``differs`` why
    its answers are others when it is played again, "" if they are the same."""

    line: int
    world: str
    window: str
    differs: str
    unit: Unit

    def steps(self) -> list[tuple[str, str]]:
        """What is typed, cut where something happens to the robot: (what happens or nothing, what is typed then)."""
        parts = _ROBOT.split("\n" + self.unit.typed)
        return [("", parts[0]), *zip(parts[1::2], parts[2::2], strict=True)]

    def problem(self, answered: bytes, *, stamps: bool) -> str:
        """Where the answers differ from those in the page, as a diff; empty if nowhere."""
        text = answered.decode("latin-1").removesuffix("\n")
        lines = tuple(_placeless(line) for line in text.split("\n") if answered)
        expected = tuple(map(_placeless, self.unit.expected))
        if not stamps:
            lines, expected = tuple(map(unstamped, lines)), tuple(map(unstamped, expected))
        difference = compare(expected, lines, timed=False)
        return f"line {self.line}:\n{difference}" if difference else ""


def _placeless(line: str) -> str:
    return _CLIENT.sub("Lobby", _POSITION.sub(r"\1", line))


def blocks(page: Path) -> list[Block]:
    """All dialogues of a page.  Raises ValueError for one that would not be played."""
    text = page.read_text()
    found = []
    for match in _BLOCK.finditer(text):
        world, window, differs, body = match.groups()
        if world not in WORLDS:
            raise ValueError(f"{page.name}: there is no world {world!r} to play a block in")
        (unit,) = read(page, body).units
        found.append(Block(text.count("\n", 0, match.start()) + 2, world, window, differs or "", unit))
    if len(found) != len(_FENCE.findall(text)):
        raise ValueError(f"{page.name}: a block of urbiscript is not closed or its fence has too many words")
    return found


Problem = tuple[Block, str]


def differences(
    page: Path, world: str, play: Callable[[str, str], bytes], happen: Callable[[str], None], *, stamps: bool
) -> str:
    """Play the blocks of a page that belong to one world; what differed, or nothing.

    ``play(window, text)`` types a text and returns what was said by its end; ``happen(words)`` does something to the
    robot.
    """
    return "\n".join(problem for _, problem in _problems(page, world, play, happen, stamps=stamps))


def differences_again(
    page: Path, world: str, play: Callable[[str, str], bytes], happen: Callable[[str], None]
) -> str:
    """The same for a page that was played before: a block whose answers are others must say why, and no other may."""
    problems = [
        f"again, {problem}" if problem else f"line {block.line}: it no longer differs: {block.differs}"
        for block, problem in _problems(page, world, play, happen, stamps=False, quiet=True)
        if bool(problem) != bool(block.differs)
    ]
    return "\n".join(problems)


def _problems(
    page: Path,
    world: str,
    play: Callable[[str, str], bytes],
    happen: Callable[[str], None],
    *,
    stamps: bool,
    quiet: bool = False,
) -> Iterator[Problem]:
    """Each block and what differs in it; with ``quiet`` also those in which nothing does."""
    for block in blocks(page):
        if block.world == world:
            answered = b""
            for words, typed in block.steps():
                if words:
                    happen(words)
                answered += play(block.window, typed)
            problem = block.problem(answered, stamps=stamps)
            if problem or quiet:
                yield block, problem
