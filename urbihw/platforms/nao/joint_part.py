"""Joints: one ``setAngles`` with all new goals and one ``setStiffnesses`` a cycle."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from urbihw.buses.errors import Unavailable
from urbihw.buses.qi.session import Call
from urbihw.platforms.nao.exchange import Exchange
from urbihw.platforms.nao.orders import REACHED, SLACK, JointOrders
from urbihw.platforms.nao.part import Devices, Part

WHERE_TIMEOUT_S: Final = 0.1
"""Seconds that a stop waits to hear where the joints are now."""


class JointPart(Part):
    """Targets "angle" (rad) and "stiffness" (0 to 1) of all joints."""

    def __init__(self, exchange: Exchange, orders: JointOrders) -> None:
        super().__init__(exchange)
        self.orders = orders
        self._names: frozenset[str] = frozenset()

    def begin(self) -> None:
        """See ``Part``: learn the names of the joints."""
        self._names = frozenset(joint.name for joint in self.exchange.info.joints)

    def end(self) -> None:
        """See ``Part``."""
        self.orders.angles.clear()
        self.orders.stiffnesses.clear()

    def owns(self, device: Any) -> bool:
        """See ``Part``."""
        return device in self._names

    def set_target(self, device: Any, item: str, value: float) -> str:
        """See ``Part``."""
        waiting = {"angle": self.orders.angles, "stiffness": self.orders.stiffnesses}.get(item)
        if waiting is None:
            return "no such target"
        waiting[device] = value
        return ""

    def send(self) -> None:
        """See ``Part``."""
        exchange, orders = self.exchange, self.orders
        if orders.stiffnesses and not exchange.busy("stiffness"):
            self._send_stiffnesses()
        if orders.angles and not exchange.busy("angles") and not exchange.busy("stiffness"):
            angles = orders.pop_angles()
            rows = list(angles), list(angles.values())
            exchange.call("angles", exchange.motion, "setAngles", *rows, exchange.options.fraction)

    def _send_stiffnesses(self) -> None:
        exchange = self.exchange
        stiffnesses, goals = self.orders.pop_stiffnesses()

        def stiffen(_: Call | None = None) -> None:
            names, values = list(stiffnesses), list(stiffnesses.values())
            exchange.call("stiffness", exchange.motion, "setStiffnesses", names, values)

        if goals:
            # Only behind the answer is it sure that no old goal is left.
            names, places = list(goals), list(goals.values())
            exchange.call("stiffness", exchange.motion, "setAngles", names, places, 1.0, then=stiffen)
        else:
            stiffen()

    # ---------------------------------------------------------------- stops

    def _meant(self, devices: Devices) -> list[str]:
        return [joint.name for joint in self.exchange.info.joints if devices is None or joint.name in devices]

    def drop_targets(self, devices: Devices) -> None:
        """See ``Part``."""
        self.orders.drop_waiting(self._meant(devices))

    def stop(self, devices: Devices) -> None:
        """Let joints under way hold where they are."""
        self._hold(self._meant(devices))

    def _hold(self, joints: Iterable[str]) -> None:
        exchange, orders = self.exchange, self.orders
        sent = [name for name in joints if name in orders.sent and orders.stiff.get(name, 0.0) > SLACK]
        if not sent:
            return
        try:
            angles = exchange.ask(exchange.motion, "getAngles", sent, True, timeout=WHERE_TIMEOUT_S)
            where = dict(zip(sent, map(float, angles), strict=True))
        except (Unavailable, ValueError, TypeError):
            where = {name: orders.where[name] for name in sent}
        hold = orders.under_way(sent, where)
        if hold:
            orders.hold(hold)
            exchange.post_motion("setAngles", list(hold), list(hold.values()), 1.0)

    def find_moving(self) -> list[Any]:
        """Stiff joints that are not at their goals."""
        exchange, orders = self.exchange, self.orders
        names = [joint.name for joint in exchange.info.joints]
        goals, angles = (
            dict(zip(names, exchange.ask(exchange.motion, "getAngles", "Body", sensors), strict=True))
            for sensors in (False, True)
        )
        moving = [
            name for name in names
            if orders.stiff.get(name, 0.0) > SLACK and abs(goals[name] - angles[name]) > REACHED
        ]  # fmt: skip
        orders.sent |= {name: goals[name] for name in moving}
        return moving
