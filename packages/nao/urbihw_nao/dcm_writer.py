"""Joints by dated commands of the robot's DCM: one ``setAlias`` with the points of all moving joints a cycle.

A target that was written at a time is due ``dcm_shift`` seconds later.  All points of a message lie within that time,
so no more motion than that is left on the robot when the worker dies.  See ``dcm_course`` for goals that come late or
are far away, and ``dcm_clock`` for the robot's time.

An alias of the DCM stands for those joints that move: a point for a joint that does not would take it away from
ALMotion, which may be walking with it.
"""

from __future__ import annotations

import errno
import math
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import Final

from urbihw.buses.errors import Unavailable
from urbihw_nao.dcm_clock import DcmClock
from urbihw_nao.dcm_course import JointCourse
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.joint_writer import ANGLES, STIFFNESS, JointWriter
from urbihw_nao.motor_trace import MotorTrace
from urbihw_nao.orders import JointOrders
from urbihw_nao.qimessaging.checked import show_text, to_whole
from urbihw_nao.qimessaging.session import QiCall, QiService
from urbihw_nao.reading import PREFIX

DCM: Final = "DCM"
ALIAS: Final = "urbihw"
MOST_ALIASES: Final = 16
"""Sets of joints whose alias is remembered; the one that was used longest ago is replaced."""
CLOCK_PERIOD_S: Final = 0.5
"""Seconds between two questions for the time of the DCM."""
FIRST_SAMPLES: Final = 3
"""Questions for it at the beginning."""
NEAR: Final = 0.1
"""Rad from its last command within which a joint still holds it: a new course begins there."""


class Aliases:
    """Names for sets of joints, which the robot learns when they are needed.  One per session."""

    def __init__(self, exchange: NaoExchange, dcm: QiService) -> None:
        self._exchange, self._dcm = exchange, dcm
        self._names: OrderedDict[tuple[str, ...], str] = OrderedDict()

    def find_joints(self, joints: Sequence[str]) -> list[str]:
        """The joints among these that the DCM knows.  Raises Unavailable, BadValue, LinkGone."""
        keys = [_key(name) for name in joints]
        answer = self._exchange.ask(self._dcm, "createAlias", [f"{ALIAS}All", keys])
        found = answer[-1] if isinstance(answer, list | tuple) and answer else None
        if not isinstance(found, list | tuple) or len(found) != len(keys):
            raise Unavailable(errno.EPROTO, f"createAlias of the DCM answers {show_text(repr(answer), 60)}")
        return [name for name, key in zip(joints, found, strict=True) if key]

    def get_name(self, joints: tuple[str, ...]) -> str:
        """The alias of these joints; "" while the robot learns it.  Raises LinkGone."""
        name = self._names.get(joints, "")
        if name:
            self._names.move_to_end(joints)
        elif not self._exchange.busy("alias"):
            self._create(joints)
        return name

    def _create(self, joints: tuple[str, ...]) -> None:
        full = len(self._names) >= MOST_ALIASES
        name = self._names.popitem(last=False)[1] if full else f"{ALIAS}{len(self._names)}"

        def known(_: QiCall) -> None:
            self._names[joints] = name

        command = [name, [_key(joint) for joint in joints]]
        self._exchange.call("alias", self._dcm, "createAlias", command, then=known)


class DcmWriter(JointWriter):
    """See the head of this file."""

    _dcm: QiService
    _aliases: Aliases

    def __init__(self, exchange: NaoExchange, orders: JointOrders, trace: MotorTrace) -> None:
        super().__init__(exchange, orders, trace)
        self.shift = 0.0
        """Seconds between the writing of a target and the time at which it is due."""
        self.moved: set[str] = set()
        """Joints that were moved past ALMotion."""
        self._clock = DcmClock()
        self._asked_at = -math.inf
        self._delay = math.inf
        self._speeds: dict[str, float] = {}
        self._courses: dict[str, JointCourse] = {}

    def begin(self) -> None:
        """See ``JointWriter``: look for the DCM, its joints and its time."""
        exchange = self.exchange
        found = exchange.find_service(DCM)
        if found is None:
            raise Unavailable(errno.ENODEV, "this robot has no DCM: joints are written by setAngles")
        self._dcm, self._aliases = found, Aliases(exchange, found)
        self._clock, self._delay = DcmClock(), math.inf
        self._courses.clear()
        names = [joint.name for joint in exchange.info.joints if joint.name != "RHipYawPitch"]
        known = set(self._aliases.find_joints(names))
        self._speeds = {
            joint.name: joint.speed for joint in exchange.info.joints if joint.name in known and joint.speed > 0
        }
        for _ in range(FIRST_SAMPLES):
            sent = exchange.now()
            self._clock.add_sample(sent, _to_time(exchange.ask(found, "getTime", 0)))
        self._asked_at = exchange.now()

    # ---------------------------------------------------------------- goals

    def set_angle(self, joint: str, angle: float) -> str:
        speed = self._speeds.get(joint)
        if speed is None:
            return f"the DCM of this robot knows no joint {joint}"
        now = self.exchange.now()
        course = self._courses.get(joint)
        if course is None:
            if joint not in self.orders.where:
                return f"{joint} has not told yet where it is"
            speed *= self.exchange.options.fraction
            course = self._courses[joint] = JointCourse(self.orders.where[joint], speed, now)
        course.add_goal(self._written_at(now) + self.shift, angle, now)
        return ""

    def _written_at(self, now: float) -> float:
        """When the targets that arrive now were written, by our clock: as if all had been as quick as the quickest."""
        written = self.exchange.written
        if written is None:
            return now
        self._delay = min(self._delay, now - written)
        return written + self._delay

    def drop_goals(self, joints: Sequence[str]) -> None:
        for name in joints:
            if name in self._courses:
                self._courses[name].drop_goals()

    # ---------------------------------------------------------------- commands

    def send(self, now: float) -> None:
        exchange = self.exchange
        self._ask_time(now)
        if exchange.busy(ANGLES) or exchange.busy(STIFFNESS):
            return
        live = tuple(name for name in self._speeds if name in self._courses and self._courses[name].is_live(now))
        for name in [name for name in self._courses if name not in live]:
            if self._courses[name].ends_at < now:
                del self._courses[name]
        if not live:
            return
        alias = self._aliases.get_name(live)
        if not alias:
            return
        rows = {name: self._pop_points(name, now) for name in live}
        if not any(rows.values()):
            return
        command = []
        for name, points in rows.items():
            course = self._courses[name]
            # Each joint of an alias needs a point: the last one, once more.
            dated = points or [(course.ends_at, course.place)]
            command.append([[place, self._clock.date(time), 0] for time, place in dated])
            self.orders.sent[name] = course.place
        self.moved.update(rows)
        exchange.call(ANGLES, self._dcm, "setAlias", [alias, "Merge", "time-mixed", command])
        for name, points in rows.items():
            for time, place in points:
                self.trace.write(time, ((name, place),))

    def _pop_points(self, name: str, now: float) -> list[tuple[float, float]]:
        course = self._courses[name]
        first = []
        if course.ends_at <= now:
            if not course.moves_until(now):
                return []
            where = self.orders.where.get(name, course.place)
            place = course.place if abs(course.place - where) <= NEAR else where
            # The DCM draws its line from the last point, however long ago that was.
            first = [course.begin_anew(place, now)]
        return first + course.pop_points(now + self.shift)

    def _ask_time(self, now: float) -> None:
        exchange = self.exchange
        if now - self._asked_at < CLOCK_PERIOD_S or exchange.busy("time"):
            return
        self._asked_at = now
        clock = self._clock
        exchange.call("time", self._dcm, "getTime", 0, then=lambda call: clock.add_sample(now, _to_time(call.value)))

    # ---------------------------------------------------------------- stops

    def may_move(self, joints: Sequence[str], now: float) -> list[str]:
        return [name for name in joints if name in self._courses and self._courses[name].moves_until(now)]

    def hold(self, places: Mapping[str, float]) -> None:
        """See ``JointWriter``: drop what is dated ahead."""
        exchange = self.exchange
        now = exchange.now()
        date = self._clock.date(now)
        for name, place in places.items():
            self._courses.pop(name, None)
            exchange.post(self._dcm, "set", [_key(name), "ClearAll", [[place, date]]])
        self.trace.write(now, places.items())


def _to_time(value: object) -> int:
    """A time of the DCM, whose 32 bits may have a sign.  Raises BadFrame."""
    return to_whole(value, -(1 << 31), (1 << 32) - 1)


def _key(joint: str) -> str:
    """The actuator of a joint (fact sheet, section 8)."""
    return f"{PREFIX}{joint}/Position/Actuator/Value"
