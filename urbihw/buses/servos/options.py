"""What the settings of a worker on a Dynamixel wire hold, beside those of every worker
(`messages.Configure.options`)."""

from __future__ import annotations

from typing import Literal

from urbihw.buses.servos.following import BREAKAWAY
from urbihw.frozen import frozen
from urbihw.settings import SWITCH, SettingsTable, choice, number, setting, wholes

_LAST_ID = 252
_CONTROLLERS = (
    '"", "cm5" or "cm510"; a CM-530 has no documented mode that passes bytes through: connect a USB2Dynamixel, U2D2 or '
    "USB2AX to the bus instead; an OpenCM needs no setting with the maker's bridge program on it"
)


@frozen(slots=False)
class ServoBusOptions(SettingsTable):
    """The options of the family.

    Attributes:
        protocol: of the wire: 1, 2 or "auto"; read when the link opens.
        ids: devices to look for when the link opens; all if empty.
        controller: "cm5" or "cm510": ask it for its toss mode before the first scan. Without it that is done when
            nothing answers at the speed of such a controller, 57 600 bps.
        fast_read: use FAST SYNC READ where all devices of a group can do it.
        overspeed: what happens to a joint that turns faster than its limit: "stop" it, or only "tell" it.
        blocked_limit: seconds after which something happens to a joint that is blocked; 0 for never.
        blocked_action: what that is: "stop" it where it is, or "relax" it: its torque is switched off.
        push: share of its force with which a joint that stands may push, on a way with a speed: more lets it lift an
            arm that lies on something, and lets it leap further when a hand that held it lets go.
    """

    protocol: Literal[1, 2, "auto"] = setting("auto", choice(1, 2, "auto", wants='1, 2 or "auto"'))
    ids: tuple[int, ...] = setting((), wholes(0, _LAST_ID, "[1, 2, 100]"))
    controller: Literal["", "cm5", "cm510"] = setting("", choice("", "cm5", "cm510", wants=_CONTROLLERS))
    fast_read: bool = setting(True, SWITCH)
    overspeed: Literal["stop", "tell"] = setting("stop", choice("stop", "tell"))
    blocked_limit: float = setting(0.0, number(0, 3600, " s"))
    blocked_action: Literal["stop", "relax"] = setting("stop", choice("stop", "relax"))
    push: float = setting(BREAKAWAY, number(BREAKAWAY, 1))
