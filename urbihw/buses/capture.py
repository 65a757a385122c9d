"""Recorded traffic as text: what `spy://` prints, the .hex captures of the simulated robots, logs of candump.

The first line of a capture of ``urbihw trace --save`` tells how it is decoded: `CaptureHead`.  Forms of the other
lines, recognised one by one::

    0.001234  > FF FF 01 02 01 FB              spy://, urbihw trace --save
    > FF FF 01 02 01 FB                        a capture by hand; [name] begins an exchange, # a comment
    (1436509052.249713) can0 413#000000        candump -L
    can0  413   [8]  00 00 00 00 00 00 00 00   candump
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final, TextIO

from urbihw.buses.errors import BadFrame
from urbihw.buses.trace import Chunk, Direction
from urbihw.frozen import frozen

_TIME: Final = r"(\d{1,12}(?:\.\d{1,12})?)"
_BYTES: Final = re.compile(rf"(?:{_TIME}\s+)?([<>])((?:\s+[0-9A-Fa-f]{{2}})+)\s*")
_LOG: Final = re.compile(rf"\({_TIME}\)\s+\S+\s+([0-9A-Fa-f]{{1,8}})#([0-9A-Fa-f.]*|R\d*)(?:\s+([TR]))?\s*")
_SCREEN: Final = re.compile(
    rf"(?:\({_TIME}\)\s+)?\S+\s+([0-9A-Fa-f]{{1,8}})\s+\[\d+\]((?:\s+[0-9A-Fa-f]{{2}})*|\s+remote request)\s*"
)
_SECTION: Final = re.compile(r"\[([^\]]*)\].*")
_EXTENDED: Final = 0xFFFF
"""Stands for an identifier of 29 bits, which no robot here uses."""
_HEAD: Final = "# urbihw trace: "
_LONGEST_LINE: Final = 1 << 20
"""Characters of a line at most."""


@frozen(slots=False)
class CaptureHead:
    """What a capture tells of itself: a comment, which other readers of captures pass over.

    Attributes:
        platform: of the robot, "" if it is not known.
        devices: on the wire, as the worker described them.
        guessed: the platform is only likely.
    """

    platform: str = ""
    devices: Sequence[Mapping[str, Any]] = ()
    guessed: bool = False

    @classmethod
    def parse(cls, line: str) -> CaptureHead:
        """Read the first line of a capture; one without a head tells nothing. Raises BadFrame for a damaged head."""
        if not line.startswith(_HEAD):
            return cls()
        try:
            told = json.loads(line.removeprefix(_HEAD))
            platform, devices, guessed = told["platform"], told["devices"], told["guessed"]
        except (ValueError, KeyError, TypeError, RecursionError):
            raise BadFrame("line 1 begins as that of a capture, and is damaged: remove it") from None
        rows = isinstance(devices, list) and all(isinstance(row, dict) for row in devices)
        if not (isinstance(platform, str) and rows and isinstance(guessed, bool)):
            raise BadFrame("line 1 begins as that of a capture, and is damaged: remove it")
        return cls(platform, devices, guessed)

    def line(self) -> str:
        """Return the line that `parse` reads."""
        told = {"platform": self.platform, "devices": list(self.devices), "guessed": self.guessed}
        return _HEAD + json.dumps(told)


def lines_of(file: TextIO) -> Iterator[str]:
    """Yield the lines of a file; of one that is too long for a capture only a part is read into memory at a time."""
    while line := file.readline(_LONGEST_LINE + 1):
        yield line


def read_capture(lines: Iterable[str]) -> Iterator[Chunk | str]:
    """Yield the chunks of a capture, and the name of each exchange before its chunks.

    A line without a time has that of the one before. Raises BadFrame, with its number, for a line of another form or
    too long.
    """
    time = 0.0
    for number, line in enumerate(lines, 1):
        if len(line) > _LONGEST_LINE:
            raise BadFrame(f"line {number} is longer than {_LONGEST_LINE} characters: this is no capture")
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        chunk = _chunk(text, time)
        if chunk is not None:
            time = chunk.time
            yield chunk
        elif section := _SECTION.fullmatch(text):
            yield section[1]
        else:
            raise BadFrame(f"line {number} is no line of a capture: {text[:40]!r}")


def capture_line(chunk: Chunk) -> str:
    """Return a chunk as a line that `read_capture` reads."""
    return f"{chunk.time:.6f}  {chunk.direction} {chunk.data.hex(' ').upper()}"


def _chunk(text: str, time: float) -> Chunk | None:
    if found := _BYTES.fullmatch(text):
        direction: Direction = ">" if found[2] == ">" else "<"
        return Chunk(float(found[1]) if found[1] else time, direction, bytes.fromhex(found[3]))
    if found := _LOG.fullmatch(text):
        data = b"" if found[3].startswith("R") else bytes.fromhex(_even(found[3].replace(".", "")))
        return Chunk(float(found[1]), ">" if found[4] == "T" else "<", _identifier(found[2]) + data)
    if found := _SCREEN.fullmatch(text):
        data = b"" if "remote" in found[3] else bytes.fromhex(found[3])
        return Chunk(float(found[1]) if found[1] else time, "<", _identifier(found[2]) + data)
    return None


def _identifier(text: str) -> bytes:
    return (_EXTENDED if len(text) > 3 else int(text, 16)).to_bytes(2, "big")


def _even(digits: str) -> str:
    return digits[: len(digits) & ~1]
