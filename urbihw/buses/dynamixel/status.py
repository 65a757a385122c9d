"""The answer of a Dynamixel, and what its error byte means in either protocol.

The error byte mixes two things. *State* (voltage, heat, overload; in protocol 2.0 the alert bit) stays set in every
answer while it lasts, and the data beside it is good. A *refusal* says that this very instruction was not carried
out. Source: e-manual, protocol 1.0 "Status packet" and protocol 2.0 "Error".
"""

from __future__ import annotations

from typing import Final, NamedTuple

STATE_BITS_1: Final = {0x01: "input voltage", 0x04: "overheating", 0x20: "overload"}
REFUSAL_BITS_1: Final = {0x02: "angle limit", 0x08: "range", 0x10: "checksum", 0x40: "unknown instruction"}

ALERT_2: Final = 0x80  # the hardware error register (70) says which; only a reboot brings torque back
REFUSALS_2: Final = {
    1: "result fail",
    2: "unknown instruction",
    3: "CRC",
    4: "data range",
    5: "data length",
    6: "data limit",
    7: "access",
}

_STATE_MASK_1 = sum(STATE_BITS_1)
_REFUSAL_MASK_1 = sum(REFUSAL_BITS_1)


def state_of(error: int, protocol: int) -> int:
    """Return only the lasting state bits of an error byte: 0 when all is well."""
    return error & (_STATE_MASK_1 if protocol == 1 else ALERT_2)


def refusal_of(error: int, protocol: int) -> int:
    """Return only the part of an error byte that refuses the instruction: 0 when it was carried out."""
    return error & (_REFUSAL_MASK_1 if protocol == 1 else ~ALERT_2 & 0xFF)


def state_words(state: int, protocol: int) -> str:
    """Say lasting state bits in words, for instance "overheating, overload"; "" when all is well."""
    if protocol == 2:
        return "hardware alert (register 70 says which)" if state & ALERT_2 else ""
    return ", ".join(word for bit, word in STATE_BITS_1.items() if state & bit)


def refusal_words(refusal: int, protocol: int) -> str:
    """Say a refusal in words, for instance "range"; "" when there is none."""
    if protocol == 2:
        return REFUSALS_2.get(refusal, f"error number {refusal}") if refusal else ""
    return ", ".join(word for bit, word in REFUSAL_BITS_1.items() if refusal & bit)


class Status(NamedTuple):
    """One status packet, decoded. A named tuple because thousands are made a second.

    Attributes:
        device: id of the sender.
        error: the error byte as sent.
        params: the data, unstuffed.
        protocol: 1 or 2.
    """

    device: int
    error: int
    params: bytes
    protocol: int

    @property
    def state(self) -> int:
        """The lasting state bits; the data is valid whatever they are."""
        return state_of(self.error, self.protocol)

    @property
    def refusal(self) -> int:
        """Not 0 when the instruction was refused; the data is then meaningless."""
        return refusal_of(self.error, self.protocol)
