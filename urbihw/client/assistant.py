"""The queries of a console or an editor itself: names to complete, descriptions, interruption.

They use a connection of their own, opened on first use, so that they are answered while a statement of the user runs,
and leave no trace in the user's lobby.  The queries are functions of ``assistant.u``.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Iterable, Sequence
from importlib.resources import files
from typing import Final, NamedTuple

from urbihw.client.aio_connection import AsyncConnection
from urbihw.client.credentials import Credentials
from urbihw.client.dialect import Native, sent
from urbihw.client.errors import ClientError, TimedOut, UrbiError
from urbihw.client.lines import Line, guarded
from urbihw.client.subject import Step, Subject
from urbihw.client.where import Where
from urbihw.frozen import frozen

TIMEOUT_S: Final = 1.0
"""Maximum seconds for an answer; users do not wait longer for a completion."""

_IDENTIFIER: Final = re.compile(r"[A-Za-z_]\w*")
_STRING: Final = re.compile(r'"((?:[^"\\]|\\.)*)"', re.DOTALL)
_ESCAPE: Final = re.compile(r"\\(x[0-9a-fA-F]{2}|.)", re.DOTALL)
_LETTERS: Final = {"n": "\n", "t": "\t", "r": "\r", "a": "\a", "b": "\b", "f": "\f", "v": "\v"}


class NoAnswer(Exception):
    """The server did not answer, or answered with an error; the message gives the reason."""


class KnownName(NamedTuple):
    """A slot that may be typed.

    Attributes:
        name: its name.
        rank: "0" for what the user looks for first, up to "3" for what every object has (``System.completions``).
        meaning: what it is, in one line; "" where the server does not say.
    """

    name: str
    rank: str
    meaning: str


@frozen(slots=False)
class Description:
    """The description of a slot; ``source`` is the text of a function, ``slots`` are the slots that not every object
    has: names, or of a device name, value, unit, range and meaning, separated by tabs."""

    type: str
    text: str
    protos: str
    source: str
    slots: tuple[str, ...]


class Assistant:
    """Sends one query at a time."""

    def __init__(self, where: Where, who: Credentials) -> None:
        self._where = where
        self._who = who
        self._link: AsyncConnection | None = None
        self._turn = asyncio.Lock()

    async def names(self, uid: str, path: Sequence[Step], prefix: str) -> list[KnownName]:
        """The slots of the object at a path; a server of another kind may tell those that do not begin with the prefix,
        too.  Raises NoAnswer.
        """
        told = strings(await self._ask(f"assistant_names({quoted(uid)}, {written(path)}, {quoted(prefix)})"))
        return [KnownName(*row) for row in zip(told[::3], told[1::3], told[2::3], strict=True)]

    async def call(self, uid: str, path: Sequence[Step], name: str) -> tuple[str, str]:
        """The arguments of a function in parentheses, and its description; two empty texts for what is no function.
        Raises NoAnswer."""
        arguments, text = strings(await self._ask(f"assistant_call({quoted(uid)}, {written(path)}, {quoted(name)})"))
        return arguments, text

    async def describe(self, uid: str, path: Sequence[Step], name: str) -> Description:
        """The description of a slot.  Raises NoAnswer."""
        answer = await self._ask(f"assistant_help({quoted(uid)}, {written(path)}, {quoted(name)})")
        kind, text, protos, source, *slots = strings(answer)
        return Description(kind, text, protos, source, tuple(slots))

    async def interrupt(self, uid: str) -> None:
        """Kill the user's foreground job.  Raises NoAnswer."""
        await self._ask(f"assistant_interrupt({quoted(uid)})")

    async def _ask(self, expression: str) -> str:
        def question(dialect: Native, channel: str) -> str:
            return sent(guarded(f'Channel.new("{channel}") << {{ {expression} }}', channel)) + ";\n"

        async with self._turn:
            try:
                if self._link is None:
                    self._link = AsyncConnection(self._where, self._who, TIMEOUT_S, False, lambda line, at: None, False)
                    await self._link.open()
                    self._link.send(files("urbihw.client").joinpath("assistant.u").read_text("latin-1"))
                line: Line = await self._link.ask(question, TIMEOUT_S, located=True, raw=True)
            except UrbiError as error:
                raise NoAnswer(str(error)) from None
            except ClientError as error:
                self.close()
                raise NoAnswer("the server does not answer" if isinstance(error, TimedOut) else str(error)) from error
            return line.shown

    def close(self) -> None:
        """Close the connection; the next query opens a new one."""
        if self._link is not None:
            self._link.close()
            self._link = None


def fitting(wanted: Subject, names: Iterable[KnownName]) -> list[KnownName]:
    """The names to offer, those that the user looks for first; hidden ones (``_x``) only after a typed ``_``."""
    hidden = wanted.prefix.startswith("_")
    found = [
        each
        for each in names
        if each.name.startswith(wanted.prefix)
        and _IDENTIFIER.fullmatch(each.name)
        and (hidden or not each.name.startswith("_"))
    ]
    return sorted(found, key=lambda each: (each.rank, natural(each.name), each.name))


def natural(name: str) -> list[tuple[int, str]]:
    """A key that sorts ``motor2`` before ``motor10``, whatever the case."""
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name.lower())]


def quoted(text: str) -> str:
    """Quote a text as an urbiscript string."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'


def written(path: Sequence[Step]) -> str:
    """Format a path as the argument of ``assistant_find``."""
    steps = []
    for step in path:
        if isinstance(step, str):
            steps.append(quoted(step))
        else:
            steps.append(f"[{quoted(step[0]) if isinstance(step[0], str) else format(step[0], 'g')}]")
    return f"[{', '.join(steps)}]"


def strings(answer: str) -> list[str]:
    """The strings in a printed list and in the lists inside it."""
    return [_ESCAPE.sub(_unescaped, text) for text in _STRING.findall(answer)]


def _unescaped(match: re.Match[str]) -> str:
    code = match[1]
    return chr(int(code[1:], 16)) if len(code) == 3 else _LETTERS.get(code, code)
