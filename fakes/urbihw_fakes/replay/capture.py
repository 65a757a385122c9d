"""Captures with times, as text; see `docs/recording.md` of the gateway for where they come from.

    # urbihw trace: {"platform": "bioloid", "devices": [...], "guessed": false}
    0.001234  > FF FF 01 02 01 FB       host to device
    0.001470  < FF FF 01 02 00 FC       device to host
    [link down]                         the adapter was gone from here
    [link up]                           to here
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

from urbihw_fakes.errors import UnknownRequest

HEAD: Final = "# urbihw trace: "
ON_CAN: Final = ("segway", "cia402")
"""Platforms that may be on a CAN bus."""
MOST_BYTES: Final = 256 << 20
"""Bytes of traffic that are kept at most."""
_LINE: Final = re.compile(r"(\d{1,12}(?:\.\d{1,12})?)\s+([<>])((?:\s[0-9A-Fa-f]{2})+)\s*")
_GAPS: Final = ("[link down]", "[link up]")


class Piece(NamedTuple):
    """Bytes at a time in seconds, `>` to the device, `<` from it; `!` for the loss of the adapter, without bytes."""

    time: float
    way: str
    data: bytes


@dataclass(frozen=True)
class Capture:
    """A capture: the platform of the robot ("" if it does not tell), and the traffic in its order."""

    platform: str
    pieces: tuple[Piece, ...]

    @property
    def is_can(self) -> bool:
        """Whether it is that of a CAN bus: a Segway may also be on its maker's link, whose packets are longer."""
        if self.platform not in ON_CAN:
            return False
        frames = [piece.data for piece in self.pieces if piece.data]
        return bool(frames) and all(2 <= len(frame) <= 10 and frame[0] < 8 for frame in frames)


def read_capture(lines: Iterable[str]) -> Capture:
    """Read a capture.

    Raises:
        UnknownRequest: a line of it cannot be understood, or it is too long.
    """
    platform, pieces, size, time = "", [], 0, 0.0
    for number, line in enumerate(lines, 1):
        if number == 1 and line.startswith(HEAD):
            platform = _platform(line)
        elif found := _LINE.fullmatch(line.rstrip("\n")):
            time, data = float(found[1]), bytes.fromhex(found[3])
            size += len(data)
            if size > MOST_BYTES:
                raise UnknownRequest(f"line {number}: more than {MOST_BYTES >> 20} MB of traffic")
            pieces.append(Piece(time, found[2], data))
        elif line.strip() == _GAPS[0]:
            pieces.append(Piece(time, "!", b""))
        elif line.strip() and line[0] not in "#[":
            raise UnknownRequest(f"line {number}: expected a time, '>' or '<' and bytes, found {line.strip()[:40]!r}")
    return Capture(platform, tuple(pieces))


def _platform(line: str) -> str:
    try:
        told = json.loads(line.removeprefix(HEAD))["platform"]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise UnknownRequest("line 1 begins as that of a capture, and is damaged") from None
    return told if isinstance(told, str) else ""
