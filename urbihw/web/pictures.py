"""Pictures as binary messages: u32 little endian length of a JSON header, the header, the data."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import Any, Final

from urbihw.client.lines import Line

_FORMATS: Final = {"jpeg": "jpeg", "jpg": "jpeg", "png": "png", "rgb": "rgb", "YCbCr": "ycbcr"}


def frame_of(number: int, line: Line, told: Mapping[str, Any], lost: int) -> bytes:
    """The message with the first Binary of a line: ``jpeg 320 240`` are its keywords.

    ``told`` is the line before it, with time and lost pictures; ``lost`` are those that the browser was too slow for.
    """
    binary = line.binaries[0]
    words = binary.keywords.split()
    sizes = [int(word) for word in words[1:3] if word.isdigit()] if len(words) > 2 else []
    width, height = sizes if len(sizes) == 2 else (None, None)
    head = {
        "sub": number, "t": told.get("t"), "lost": told.get("lost", 0) + lost,
        "format": _FORMATS.get(words[0], words[0]) if words else "", "width": width, "height": height,
    }  # fmt: skip
    text = json.dumps(head, separators=(",", ":")).encode()
    return struct.pack("<I", len(text)) + text + binary.data
