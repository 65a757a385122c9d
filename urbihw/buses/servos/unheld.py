"""What limits of speed and position cannot hold: writes that are refused while such a limit holds for a servo.

The gate clamps the goal of a joint and leads it there no faster than allowed, and it clamps the speed of a wheel.  A
current, a PWM and a step from the present position tell neither how fast nor how far the servo goes.  A raw write that
changes the mode makes a register mean something else, and one of torque lets the servo go to an old goal: the
slots `mode` and `load` write a goal at rest with it.  The range of a position holds for joints; a wheel has none.

Apart from limits: what takes a servo off the line is never written by the robot, since no stop would reach it then.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.buses.messages import Limit
from urbihw.buses.servos.item import Mode, ShaftMotion, is_place
from urbihw.buses.servos.member import GOAL, Member
from urbihw.buses.servos.plan import TORQUE

Limits = Mapping[tuple[Any, str], Limit]
Step = tuple[str, Any]

_LINE: Final = {
    "id": "set-id",
    "baud_rate": "set-baud",
    "protocol_type": "write",
    "secondary_id": "write",
    "status_return_level": "write",
}
"""Registers that take a servo off the line -> the subcommand of `urbihw servo` that writes them."""
_SPEEDS: Final = frozenset({"goal_velocity", "goal_speed", "moving_speed"})
"""Effectors that are the speed of a wheel."""
_FRAME: Final = frozenset({"homing_offset", "drive_mode", "multi_turn_offset", "resolution_divider"})
"""Registers that decide which angle a count of position is, and which way and by what the servo turns: a joint whose
count jumps is pulled there at its own speed."""


def check_line(name: str, raw: Any) -> None:
    """Raise BadValue for a write after which the servo would not be heard, or not be reached by a stop.

    A status return level of 0 is such a write: the servo then answers pings only.
    """
    if name in _LINE and (name != "status_return_level" or raw == 0):
        raise BadValue(
            f"{name} would take the servo off the line of this robot: stop the robot and use urbihw servo {_LINE[name]}"
        )


def explain_target(member: Member, name: str, raw: Any, limits: Limits) -> str:
    """Return why a target cannot be held within the limits of its servo, "" if it can."""
    rule = _motion_limit(member, limits)
    mode = member.device.mode
    if rule is None or mode is None or name != mode.effector or raw == 0 or _holds(member, mode, rule, limits):
        return ""
    return f'in the mode "{mode.name}" nothing keeps it within {rule.name}'


def explain_writes(member: Member, steps: Iterable[Step], raw_write: bool, limits: Limits) -> str:
    """Return why writes cannot be held within the limits of their servo, "" if they can.

    `raw_write`: a single register; the writes of a change of mode are several, and leave the servo at rest.
    """
    rule = _motion_limit(member, limits)
    if rule is None:
        return ""
    before = member.device.mode
    steps = tuple(steps)
    after = _mode_after(member, steps)
    if after is not before and (raw_write or (after is not None and not _is_kind_held(after))):
        if raw_write:
            return f"it would change the mode while {rule.name} holds: use the slots mode, cwLimit and ccwLimit"
        return f'{rule.name} cannot be kept in the mode "{after.name if after else "?"}"'
    for name, raw in steps:
        reason = explain_target(member, name, raw, limits) if after is before else ""
        reason = reason or (_explain_raw(name, raw, rule) if raw_write else "")
        if reason:
            return reason
    return ""


def is_speed_after(member: Member, steps: Iterable[Step], name: str) -> bool:
    """Return whether a register is the speed of a wheel in the mode that these writes select."""
    mode = _mode_after(member, tuple(steps))
    return mode is not None and mode.motion is ShaftMotion.RATE and mode.effector == name


def leaves_place(member: Member, steps: Iterable[Step]) -> bool:
    """Return whether the servo may be elsewhere than at its last target after these writes: torque or mode changed."""
    modes = member.table.mode_items
    return any(name == TORQUE or name in modes or member.regains_force(name, raw) for name, raw in steps)


def _explain_raw(name: str, raw: Any, rule: Limit) -> str:
    if name == TORQUE and raw:
        return f"it would go to an old goal while {rule.name} holds: use load = 1"
    if is_place(name):
        return f"what {name} moves is unknown while {rule.name} holds"
    if name in _FRAME:
        return f"{name} changes what a position is while {rule.name} holds"
    return ""


def _motion_limit(member: Member, limits: Limits) -> Limit | None:
    """Return the limit of position and speed of a servo, None if it has none: its goal has it in every mode."""
    rule = limits.get((member.device.id, GOAL))
    if rule is None or (rule.low, rule.high, rule.rate) == (-math.inf, math.inf, math.inf):
        return None
    return rule


def _is_kind_held(mode: Mode) -> bool:
    """Return whether limits can be kept in a mode: with a place or the speed of a wheel as its goal."""
    return mode.motion is ShaftMotion.POSITION or mode.effector in _SPEEDS


def _holds(member: Member, mode: Mode, rule: Limit, limits: Limits) -> bool:
    """Return whether the limits at hand keep the goal of a mode; right after a change, those of a wheel may be missing.

    Until then the table is that of the mode before.
    """
    if mode.motion is ShaftMotion.POSITION:
        return True
    return mode.effector in _SPEEDS and (rule.rate == math.inf or (member.device.id, mode.effector) in limits)


def _mode_after(member: Member, steps: Iterable[Step]) -> Mode | None:
    """Return the mode after some writes, None if it cannot be told."""
    items = member.table.mode_items
    values = {**member.device.setup, **{name: raw for name, raw in steps if name in items}}
    return member.table.mode_of(values) if all(name in values for name in items) else None
