"""What helps after an alarm of a servo, in words for people.

Causes are the words of ``status`` and of ``hardware_errors`` in the control tables.  Sources of what restores the
torque: e-manual of Dynamixel, "Shutdown" (protocol 1.0: Torque Limit is 0 until it is written again; protocol 2.0: only
a reboot helps); Feetech's memory tables, "unloading condition".
"""

from __future__ import annotations

from typing import Final

NO_TORQUE_LIMIT: Final = "its torque limit is 0, as after an alarm"
_REMEDIES: Final = {
    "overheating": "let it cool",
    "overload": "free it",
    "overcurrent": "free it",
    "input voltage": "check its supply",
    "electrical shock": "check its supply and its cable",
    "position sensor": "check what holds its shaft; if it comes again, the servo is broken",
    "encoder": "check what holds its shaft; if it comes again, the servo is broken",
    "hall sensor": "check what holds its shaft; if it comes again, the servo is broken",
    "angle limit": "keep its goal within its limits",
}


def remedy(words: str) -> str:
    """Return what to do about the causes of an alarm, such as "overheating, overload", before it is switched on."""
    found = [text for cause, text in _REMEDIES.items() if cause in words.split(", ")]
    return ", ".join(dict.fromkeys(found)) or "mend the cause"


def advised(words: str, command: str) -> str:
    """Return an alarm with what helps, in one line: ``command`` gives the torque back; "" without an alarm."""
    return f"{words}: {remedy(words)}, then {command}" if words else ""
