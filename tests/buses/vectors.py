"""Section 10 of the Dynamixel reference sheet: bytes on the wire, and what they say.

Each exchange: how our codec builds the question (None: only its answers matter), the question, the answers with the
status each decodes to. Sources: ROBOTIS e-manual, protocol 1.0 and 2.0; the rest computed for the sheet.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from urbihw.buses.servos import packet
from urbihw.buses.servos.status import Status


@dataclass(frozen=True)
class Exchange:
    name: str
    built: bytes | None
    question: str
    answers: tuple[tuple[str, Status], ...] = field(default=())
    protocol: int = 1


def _s1(device: int, error: int, params: str) -> Status:
    return Status(device, error, bytes.fromhex(params), 1)


def _s2(device: int, error: int, params: str) -> Status:
    return Status(device, error, bytes.fromhex(params), 2)


OK1 = ("FF FF 01 02 00 FC", _s1(1, 0, ""))
P1_GOALS = {1: b"\x00\x02", 2: b"\x2c\x01", 3: b"\xbc\x02"}

EXCHANGES = (
    Exchange("ping 1", packet.ping_packet(1, 1), "FF FF 01 02 01 FB", (OK1,)),
    Exchange(
        "read temperature",
        packet.read_packet(1, 1, 43, 1),
        "FF FF 01 04 02 2B 01 CC",
        (("FF FF 01 03 00 20 DB", _s1(1, 0, "20")),),
    ),
    Exchange("broadcast write ID", packet.write_packet(1, 254, 3, b"\x01"), "FF FF FE 04 03 03 01 F6"),
    Exchange(
        "sync write goal and speed",
        packet.sync_write_packet(1, 30, {0: b"\x10\x00\x50\x01", 1: b"\x20\x02\x60\x03"}),
        "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67",
    ),
    Exchange(
        "bulk read",
        None,
        "",
        (("FF FF 01 04 00 00 80 7A", _s1(1, 0, "00 80")), ("FF FF 02 04 00 00 80 79", _s1(2, 0, "00 80"))),
    ),
    Exchange("overload and heat", None, "", (("FF FF 01 02 24 D8", _s1(1, 0x24, "")),)),
    Exchange(
        "read 36..43",
        packet.read_packet(1, 1, 36, 8),
        "FF FF 01 04 02 24 08 CC",
        (
            ("FF FF 01 0A 00 00 02 00 00 00 00 78 20 5A", _s1(1, 0, "00 02 00 00 00 00 78 20")),
            ("FF FF 01 0A 00 20 03 64 04 C8 04 6F 2B 03", _s1(1, 0, "20 03 64 04 C8 04 6F 2B")),
        ),
    ),
    Exchange(
        "write goal 512 speed 100",
        packet.write_packet(1, 1, 30, b"\x00\x02\x64\x00"),
        "FF FF 01 07 03 1E 00 02 64 00 70",
    ),
    Exchange(
        "sync write goals",
        packet.sync_write_packet(1, 30, P1_GOALS),
        "FF FF FE 0D 83 1E 02 01 00 02 02 2C 01 03 BC 02 5E",
    ),
    Exchange("wheel mode", packet.write_packet(1, 1, 6, bytes(4)), "FF FF 01 07 03 06 00 00 00 00 EE"),
    Exchange("wheel 50 % CW", packet.write_packet(1, 1, 32, b"\x00\x06"), "FF FF 01 05 03 20 00 06 D0"),
    Exchange("torque off all", packet.write_packet(1, 254, 24, b"\x00"), "FF FF FE 04 03 18 00 E2"),
    Exchange("range error", None, "", (("FF FF 01 02 08 F4", _s1(1, 8, "")),)),
    Exchange("ping AX-S1", packet.ping_packet(1, 100), "FF FF 64 02 01 98"),
    Exchange(
        "AX-S1 26..33",
        packet.read_packet(1, 100, 26, 8),
        "FF FF 64 04 02 1A 08 73",
        (("FF FF 64 0A 00 0C C8 03 28 2D 26 02 00 3D", _s1(100, 0, "0C C8 03 28 2D 26 02 00")),),
    ),
    Exchange(
        "AX-S1 claps",
        packet.read_packet(1, 100, 37, 1),
        "FF FF 64 04 02 25 01 6F",
        (("FF FF 64 03 00 02 96", _s1(100, 0, "02")),),
    ),
    Exchange("AX-S1 clear claps", packet.write_packet(1, 100, 37, b"\x00"), "FF FF 64 04 03 25 00 6F"),
    Exchange("AX-S1 note", packet.write_packet(1, 100, 40, b"\x0c\x0a"), "FF FF 64 05 03 28 0C 0A 55"),
    Exchange("AX-S1 melody", packet.write_packet(1, 100, 40, b"\x03\xff"), "FF FF 64 05 03 28 03 FF 69"),
    Exchange(
        "2 ping",
        packet.ping_packet(2, 1),
        "FF FF FD 00 01 03 00 01 19 4E",
        (("FF FF FD 00 01 07 00 55 00 06 04 26 65 5D", _s2(1, 0, "06 04 26")),),
        2,
    ),
    Exchange("2 broadcast ping", packet.ping_packet(2, 254), "FF FF FD 00 FE 03 00 01 31 42", (), 2),
    Exchange(
        "2 read position",
        packet.read_packet(2, 1, 132, 4),
        "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15",
        (("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0", _s2(1, 0, "A6 00 00 00")),),
        2,
    ),
    Exchange(
        "2 write goal",
        packet.write_packet(2, 1, 116, b"\x00\x02\x00\x00"),
        "FF FF FD 00 01 09 00 03 74 00 00 02 00 00 CA 89",
        (("FF FF FD 00 01 04 00 55 00 A1 0C", _s2(1, 0, "")),),
        2,
    ),
    Exchange(
        "2 sync read",
        packet.sync_read_packet(132, 4, [1, 2]),
        "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA",
        (
            ("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0", _s2(1, 0, "A6 00 00 00")),
            ("FF FF FD 00 02 08 00 55 00 1F 08 00 00 BA BE", _s2(2, 0, "1F 08 00 00")),
        ),
        2,
    ),
    Exchange(
        "2 sync write",
        packet.sync_write_packet(2, 116, {1: b"\x96\x00\x00\x00", 2: b"\xaa\x00\x00\x00"}),
        "FF FF FD 00 FE 11 00 83 74 00 04 00 01 96 00 00 00 02 AA 00 00 00 82 87",
        (),
        2,
    ),
    Exchange(
        "2 bulk read",
        None,
        "",
        (
            ("FF FF FD 00 01 06 00 55 00 77 00 C3 69", _s2(1, 0, "77 00")),
            ("FF FF FD 00 02 05 00 55 00 24 8B A9", _s2(2, 0, "24")),
        ),
        2,
    ),
    Exchange(
        "2 stuffed write",
        packet.write_packet(2, 1, 116, b"\xff\xff\xfd\x00"),
        "FF FF FD 00 01 0A 00 03 74 00 FF FF FD FD 00 21 E7",
        (("FF FF FD 00 01 09 00 55 00 FF FF FD FD FF DA 9E", _s2(1, 0, "FF FF FD FF")),),
        2,
    ),
    Exchange("2 torque on", packet.write_packet(2, 1, 64, b"\x01"), "FF FF FD 00 01 06 00 03 40 00 01 DB 66", (), 2),
    Exchange("2 alert", None, "", (("FF FF FD 00 01 04 00 55 80 A2 8F", _s2(1, 0x80, "")),), 2),
    Exchange("2 access error", None, "", (("FF FF FD 00 01 04 00 55 07 B0 8C", _s2(1, 7, "")),), 2),
    Exchange(
        "2 sync read 126..135",
        packet.sync_read_packet(126, 10, [1, 2, 3]),
        "FF FF FD 00 FE 0A 00 82 7E 00 0A 00 01 02 03 59 1B",
        (
            (
                "FF FF FD 00 01 0E 00 55 00 E7 FF 64 00 00 00 24 FA FF FF 84 E2",
                _s2(1, 0, "E7 FF 64 00 00 00 24 FA FF FF"),
            ),
        ),
        2,
    ),
)

# Joint answers: question, answer, sizes, what it holds.
FAST = (
    (
        packet.sync_read_packet(132, 4, [3, 7, 4], fast=True),
        "FF FF FD 00 FE 0A 00 8A 84 00 04 00 03 07 04 20 F2",
        "FF FF FD 00 FE 19 00 55 00 03 A6 00 00 00 84 08 00 07 1F 08 00 00 16 CA 00 04 FF 03 00 00 D1 9E",
        (4, 4, 4),
        (_s2(3, 0, "A6 00 00 00"), _s2(7, 0, "1F 08 00 00"), _s2(4, 0, "FF 03 00 00")),
    ),
    (
        # That of a FAST BULK READ, whose blocks differ in size.
        None,
        "",
        "FF FF FD 00 FE 14 00 55 00 03 A6 00 00 00 67 A4 00 07 A5 01 24 74 00 04 1F D9 C1",
        (4, 2, 1),
        (_s2(3, 0, "A6 00 00 00"), _s2(7, 0, "A5 01"), _s2(4, 0, "1F")),
    ),
)
