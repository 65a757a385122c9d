"""What a worker on a Dynamixel wire may be told beyond what every worker is told (`messages.Configure.options`)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from urbihw.settings import SWITCH, Table, choice, setting, wholes

_LAST_ID = 252


@dataclass(frozen=True)
class Options(Table):
    """The options of the family.

    Attributes:
        protocol: of the wire: 1, 2 or "auto"; read when the link opens.
        ids: devices to look for when the link opens; all if empty.
        fast_read: use FAST SYNC READ where all devices of a group can do it.
    """

    protocol: Literal[1, 2, "auto"] = setting("auto", choice(1, 2, "auto", wants='1, 2 or "auto"'))
    ids: tuple[int, ...] = setting((), wholes(0, _LAST_ID, "[1, 2, 100]"))
    fast_read: bool = setting(True, SWITCH)
