"""Set up single servos: id, speed, registers, factory values, backup, and a replacement for a broken one.

No tool here makes a servo move: the torque is switched off before anything is written, and stays off.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Final

from urbihw.buses.errors import BadUrl, BadValue, BusError, Unavailable
from urbihw.cli.dialogue import Dialogue
from urbihw.cli.options import whole
from urbihw.cli.ports_in_use import open_line
from urbihw.cli.servo_verbs import VerbJob, adopt, back_up, read, reboot, reset, restore, set_baud, set_id, write
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.settings import one_line

_id = whole(0, 253, "id")
_VERBS: Final[dict[str, tuple[str, Callable[[VerbJob], None]]]] = {
    "set-id": ("give the servo an id, or several servos one after the other", set_id),
    "set-baud": ("set the speed of the servo", set_baud),
    "read": ("print registers with their units", read),
    "write": ("write registers, raw counts", write),
    "reset": ("give the servo its factory values, but its own id and speed", reset),
    "reboot": ("restart the servo (protocol 2.0), which clears its hardware error", reboot),
    "backup": ("write all registers of all servos, or one, to a file", back_up),
    "restore": ("write the EEPROM back as in a backup, where it differs", restore),
    "adopt": ("give a replacement the id, speed and registers of its predecessor", adopt),
}


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw servo``."""
    verbs = parser.add_subparsers(dest="verb", required=True, metavar="VERB", parser_class=type(parser))
    for name, (help_, _) in _VERBS.items():
        verb = verbs.add_parser(name, help=help_, description=help_[0].upper() + help_[1:] + ".")
        verb.add_argument("url", metavar="URL", help="the port, such as /dev/ttyUSB0 or '/dev/ttyUSB0?baud=57600'")
        _verb_options(name, verb)


def _verb_options(name: str, verb: argparse.ArgumentParser) -> None:
    if name == "adopt":
        verb.add_argument("--id", type=_id, required=True, metavar="N", help="id of the predecessor, as in the backup")
        verb.add_argument("--from", dest="file", required=True, metavar="FILE", help="backup of the robot")
        verb.add_argument("--found", type=_id, metavar="N", help="present id of the replacement (default: the servo "
                                                                "that is not in the backup)")
    else:
        whose = "all" if name in {"backup", "restore"} else "the only one on the line"
        verb.add_argument("--id", type=_id, metavar="N", help=f"which servo (default: {whose})")
    if name == "set-id":
        verb.add_argument("new", type=_id, nargs="+", metavar="NEW", help="its new id; with several, the tool asks for "
                                                                          "one servo after the other")
    if name == "set-baud":
        verb.add_argument("baud", type=whole(300, 10_500_000, "speed"), metavar="BAUD", help="bits per second")
    if name == "read":
        verb.add_argument("registers", nargs="+", metavar="REGISTER",
                          help="names, addresses as 30 or 30:2 (address:bytes), or the word all")
    if name == "write":
        verb.add_argument("registers", nargs="+", metavar="NAME=VALUE",
                          help="such as return_delay_time=0, or by its address: 5=0")
    if name in {"backup", "restore"}:
        verb.add_argument("file", metavar="FILE", help="the backup")
    if name in {"restore", "adopt", "reset"}:
        verb.add_argument("--yes", action="store_true", help="do not ask")


def run(options: argparse.Namespace) -> int:
    """Carry out a verb; returns the exit code."""
    return carry_out(options, _VERBS[options.verb][1])


def carry_out(options: argparse.Namespace, verb: Callable[[VerbJob], None]) -> int:
    """Open the line, carry out a verb, and tell in one line what went wrong; returns the exit code."""
    try:
        with open_line(options.url) as line:
            verb(VerbJob(line, options, Dialogue()))
    except (BadUrl, Unavailable, BadValue) as error:
        return _complain(error, EX_CONFIG)
    except BusError as error:
        return _complain(error, EX_UNAVAILABLE)
    return EX_OK


def _complain(error: Exception, code: int) -> int:
    # Names of a file are parts of some messages, which go to a terminal.
    print(f"urbihw: {one_line(str(error))}", file=sys.stderr)
    return code
