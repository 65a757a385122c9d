"""Helpers that let a test read like a dialogue on the wire, in spaced hex.

They build and take apart packets on their own, so that a mistake in the fake's codec cannot hide in them.
"""

from __future__ import annotations

from urbihw_fakes.device import Device


class Talk:
    """Speaks both protocols with one device; `now` is the time of the next word, and the test moves it."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.now = 0.0
        device.tick(0.0)

    def raw(self, request: str) -> list[str]:
        """Feed bytes as they are; the answers as hex."""
        return [_hex(answer.data) for answer in self.device.feed(bytes.fromhex(request), self.now)]

    def p1(self, unit: int, body: str) -> str:
        """Send instruction and parameters in protocol 1.0; error byte and parameters of the answer, or ''."""
        answers = self.device.feed(packet1(unit, body), self.now)
        return _hex(b"".join(_body1(unit, answer.data) for answer in answers))

    def p2(self, unit: int, body: str) -> str:
        """The same in protocol 2.0 (no stuffing: give bodies that need none)."""
        answers = self.device.feed(packet2(unit, body), self.now)
        return _hex(b"".join(_body2(unit, answer.data) for answer in answers))


def packet1(unit: int, body: str) -> bytes:
    """A protocol 1.0 packet around instruction and parameters."""
    inner = bytes.fromhex(body)
    counted = bytes([unit, len(inner) + 1]) + inner
    return b"\xff\xff" + counted + bytes([0xFF - sum(counted) % 256])


def packet2(unit: int, body: str) -> bytes:
    """A protocol 2.0 packet around instruction and parameters."""
    inner = bytes.fromhex(body)
    head = b"\xff\xff\xfd\x00" + bytes([unit]) + (len(inner) + 2).to_bytes(2, "little") + inner
    return head + crc16(head).to_bytes(2, "little")


def crc16(data: bytes) -> int:
    """The rule of the sheet, bit by bit."""
    crc = 0
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x8005 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


def _body1(unit: int, answer: bytes) -> bytes:
    assert answer[:2] == b"\xff\xff" and answer[2] == unit and answer[3] == len(answer) - 4, _hex(answer)
    assert answer[-1] == 0xFF - sum(answer[2:-1]) % 256, _hex(answer)
    return answer[4:-1]


def _body2(unit: int, answer: bytes) -> bytes:
    assert answer[:4] == b"\xff\xff\xfd\x00" and answer[4] == unit and answer[7] == 0x55, _hex(answer)
    assert int.from_bytes(answer[5:7], "little") == len(answer) - 7, _hex(answer)
    assert int.from_bytes(answer[-2:], "little") == crc16(answer[:-2]), _hex(answer)
    return answer[8:-2]


def _hex(data: bytes) -> str:
    return data.hex(" ").upper()
