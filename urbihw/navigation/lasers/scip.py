"""Messages of a Hokuyo laser with SCIP 2 (URG-04LX, UTM-30LX, UST-10LX ...); bytes only.

    host     command parameters LF
    laser    echo LF status sum LF [line sum LF]... LF

A sum is (the bytes of the line & 0x3F) + 0x30.  Numbers are written with characters of 6 bits from 0x30 on, three of
them for a distance in mm.  Steps are counted counterclockwise.  Source: Hokuyo, "Communication Protocol Specification
For SCIP2.0 Standard", C-42-03320B (2006).
"""

from __future__ import annotations

from typing import Final

from urbihw.buses.errors import BadFrame
from urbihw.frozen import frozen

OK, DATA, LASER_IS_ON = "00", "99", "02"
LONGEST: Final = 40000
"""Bytes of a message: 8192 steps, and room."""
MOST_STEPS: Final = 8192
_WORD: Final = 3
_FARTHEST_MM: Final = (1 << 6 * _WORD) - 1
"""The largest distance that three characters can tell."""
_DIGITS: Final = 9
"""Digits of a parameter; more make no sense."""


def command(text: str) -> bytes:
    """A command as a line for the laser."""
    return text.encode("ascii") + b"\n"


def check_sum(line: bytes) -> int:
    """The byte that ends a line."""
    return (sum(line) & 0x3F) + 0x30


@frozen
class ScipMessage:
    """A message of the laser: the ``echo`` of the command, the ``status``, and the ``lines`` without their sums."""

    echo: str
    status: str
    lines: tuple[bytes, ...]


class ScipFramer:
    """Splits a stream into messages.

    Attributes:
        damaged: number of messages with a wrong sum, without a status, or too long.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._buffer = b""

    def feed(self, data: bytes) -> list[ScipMessage]:
        """Process received bytes; returns the messages that are complete now."""
        *blocks, self._buffer = (self._buffer + data).split(b"\n\n")
        if len(self._buffer) > LONGEST:
            self.damaged += 1
            self._buffer = b""
        found = [_message(block) for block in blocks if block]
        self.damaged += found.count(None)
        return [message for message in found if message is not None]


def _message(block: bytes) -> ScipMessage | None:
    """Take a message apart; None when it is damaged."""
    echo, *lines = block.removeprefix(b"\n").split(b"\n")
    if not lines or not all(map(_is_whole, lines)) or len(lines[0]) != 3 or not lines[0][:2].isalnum():
        return None
    return ScipMessage(echo.decode("latin-1"), lines[0][:2].decode("latin-1"), tuple(line[:-1] for line in lines[1:]))


def _is_whole(line: bytes) -> bool:
    """Whether the sum of a line is right; in PP and VV a semicolon before the sum does not count, in a scan it does."""
    text, final = line[:-1], line[-1:]
    return bool(text) and final in (b"%c" % check_sum(text), b"%c" % check_sum(text.removesuffix(b";")))


def parse_rows(message: ScipMessage) -> dict[str, str]:
    """The rows ``NAME:value;`` of PP and VV."""
    rows = (line.decode("latin-1").rstrip(";").partition(":") for line in message.lines)
    return {name: value for name, _, value in rows}


@frozen
class Parameters:
    """What PP says: distances in mm, ``turn`` steps of a whole turn, and the ``first``, ``last`` and ``front`` step."""

    nearest: int
    farthest: int
    turn: int
    first: int
    last: int
    front: int

    @property
    def side(self) -> int:
        """Steps on each side of the front, the same on both."""
        return min(self.front - self.first, self.last - self.front)


def parse_parameters(message: ScipMessage) -> Parameters:
    """The parameters of PP.  Raises BadFrame for ones that make no sense."""
    rows = parse_rows(message)
    try:
        values = Parameters(*(_number(rows[name]) for name in ("DMIN", "DMAX", "ARES", "AMIN", "AMAX", "AFRT")))
    except (KeyError, ValueError) as error:
        raise BadFrame(f"the laser's parameters lack a number: {error}") from error
    steps_fit = 0 <= values.first < values.front < values.last < MOST_STEPS and 0 < values.turn <= MOST_STEPS
    ranges_fit = 0 <= values.nearest < values.farthest <= _FARTHEST_MM
    if not steps_fit or not ranges_fit or 2 * values.side > values.turn:
        raise BadFrame("the laser's parameters make no sense")
    return values


def _number(text: str) -> int:
    """The number of a row.  Raises ValueError, also for more than ``_DIGITS`` digits."""
    if len(text) > _DIGITS:
        raise ValueError(f"{text[:_DIGITS]!r}... is too long")
    return int(text)


def scan_command(first: int, last: int) -> str:
    """Measure the steps from ``first`` to ``last`` without end: MD with a cluster of 1 and no pauses."""
    return f"MD{first:04d}{last:04d}01000"


def parse_distances(message: ScipMessage, count: int) -> list[int]:
    """The distances in mm of a message of MD with the status DATA, without its time stamp.  Raises BadFrame."""
    text = b"".join(message.lines[1:])
    if len(text) != _WORD * count:
        raise BadFrame(f"a scan of {len(text)} characters instead of {_WORD * count}")
    return [
        (text[at] - 0x30) << 12 | (text[at + 1] - 0x30) << 6 | text[at + 2] - 0x30 for at in range(0, len(text), _WORD)
    ]
