"""The answer of a servo, and the meaning of its error byte in both protocols of Dynamixel and in that of Feetech.

The error byte has two parts. *State* (voltage, heat, overload; in protocol 2.0 the alert bit) stays set in every
answer while it lasts, and the data beside it is good. A *refusal* means that this instruction was not
executed. A Feetech servo does not answer what it cannot execute, so all its bits are states.
Sources: e-manual, protocol 1.0 "Status packet" and protocol 2.0 "Error"; Feetech's memory tables, register "status".
"""

from __future__ import annotations

from typing import Final, NamedTuple

FEETECH: Final = 3
"""The number under which the protocol of Feetech goes here: packets of protocol 1.0 with error bits of their own."""

STATE_BITS_1: Final = {0x01: "input voltage", 0x04: "overheating", 0x20: "overload"}
REFUSAL_BITS_1: Final = {0x02: "angle limit", 0x08: "range", 0x10: "checksum", 0x40: "unknown instruction"}

STATE_BITS_FEETECH: Final = {
    0x01: "input voltage",
    0x02: "position sensor",
    0x04: "overheating",
    0x08: "overcurrent",
    0x10: "angle limit",
    0x20: "overload",
}

ALERT_2: Final = 0x80  # register 70, hardware error, has the cause; only a reboot restores the torque
REFUSALS_2: Final = {
    1: "result fail",
    2: "unknown instruction",
    3: "CRC",
    4: "data range",
    5: "data length",
    6: "data limit",
    7: "access",
}

_STATE_MASKS = {1: sum(STATE_BITS_1), 2: ALERT_2, FEETECH: sum(STATE_BITS_FEETECH)}
_REFUSAL_MASKS = {1: sum(REFUSAL_BITS_1), 2: ~ALERT_2 & 0xFF, FEETECH: 0}


def state_of(error: int, protocol: int) -> int:
    """Return the state bits of an error byte: 0 without an error."""
    return error & _STATE_MASKS[protocol]


def refusal_of(error: int, protocol: int) -> int:
    """Return the refusal in an error byte: 0 if the instruction was executed."""
    return error & _REFUSAL_MASKS[protocol]


def state_words(state: int, protocol: int) -> str:
    """Return state bits as a text, for instance "overheating, overload"; "" for none."""
    if protocol == 2:
        return "hardware alert" if state & ALERT_2 else ""
    bits = STATE_BITS_1 if protocol == 1 else STATE_BITS_FEETECH
    return ", ".join(word for bit, word in bits.items() if state & bit)


def refusal_words(refusal: int, protocol: int) -> str:
    """Return a refusal as a text, for instance "range"; "" for none."""
    if protocol == 2:
        return REFUSALS_2.get(refusal, f"error number {refusal}") if refusal else ""
    return ", ".join(word for bit, word in REFUSAL_BITS_1.items() if refusal & bit)


class Status(NamedTuple):
    """One status packet, decoded. A named tuple, because thousands per second are made.

    Attributes:
        device: id of the sender.
        error: the error byte as sent.
        params: the data, unstuffed.
        protocol: 1, 2 or FEETECH.
    """

    device: int
    error: int
    params: bytes
    protocol: int

    @property
    def state(self) -> int:
        """The state bits; the data is valid with any of them."""
        return state_of(self.error, self.protocol)

    @property
    def refusal(self) -> int:
        """The refusal, 0 if there is none; with a refusal the data is meaningless."""
        return refusal_of(self.error, self.protocol)
