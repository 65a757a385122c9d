"""How goals of joints reach the robot: the interface of both ways (manual, "Motor back-end method"), and ``setAngles``.

A joint that limits or movements bound to a speed gets its goal with that share of its greatest speed: so the robot
keeps it by itself, also if goals arrive late and all at once.

The other way is ``dcm_writer``.  Stiffness is always written through ALMotion, which must know which joints carry the
robot.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from urbihw_nao.exchange import NaoExchange
from urbihw_nao.motor_trace import MotorTrace
from urbihw_nao.orders import JointOrders

ANGLES: Final = "angles"
"""The kind of the call that is under way; see ``Exchange.busy``."""
STIFFNESS: Final = "stiffness"
SHARES: Final = 200
"""Shares of the greatest speed are whole multiples of 1 / SHARES, so that joints of similar speed go into one call."""
LEAST_SHARE: Final = 1 / SHARES


class JointWriter:
    """The base of both ways.

    Attributes:
        exchange: the session.
        orders: goals and measurements of all joints.
        trace: what is sent is written there, if that is switched on.
    """

    def __init__(self, exchange: NaoExchange, orders: JointOrders, trace: MotorTrace) -> None:
        self.exchange, self.orders, self.trace = exchange, orders, trace

    def begin(self) -> None:
        """Joints are written this way from now on, on a fresh session or after the other way.

        Raises Unavailable, BadValue, LinkGone when the robot cannot.
        """

    def set_angle(self, joint: str, angle: float) -> str:
        """Remember a goal for the next ``send``; return why it is refused, or ""."""
        raise NotImplementedError

    def drop_goals(self, joints: Sequence[str]) -> None:
        """Forget the goals of these joints that were not sent."""
        raise NotImplementedError

    def send(self, now: float) -> None:
        """Send what is due, once a tick.  Raises LinkGone."""
        raise NotImplementedError

    def may_move(self, joints: Sequence[str], now: float) -> list[str]:
        """The joints among these whose motion goes on by what was sent, wherever they are."""
        return []

    def hold(self, places: Mapping[str, float]) -> None:
        """Let joints stay at these places, at once.  Raises LinkGone."""
        raise NotImplementedError


class AngleWriter(JointWriter):
    """One ``setAngles`` a cycle with all new goals, or one for each share of the greatest speed."""

    def __init__(self, exchange: NaoExchange, orders: JointOrders, trace: MotorTrace) -> None:
        super().__init__(exchange, orders, trace)
        self._speeds: Mapping[str, float] = {}
        self._shares: dict[str, float] = {}

    def begin(self) -> None:
        self._speeds = {joint.name: joint.speed for joint in self.exchange.info.joints if joint.speed > 0}

    def set_angle(self, joint: str, angle: float) -> str:
        self.orders.angles[joint] = angle
        pace, fastest = self.exchange.paces.get((joint, "angle"), math.inf), self._speeds.get(joint, math.nan)
        share = math.ceil(pace / fastest * SHARES) / SHARES if pace < fastest else 1.0
        self._shares[joint] = max(share, LEAST_SHARE)
        return ""

    def drop_goals(self, joints: Sequence[str]) -> None:
        for name in joints:
            self.orders.angles.pop(name, None)

    def send(self, now: float) -> None:
        exchange = self.exchange
        if not self.orders.angles or exchange.busy(ANGLES) or exchange.busy(STIFFNESS):
            return
        angles = self.orders.pop_angles()
        groups: dict[float, list[str]] = {}
        for joint in angles:
            groups.setdefault(min(self._shares.get(joint, 1.0), exchange.options.fraction), []).append(joint)
        # The answer to the last one tells that the robot keeps up.
        for share, names in groups.items():
            exchange.call(ANGLES, exchange.motion, "setAngles", names, [angles[name] for name in names], share)
        self.trace.write(now, angles.items())

    def hold(self, places: Mapping[str, float]) -> None:
        self.exchange.post_motion("setAngles", list(places), list(places.values()), 1.0)
        self.trace.write(self.exchange.now(), places.items())
