"""The protocol of a Spykee: bytes in, values out.  No I/O and no time.

A packet is ``PK``, its type, the length of its payload (16 bits, big-endian), and the payload; the same both ways, with
no checksum, number or acknowledgement.  Source: the fact sheet of the project, sections 2 to 11, made of seven programs
that were written against real robots; the names of the tables below are those of the sheet.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Final

from urbihw.buses.errors import BadFrame, BadValue
from urbihw.frozen import frozen

PORT: Final = 9000
"""The port of discovery (UDP) and of control (TCP)."""

# Types of packets (section 4).
AUDIO, VIDEO, POWER, LED, MOVE, FILE, PLAY, STOP, VOLUME = range(1, 10)
LOGIN, LOGIN_REPLY = 10, 11
CONFIGURATION, NETWORKS, STREAM, ENGINE, LOG = 13, 14, 15, 16, 17

# Streams (type 15).
CAMERA, MICROPHONE, LOUDSPEAKER = 1, 2, 3

# Engine, to the robot and from it (section 8).
UNDOCK, DOCK, CANCEL = 5, 6, 7
IS_UNDOCKED, IS_DOCKED = 1, 2

LEDS: Final[Mapping[str, int]] = {"headLed": 0, "ledR": 1, "ledL": 2}
"""Which of 1 and 2 is which side is not confirmed (section 15)."""
FULL: Final = 100
"""The greatest speed of a track that is useful, of 127 on the wire."""
SOUNDS: Final = range(16)
MUSIC: Final = 64
"""The id of the file that is music; 66 is the firmware and is never sent."""
FIRST_CHUNK, LAST_CHUNK = 1, 2
SOUND_RATE: Final = 16_000
"""Samples a second: signed, 16 bits, little-endian, one channel, both ways."""
LONGEST: Final = 0xFFFF

_HEADER = struct.Struct(">2sBH")
_MAGIC = b"PK"


def packet(kind: int, payload: bytes = b"") -> bytes:
    """A packet.  Raises BadValue for a payload that is too long."""
    if len(payload) > LONGEST:
        raise BadValue(f"a packet has {LONGEST} bytes at most, not {len(payload)}")
    return _HEADER.pack(_MAGIC, kind, len(payload)) + payload


def move(left: int, right: int) -> bytes:
    """The packet that sets the speeds of the tracks, -100..100 each, forward positive."""
    return packet(MOVE, struct.pack("bb", left, right))


def login(user: str, password: str) -> bytes:
    """The login request.  Raises BadValue for texts that are too long or outside ISO-8859-1, without the password."""
    try:
        fields = [text.encode("latin-1") for text in (user, password)]
    except UnicodeEncodeError:
        raise BadValue("user and password of a Spykee are written in ISO-8859-1") from None
    if any(len(field) > 255 for field in fields):
        raise BadValue("user and password of a Spykee have 255 letters at most")
    return packet(LOGIN, b"".join(bytes([len(field)]) + field for field in fields))


def upload(flags: int, data: bytes) -> bytes:
    """A chunk of a music file."""
    return packet(FILE, bytes([MUSIC, flags]) + data)


def pair(key: str, value: str) -> bytes:
    """The packet that writes a row of the configuration.

    Raises BadValue for a key or value with a separator of the rows: the protocol has no known way to escape one.
    """
    if not key or any(sign in text for text in (key, value) for sign in "&=\r\n\0"):
        raise BadValue("a key has at least one letter, and keys and values have none of & = and line ends")
    try:
        return packet(CONFIGURATION, f"{key}={value}".encode("latin-1"))
    except UnicodeEncodeError:
        raise BadValue("keys and values are written in ISO-8859-1") from None


@frozen
class Identity:
    """The content of a login reply: three names, of which the first is the identifier, and the version of the firmware.
    """

    names: tuple[str, str, str]
    firmware: str
    docked: bool


def read_login_reply(payload: bytes) -> Identity | None:
    """The content of a login reply; None for a refusal, whose payload is shorter than 8 bytes (section 5)."""
    if len(payload) < 8:
        return None
    texts, at = [], 1
    for _ in range(4):
        end = at + 1 + payload[at] if at < len(payload) else len(payload)
        if end >= len(payload):
            return None
        texts.append(payload[at + 1 : end].decode("latin-1"))
        at = end
    return Identity((texts[0], texts[1], texts[2]), texts[3], payload[at] in (0, IS_DOCKED))


def read_power(payload: bytes) -> int:
    """The level as sent: percent, or a negative number while it charges.  Raises BadFrame."""
    if len(payload) != 1:
        raise BadFrame(f"a level is one byte, not {len(payload)}")
    return int.from_bytes(payload, "big", signed=True)


def read_configuration(payload: bytes) -> dict[str, str]:
    """The rows of the configuration."""
    rows = (row.partition("=") for row in payload.decode("latin-1").split("&") if row)
    return {key: value for key, _, value in rows}


def read_networks(payload: bytes) -> list[list[str]]:
    """Name, encryption and strength of each network; the name may have colons."""
    rows = payload.decode("latin-1").split(";")
    return [fields for row in rows if len(fields := row.rsplit(":", 2)) == 3]


def read_log(payload: bytes) -> list[str]:
    """The lines of the robot's log."""
    return payload.decode("latin-1").splitlines()


class SpykeeFramer:
    """Cuts the received bytes into packets."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    @property
    def held(self) -> int:
        """The number of bytes of a packet that is not complete."""
        return len(self._buffer)

    def reset(self) -> None:
        """Drop the beginning of a packet."""
        self._buffer.clear()

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """The packets, as (type, payload), that are complete with these bytes.

        Raises BadFrame when the bytes at the place of a header are invalid: the stream cannot be synchronised again.
        """
        buffer = self._buffer
        buffer += data
        found, at = [], 0
        while len(buffer) - at >= _HEADER.size:
            magic, kind, length = _HEADER.unpack_from(buffer, at)
            end = at + _HEADER.size + length
            if magic != _MAGIC or len(buffer) < end:
                break
            found.append((kind, bytes(buffer[at + _HEADER.size : end])))
            at = end
        del buffer[:at]
        if not buffer.startswith(_MAGIC[: len(buffer)]):
            raise BadFrame("the bytes that came are no packets")
        return found


# ---------------------------------------------------------------- discovery (section 2)

QUESTION: Final = b"DSCV\x01"
_ANSWER: Final = b"DSCV\x02"


def read_discovery(data: bytes) -> dict[str, str] | None:
    """The fields of an answer, of which ``uid`` is the identifier; None for any other datagram, such as a question."""
    if len(data) < 6 or not data.startswith(_ANSWER) or len(data) < 6 + data[5]:
        return None
    fields = (field.partition("=") for field in data[6 : 6 + data[5]].decode("latin-1").split(","))
    return {key: value for key, _, value in fields if key}
