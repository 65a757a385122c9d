"""The traffic of a Pioneer, decoded: ARCOS commands and packets; no I/O and no time.

Positions and speeds are raw: what they are in SI units depends on the model (``README.md``). The battery is in V, the
heading in rad.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

from urbihw.buses.errors import BadFrame
from urbihw.buses.trace import Cut, Direction, StreamDecoder, TracedPacket, hex_of, with_unit
from urbihw.platforms.p3dx import packets, sip
from urbihw.platforms.p3dx.commands import COMMANDS
from urbihw.platforms.p3dx.protocol import HEADER, NEGATIVE, POSITIVE, TEXT, checksum

_NAMES: Final = {row.number: (name, row.meaning) for name, row in COMMANDS.items()}
_SYNCS: Final = ("SYNC0", "SYNC1", "SYNC2")


class ArcosDecoder(StreamDecoder):
    """Decodes the packets of ARCOS."""

    def cut(self, direction: Direction, data: bytearray) -> Cut | None:
        """Return how these bytes begin."""
        start = data.find(HEADER)
        if start < 0:
            noise = len(data) - data.endswith(HEADER[:1])
            return Cut(noise, noise=True) if noise else None
        if start:
            return Cut(start, noise=True)
        if len(data) < 3:
            return None
        if data[2] < 3:
            return Cut(3, noise=True)
        size = data[2] + 3
        if len(data) < size:
            return None
        inner = data.find(HEADER, 3, size)
        return Cut(inner, noise=True) if inner > 0 and not _is_intact(data[:size]) else Cut(size)

    def decode(self, time: float, direction: Direction, data: bytes) -> list[TracedPacket]:
        body = data[3:-2]
        if not _is_intact(data):
            return [TracedPacket(time, direction, "", "?", hex_of(data), "bad", "the checksum is wrong", data)]
        problem = ""
        try:
            what, detail = _command(body) if direction == ">" else _answer(body)
        except BadFrame as error:
            what, detail, problem = f"packet 0x{body[0]:02X}", hex_of(body[1:]), str(error)
        return [TracedPacket(time, direction, "", what, detail, "ok", problem, data)]


def arcos(devices: Sequence[Mapping[str, Any]]) -> ArcosDecoder:
    """Return a decoder; the devices need not be known."""
    return ArcosDecoder()


def _is_intact(data: bytes | bytearray) -> bool:
    return checksum(bytes(data[3:-2])) == data[-2] << 8 | data[-1]


def _command(body: bytes) -> tuple[str, str]:
    name, meaning = _NAMES.get(body[0], (f"command {body[0]}", ""))
    kind, rest = body[1:2], body[2:]
    if kind == bytes((TEXT,)) and rest:
        argument = hex_of(rest[1:])
    elif kind and kind[0] in (POSITIVE, NEGATIVE) and len(rest) == 2:
        argument = str((-1 if kind[0] == NEGATIVE else 1) * int.from_bytes(rest, "little"))
    else:
        argument = hex_of(body[1:])
    return name, f"{argument} ({meaning})".lstrip() if meaning else argument


def _answer(body: bytes) -> tuple[str, str]:
    """Return the name and the content of a packet of the robot.  Raises BadFrame."""
    kind, rest = body[0], body[1:]
    if kind in (sip.STOPPED, sip.MOVING):
        return "SIP", _sip(sip.parse(body))
    if kind == packets.CONFIG:
        values = packets.parse_config(rest)
        shown = ("name", "class", "subclass", "serial", "firmware", "watchdog")
        return "CONFIGpac", ", ".join(f"{name} {values[name]}" for name in shown)
    if kind in packets.PACKETS:
        row = packets.PACKETS[kind]
        values_ = row.read(rest)
        return row.device, ", ".join(
            f"{name} {hex_of(value) if isinstance(value, bytes) else value}" for name, value in values_.items()
        )
    if kind < len(_SYNCS):
        return _SYNCS[kind], rest.decode("latin-1").replace("\0", " ").strip() if kind == 2 else hex_of(rest)
    if kind in packets.RESET_NOTICES:
        return "reset notice", hex_of(rest)
    return f"packet 0x{kind:02X}", hex_of(rest)


def _sip(values: sip.Sip) -> str:
    angle = values.theta * math.tau / sip.FULL_TURN
    parts = [
        "moving" if values.moving else "standing", f"x {values.x}", f"y {values.y}",
        with_unit("heading", values.theta, angle, "rad"), f"left {values.left}", f"right {values.right}",
        with_unit("battery", values.battery, values.battery / 10, "V"), f"stall 0x{values.stall:04X}",
        f"flags 0x{values.flags:04X}",
    ]  # fmt: skip
    if values.sonars:
        parts.append("sonars " + " ".join(f"{number}:{distance}" for number, distance in values.sonars))
    return ", ".join(parts)
