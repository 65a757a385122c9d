"""The queries of the console itself: names to complete, descriptions, interruption.

They use a connection of their own, opened on first use, so that they are answered while a statement of the user runs,
and leave no trace in the user's lobby.  The queries are functions of ``assistant.u``.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Final

from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dial import open_streams
from urbihw.client.lines import BadLine, Lines, guarded
from urbihw.client.subject import Step
from urbihw.client.where import Where

CHANNEL: Final = "__urbihw_assistant"
TIMEOUT_S: Final = 1.0
"""Maximum seconds for an answer; users do not wait longer for a completion."""
CHUNK: Final = 256 * 1024

_STRING: Final = re.compile(r'"((?:[^"\\]|\\.)*)"', re.DOTALL)
_ESCAPE: Final = re.compile(r"\\(x[0-9a-fA-F]{2}|.)", re.DOTALL)
_LETTERS: Final = {"n": "\n", "t": "\t", "r": "\r", "a": "\a", "b": "\b", "f": "\f", "v": "\v"}


class NoAnswer(Exception):
    """The server did not answer, or answered with an error; the message gives the reason."""


@dataclass(frozen=True)
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
        self._streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None
        self._lines = Lines()
        self._turn = asyncio.Lock()

    async def names(self, uid: str, path: Sequence[Step]) -> list[str]:
        """The names of all slots of the object at a path; an empty name separates the slots that every object has.

        Raises NoAnswer.
        """
        return strings(await self._ask(f"assistant_names({quoted(uid)}, {written(path)})"))

    async def describe(self, uid: str, path: Sequence[Step], name: str) -> Description:
        """The description of a slot.  Raises NoAnswer."""
        answer = await self._ask(f"assistant_help({quoted(uid)}, {written(path)}, {quoted(name)})")
        kind, text, protos, source, *slots = strings(answer)
        return Description(kind, text, protos, source, tuple(slots))

    async def interrupt(self, uid: str) -> None:
        """Kill the user's foreground job.  Raises NoAnswer."""
        await self._ask(f"assistant_interrupt({quoted(uid)})")

    async def _ask(self, expression: str) -> str:
        async with self._turn:
            try:
                return await asyncio.wait_for(self._answer(expression), TIMEOUT_S)
            except TimeoutError:
                self.close()
                raise NoAnswer("the server does not answer") from None
            except (OSError, UnicodeError, BadLine, Denied) as error:
                self.close()
                raise NoAnswer(str(error)) from error

    async def _answer(self, expression: str) -> str:
        if self._streams is None:
            self._streams = await open_streams(self._where, self._who)
            self._lines = Lines()
            self._streams[1].write(files("urbihw.client").joinpath("assistant.u").read_bytes())
        reader, writer = self._streams
        writer.write(guarded(f'Channel.new("{CHANNEL}") << {{ {expression} }}', CHANNEL).encode() + b";\n")
        while data := await reader.read(CHUNK):
            for line in self._lines.feed(data):
                if line.channel == CHANNEL and line.is_error:
                    raise NoAnswer(line.shown.removeprefix("!!! "))
                if line.channel == CHANNEL:
                    return line.shown
        self.close()
        raise NoAnswer("the server closed the connection")

    def close(self) -> None:
        """Close the connection; the next query opens a new one."""
        if self._streams is not None:
            with contextlib.suppress(OSError, RuntimeError):
                self._streams[1].close()
            self._streams = None


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
