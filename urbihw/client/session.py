"""One connection of the client library without its socket: bytes of the server in, answers and items out.

``core`` uses it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from time import time
from typing import Any, Final, NamedTuple

from urbihw.client.dialect import Native, PlainDialect, hello_text
from urbihw.client.errors import BadAnswer, ClientError, SlotMissing, UrbiError
from urbihw.client.lines import MAX_LINE_BYTES, Line, Lines
from urbihw.client.media import media_of
from urbihw.client.streams import Stream
from urbihw.client.values import NotAValue, value_of

CHANNEL_PREFIX: Final = "_client"
MAX_QUOTED: Final = 60
"""Maximum number of characters quoted from what cannot be read."""
_LOCATION: Final = re.compile(r"(?:[^\s:]+:)?\d+\.\d+(?:-[\d.]+)?: ")
_EVAL_CALL: Final = re.compile(r": eval$")
_OWN_CALL: Final = re.compile(r": (?:answer\w+|eval)$")


class Message(NamedTuple):
    """What the server said without being asked: output of ``echo``, errors of background jobs, other channels.

    Attributes:
        time: in seconds since 1970 of this computer's clock.
        channel: its channel; empty for values and ``echo``.
        text: the text.
        is_error: whether it is an error.
        raw: the line as it was received, without the line feed.
    """

    time: float
    channel: str
    text: str
    is_error: bool
    raw: bytes = b""


def message_of(line: Line, time: float) -> Message:
    """A line as a message."""
    return Message(time, line.channel, line.shown, line.is_error, line.raw)


OnLine = Callable[[Line, float], None]
"""Gets a line, and its time as in ``Message``."""


class NoPlainValue(NamedTuple):
    """An object or a function of the robot, which has no value in Python."""

    kind: str
    printed: str
    classes: tuple[str, ...] = ()


class Question:
    """A statement whose answer is expected on its channel.  ``located``: a location in an error is one in the text of
    the user.  ``raw``: the answer is a Line of any content."""

    __slots__ = ("channel", "done", "error", "located", "raw", "stamp", "value")

    def __init__(self, channel: str, located: bool, raw: bool) -> None:
        self.channel = channel
        self.located = located
        self.raw = raw
        self.done = False
        self.stamp = 0
        self.error: ClientError | None = None
        self.value: Any = None

    def result(self) -> Any:
        """The value.  Raises the error of the server, or that of the connection."""
        if self.error is not None:
            raise self.error
        return self.value

    def finish(self, value: Any = None, error: ClientError | None = None) -> None:
        """The answer of the server is complete."""
        self.value, self.error, self.done = value, error, True


class Session:
    """Questions and streams of one connection.  ``offset``: local time minus the server's time, in seconds."""

    def __init__(
        self, on_line: OnLine, asks_first: bool = True, max_line: int = MAX_LINE_BYTES
    ) -> None:
        """``on_line`` gets each line that is neither an answer nor of a stream; ``asks_first``: what comes before the
        answer to the first question is left out; ``max_line``: bytes of the longest line."""
        self.lines = Lines(max_line)
        self.dialect: Native = Native() if asks_first else PlainDialect()
        self.offset = 0.0
        self.greeted = not asks_first
        self._on_line = on_line
        self._questions: dict[str, Question] = {}
        self._free: list[str] = []
        self._streams: dict[str, Stream] = {}
        self._count = 0

    # ---------------------------------------------------------------- questions

    def open_question(self, located: bool = False, raw: bool = False) -> Question:
        """A question with a channel of its own.  Channels are used again, as the server keeps compiled statements."""
        if self._free:
            channel = self._free.pop()
        else:
            self._count += 1
            channel = f"{CHANNEL_PREFIX}{self._count}"
        question = self._questions[channel] = Question(channel, located, raw)
        return question

    def close_question(self, question: Question) -> None:
        """The answer is fetched, or not wanted any more: then the channel is not used again, as it may come later."""
        if self._questions.pop(question.channel, None) is not None and question.done:
            self._free.append(question.channel)

    def hello(self) -> tuple[Question, str]:
        """The first question, and its text."""
        question = self.open_question()
        return question, hello_text(question.channel)

    def take_hello(self, question: Question, asked: float, answered: float) -> None:
        """The answer to the first question: what the server can.  Its stamp is the server's time.  Raises UrbiError
        or BadAnswer."""
        told = question.result()
        if not isinstance(told, list) or len(told) != 3:
            raise BadAnswer(f"the server answered the first question with {shortened(repr(told))}; is that an "
                            "urbiscript server?")
        _, answers, subscriptions = told
        if not (answers and subscriptions):
            self.dialect = PlainDialect()
        self.greeted = True
        self.set_offset(question.stamp / 1000, asked, answered)

    def set_offset(self, told: Any, asked: float, answered: float) -> None:
        """Compare the clocks: the server's time, in the middle between question and answer.  Raises BadAnswer."""
        if not isinstance(told, float) or not math.isfinite(told):
            raise BadAnswer(f"the server told {shortened(repr(told))} as its time")
        self.offset = (asked + answered) / 2 - told

    # ---------------------------------------------------------------- streams

    def add_stream(self, stream: Stream) -> None:
        """Give a stream a channel on this connection."""
        self._count += 1
        stream.channel = f"{CHANNEL_PREFIX}{self._count}_{type(stream).__name__.removesuffix('Stream').lower()}"
        self._streams[stream.channel] = stream

    def remove_stream(self, stream: Stream) -> None:
        """Its lines are ignored from now on."""
        self._streams.pop(stream.channel, None)

    @property
    def streams(self) -> list[Stream]:
        """The streams, in the order in which they began."""
        return [*self._streams.values()]

    # ---------------------------------------------------------------- what comes

    def feed(self, data: bytes) -> None:
        """Bytes of the server.  Raises BadLine when it is no urbiscript server."""
        now = time()
        for line in self.lines.feed(data):
            channel = line.channel
            question = self._questions.get(channel)
            if question is not None:
                if line.stamp is not None:
                    question.stamp = line.stamp
                    self._answer(question, line)
                continue
            stream = self._streams.get(channel)
            if stream is not None:
                if line.stamp is not None:
                    self._take(stream, line, now)
            elif self.greeted and not channel.startswith(CHANNEL_PREFIX):
                self._on_line(line, now if line.stamp is None else line.stamp / 1000 + self.offset)

    def lose(self, make_error: Callable[[], ClientError]) -> None:
        """The connection has ended: no question will be answered."""
        for question in self._questions.values():
            if not question.done:
                question.finish(error=make_error())

    def _take(self, stream: Stream, line: Line, now: float) -> None:
        # A line cannot come before it was sent: that bounds the difference of the clocks.
        if line.stamp is not None and now - line.stamp / 1000 < self.offset - 0.001:
            self.offset = now - line.stamp / 1000
        try:
            stream.take(line, self._convert, self.offset)
        except (ValueError, LookupError, TypeError, ArithmeticError, RecursionError):
            stream.add(BadAnswer(f"the server sent on {stream.channel} what cannot be read: {shortened(line.shown)}"))

    def _answer(self, question: Question, line: Line) -> None:
        if line.is_error:
            question.finish(error=_urbi_error("", line.shown[4:].splitlines(), question.located))
            return
        if question.raw:
            question.finish(line)
            return
        try:
            answer = self._convert(line)
        except NotAValue:
            question.finish(NoPlainValue("object", line.shown))
            return
        try:
            self._finish(question, answer)
        except (LookupError, TypeError, ValueError, AttributeError):
            question.finish(error=BadAnswer(f"the server sent an answer that cannot be read: {shortened(line.shown)}"))

    def _finish(self, question: Question, answer: Any) -> None:
        if not isinstance(answer, list):
            raise TypeError
        kind, *rest = answer
        if not isinstance(kind, str):  # the first question
            question.finish(answer)
        elif kind == "error":
            question.finish(error=_urbi_error(rest[0], rest[1], question.located))
        elif kind == "object":
            question.finish(NoPlainValue(kind, rest[0], tuple(rest[1])))
        elif kind == "function":
            question.finish(NoPlainValue(kind, rest[0]))
        else:
            question.finish(rest[0] if rest else None)

    def _convert(self, line: Line) -> Any:
        return _decoded(value_of(line, media_of, lambda name: NoPlainValue("object", name)))


def _decoded(value: Any) -> Any:
    """Strings as UTF-8, where they are."""
    if isinstance(value, str):
        if value.isascii():
            return value
        raw = value.encode("latin-1")
        try:
            return raw.decode("utf-8")
        except UnicodeDecodeError:
            return value
    if isinstance(value, list):
        return [_decoded(member) for member in value]
    if isinstance(value, dict):
        return {_decoded(key): _decoded(member) for key, member in value.items()}
    return value


def shortened(text: str) -> str:
    """The beginning of a text, for a message of one line."""
    line = " ".join(text.split())
    return line if len(line) <= MAX_QUOTED else line[:MAX_QUOTED] + " ..."


def _urbi_error(kind: str, lines: list[str], located: bool) -> UrbiError:
    head = lines[0] if lines else "unknown error"
    place = _LOCATION.match(head)
    location, text = (head[: place.end() - 2], head[place.end() :]) if place else ("", head)
    calls = tuple(line.strip() for line in lines[1:] if not _OWN_CALL.search(line))
    made = SlotMissing if kind == "Lookup" or not kind and text.startswith("lookup failed: ") else UrbiError
    # An error outside the text of the user, such as that of a tag, has its location in the statement of this library.
    inside = located and (not kind or any(map(_EVAL_CALL.search, lines[1:])))
    return made(text, location if inside else "", kind, calls)
