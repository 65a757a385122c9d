"""Joints: goals and stiffnesses, and which way goals reach the robot: ``setAngles``, or the DCM."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

from urbihw.buses.errors import BadValue, Unavailable
from urbihw.buses.messages import FromWorker, Refused, Reply, Request
from urbihw_nao.dcm_writer import DcmWriter
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.joint_writer import STIFFNESS, AngleWriter, JointWriter
from urbihw_nao.motor_trace import MotorTrace
from urbihw_nao.options import SHIFTS_S, NaoOptions
from urbihw_nao.orders import REACHED, SLACK, JointOrders
from urbihw_nao.part import Devices, NaoPart
from urbihw_nao.qimessaging.checked import to_number, to_row
from urbihw_nao.qimessaging.session import QiCall

MOTORS: Final = "motors"
"""Stands for the way in which all joints are written."""
WHERE_TIMEOUT_S: Final = 0.1
"""Seconds that a stop waits to hear where the joints are now."""


class JointPart(NaoPart):
    """Targets "angle" (rad) and "stiffness" (0 to 1) of all joints; "write" of ``MOTORS``: "dcm" (bool), "shift" (s),
    "trace" (the path of a file, "" to end it).
    """

    verbs = frozenset({"write"})

    def __init__(self, exchange: NaoExchange, orders: JointOrders) -> None:
        super().__init__(exchange)
        self.orders = orders
        self.trace = MotorTrace()
        self._angles = AngleWriter(exchange, orders, self.trace)
        self._dcm = DcmWriter(exchange, orders, self.trace)
        self._writer: JointWriter = self._angles
        self._options: NaoOptions | None = None
        self._looked: dict[str, float] = {}
        self._wants_dcm = False
        self._names: frozenset[str] = frozenset()

    def begin(self) -> None:
        """See ``Part``: learn the names of the joints, and how they are written."""
        names = [joint.name for joint in self.exchange.info.joints]
        self._names = frozenset(names)
        self.trace.number_motors(names)
        self._angles.begin()
        self._writer = self._angles
        self._apply_options()

    def _apply_options(self) -> None:
        """What a setting says counts until a program chooses, and again when the setting is changed."""
        options, known = self.exchange.options, self._options
        self._options = options
        if known is None or known.dcm_write != options.dcm_write:
            self._wants_dcm = options.dcm_write
        if known is None or known.dcm_shift != options.dcm_shift:
            self._dcm.shift = options.dcm_shift
        try:
            self._select_writer(self._dcm if self._wants_dcm else self._angles)
        except (Unavailable, ValueError) as error:
            self.exchange.news.append(Refused(MOTORS, "dcm", str(error)))

    def end(self) -> None:
        self._writer.drop_goals(list(self._names))
        self.orders.stiffnesses.clear()

    def owns(self, device: Any) -> bool:
        return device == MOTORS or device in self._names

    def set_target(self, device: Any, item: str, value: float) -> str:
        if device == MOTORS or item not in ("angle", "stiffness"):
            return "no such target"
        if item == "angle":
            return self._writer.set_angle(device, value)
        self.orders.stiffnesses[device] = value
        return ""

    def send(self) -> None:
        exchange, orders = self.exchange, self.orders
        if exchange.options is not self._options:
            self._apply_options()
        if orders.stiffnesses and not exchange.busy(STIFFNESS):
            self._send_stiffnesses()
        self._writer.send(exchange.now())
        if self.trace.full:
            exchange.news.append(Refused(MOTORS, "trace", f"{self.trace.full} is full, so the trace has ended"))
            self.trace.full = ""

    def _send_stiffnesses(self) -> None:
        exchange = self.exchange
        stiffnesses, goals = self.orders.pop_stiffnesses()

        def stiffen(_: QiCall | None = None) -> None:
            names, values = list(stiffnesses), list(stiffnesses.values())
            exchange.call(STIFFNESS, exchange.motion, "setStiffnesses", names, values)

        if goals:
            # Only behind the answer is it sure that no old goal is left.
            names, places = list(goals), list(goals.values())
            exchange.call(STIFFNESS, exchange.motion, "setAngles", names, places, 1.0, then=stiffen)
        else:
            stiffen()

    # ---------------------------------------------------------------- settings of the motors

    def request(self, message: Request) -> list[FromWorker]:
        match message.item, message.value:
            case "dcm", bool(wanted):
                self._select_writer(self._dcm if wanted else self._angles)
                self._wants_dcm = wanted
            case "shift", float(seconds) if SHIFTS_S[0] <= seconds <= SHIFTS_S[1]:
                self._dcm.shift = seconds
            case "shift", _:
                least, most = (round(bound * 1000) for bound in SHIFTS_S)
                raise BadValue(f"the shift of the DCM is {least} to {most} ms")
            case "trace", "":
                self.trace.close()
            case "trace", str(path):
                self.trace.open(path)
            case _:
                raise BadValue(f"motors have no setting {message.item}")
        return [Reply(message.reply_id, True, message.value)]

    def _select_writer(self, writer: JointWriter) -> None:
        """Write joints this way from now on; what moves holds first.  Raises Unavailable, BadValue, LinkGone."""
        old = self._writer
        if writer is old:
            return
        writer.begin()
        old.drop_goals(list(self._names))
        self._hold(self._names)
        self._writer = writer
        if old is self._dcm and self._dcm.moved:
            # ALMotion still has the old goals.
            places = {name: self.orders.where[name] for name in self._dcm.moved}
            self._dcm.moved.clear()
            self.exchange.post_motion("setAngles", list(places), list(places.values()), 1.0)

    # ---------------------------------------------------------------- stops

    def _meant(self, devices: Devices) -> list[str]:
        return [joint.name for joint in self.exchange.info.joints if devices is None or joint.name in devices]

    def drop_targets(self, devices: Devices) -> None:
        names = self._meant(devices)
        self.orders.drop_waiting(names)
        self._writer.drop_goals(names)

    def stop(self, devices: Devices) -> None:
        """Let joints under way hold where they are."""
        self._hold(self._meant(devices))

    def _hold(self, joints: Iterable[str]) -> None:
        exchange, orders, writer = self.exchange, self.orders, self._writer
        sent = [name for name in joints if name in orders.sent and orders.stiff.get(name, 0.0) > SLACK]
        if not sent:
            return
        try:
            angles = exchange.ask(exchange.motion, "getAngles", sent, True, timeout=WHERE_TIMEOUT_S)
            where = dict(zip(sent, map(to_number, to_row(angles)), strict=True))
        except (Unavailable, ValueError):
            where = {name: orders.where[name] for name in sent}
        hold = orders.under_way(sent, where)
        hold |= {name: where[name] for name in writer.may_move(sent, exchange.now())}
        if hold:
            orders.hold(hold)
            writer.hold(hold)

    def have_moved(self) -> bool:
        """Whether a stiff joint is elsewhere than at the last call: a slack one may be moved by hand."""
        before, self._looked = self._looked, dict(self.orders.where)
        stiff = [name for name, stiffness in self.orders.stiff.items() if stiffness > SLACK]
        return any(abs(self._looked[name] - before[name]) > REACHED for name in stiff if name in before)

    def is_moving(self) -> bool:
        """See ``Part``: a stiff joint is on its way."""
        orders = self.orders
        stiff = [name for name in orders.sent if orders.stiff.get(name, 0.0) > SLACK]
        return bool(orders.under_way(stiff, orders.where) or self._writer.may_move(stiff, self.exchange.now()))

    def find_moving(self) -> list[Any]:
        """Stiff joints that are not at their goals."""
        exchange, orders = self.exchange, self.orders
        names = [joint.name for joint in exchange.info.joints]
        answers = (to_row(exchange.ask(exchange.motion, "getAngles", "Body", sensors)) for sensors in (False, True))
        goals, angles = (dict(zip(names, map(to_number, each), strict=True)) for each in answers)
        moving = [
            name for name in names
            if orders.stiff.get(name, 0.0) > SLACK and abs(goals[name] - angles[name]) > REACHED
        ]  # fmt: skip
        orders.sent |= {name: goals[name] for name in moving}
        return moving
