"""The error codes of emergency messages in words.

Source: CiA 301 (classes of codes), and CiA 402-2 "Error codes" as makers' manuals quote it. Where a code is not listed,
the class of its first two digits or of its first digit is shown. Codes FFxx are the maker's own.
"""

from __future__ import annotations

from typing import Final

_CODES: Final = {
    0x2310: "continuous over-current",
    0x2320: "short circuit or earth leakage",
    0x2330: "earth leakage",
    0x2340: "short circuit",
    0x3110: "mains over-voltage",
    0x3120: "mains under-voltage",
    0x3130: "mains phase missing",
    0x3210: "DC link over-voltage",
    0x3220: "DC link under-voltage",
    0x4110: "ambient temperature too high",
    0x4210: "drive too hot",
    0x4310: "motor too hot",
    0x5112: "supply of the control electronics too low",
    0x5441: "limit switch",
    0x5530: "memory of the settings",
    0x6100: "firmware",
    0x6320: "setting out of range",
    0x7120: "motor",
    0x7121: "motor blocked",
    0x7122: "motor or commutation",
    0x7300: "sensor",
    0x7305: "encoder",
    0x7500: "communication",
    0x8110: "CAN overrun",
    0x8120: "CAN error passive",
    0x8130: "the heartbeat of the master is missing",
    0x8140: "back from bus off",
    0x8150: "two nodes with one identifier",
    0x8210: "a process data message was too short",
    0x8220: "a process data message was too long",
    0x8311: "over-torque",
    0x8331: "torque",
    0x8400: "speed",
    0x8500: "position",
    0x8611: "following error",
    0x8612: "position limit",
    0x8700: "synchronisation",
    0x9000: "external error",
}
_CLASSES: Final = {
    0x10: "error",
    0x20: "current",
    0x21: "current at the input",
    0x22: "current in the drive",
    0x23: "current at the output",
    0x30: "voltage",
    0x31: "mains voltage",
    0x32: "voltage in the drive",
    0x33: "output voltage",
    0x40: "temperature",
    0x41: "ambient temperature",
    0x42: "temperature of the drive",
    0x43: "temperature of the motor",
    0x44: "temperature of the supply",
    0x50: "hardware of the drive",
    0x60: "software of the drive",
    0x61: "firmware",
    0x62: "program of the user",
    0x63: "settings",
    0x70: "additional module",
    0x71: "power stage or motor",
    0x72: "measuring",
    0x73: "sensor",
    0x74: "calculation",
    0x80: "monitoring",
    0x81: "communication",
    0x82: "protocol",
    0x83: "torque",
    0x84: "speed",
    0x85: "position",
    0x86: "positioning",
    0x87: "synchronisation",
    0x90: "external error",
    0xF0: "additional function",
    0xFF: "the maker's own code",
}


def advised(words: str, drive: object) -> str:
    """A fault with what helps, in one line."""
    return f"{words}: mend the cause, then drive{drive}.resetFault and drive{drive}.load = 1"


def emergency_text(code: int) -> str:
    """What an error code means, "no error" for 0, and "unknown error" for a code of no known class."""
    if code < 0x100:
        return "no error"
    known = _CODES.get(code) or _CLASSES.get(code >> 8) or _CLASSES.get(code >> 8 & 0xF0)
    return known or "unknown error"
