"""The worker's half of a Nao: one ``setAngles`` of all joints with a new goal and one ``getListData`` a cycle.

Devices and their items:

    HeadYaw ...     targets "angle" (rad) and "stiffness" (0 to 1); values "angle", "stiffness", "temperature"
    walk            targets "x", "y" (m/s), "yaw" (rad/s); "write" of "config"; values: see ``walk_part``
    led NAME        ("led", NAME): targets "rgb" (0xRRGGBB), "level" (0 to 1)
    camera          "film"; value "picture": see ``camera_part``
    motors          "write" of "dcm", "shift", "trace": see ``joint_part``
    LArm, RArm      the hands in space: "write" of "pos"; values "x", "y", "z" (m): see ``wholebody_part``
    sensors         values: see ``reading.SENSORS``

Requests: "describe" of a service: the names of its methods; "call" of a service (device) and a method (item) with a
list of arguments: its result.  An answer may take hours: such a call ends with its link.  "listen" to an event of
ALMemory: from then on it comes as a ``DeviceReport`` of ("event", KEY), until "unlisten".  "follow" a key of ALMemory:
see ``sense_part``.  "film": see ``camera_part``.  "write" of ("speaker", "piece"): see ``sound_part``.  "serve",
"withdraw", "answer": see ``module_part``.

Each kind of thing is a ``Part``; one more kind is one more module with a part and a line in ``NaoDriver.__init__``.

A stop lets the robot stop walking, and joints that are under way hold where they are: none gets slack.  What services
were told to do is ended with ``killAll``.  A Nao whose link is lost goes on with its last order: a joint to its
goal, a walk without end, until the link is back, or until the program ``watchdog.py`` on the robot stops it; the fall
manager of NAOqi is never switched off here.
"""

from __future__ import annotations

import errno
import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from urbihw.buses.driver import Driver, ImpliedTarget, no_stop
from urbihw.buses.errors import BadValue, LinkGone, Unavailable
from urbihw.buses.link import Port
from urbihw.buses.messages import Configure, Found, FromWorker, Refused, Reply, Request, Samples, Targets, Watch
from urbihw.buses.readings import Quantity
from urbihw_nao.call_limits import CallLimits
from urbihw_nao.call_part import CallPart, may_move
from urbihw_nao.camera_part import FILM, CameraPart
from urbihw_nao.exchange import LINK_LOST, NaoExchange
from urbihw_nao.finding import MEMORY, MOTION, NaoInfo, find
from urbihw_nao.joint_part import JointPart
from urbihw_nao.light_part import LightPart
from urbihw_nao.micro_part import MicroPart
from urbihw_nao.module_part import ModulePart
from urbihw_nao.options import NaoOptions
from urbihw_nao.orders import JointOrders
from urbihw_nao.part import NaoPart
from urbihw_nao.qimessaging.checked import LONGEST_LINE, describe_error, show_text
from urbihw_nao.qimessaging.hosting import Hosting
from urbihw_nao.qimessaging.opening import open_session
from urbihw_nao.sense_part import SensePart
from urbihw_nao.sound_part import SoundPart
from urbihw_nao.walk_part import WALK, WalkPart
from urbihw_nao.watchdog_part import WatchdogPart
from urbihw_nao.wholebody_part import EFFECTORS, WholeBodyPart


def _escaped(message: FromWorker) -> FromWorker:
    """A message whose reason, which may have words of the robot, can be shown."""
    if isinstance(message, Refused):
        return replace(message, reason=show_text(message.reason, LONGEST_LINE))
    if isinstance(message, Reply) and message.error:
        return replace(message, error=show_text(message.error, LONGEST_LINE))
    return message


class NaoDriver(Driver):
    """See the head of this file, and ``urbihw.buses.driver.Driver`` for who calls what."""

    slow_verbs = frozenset({"describe", "listen", "serve", "follow", FILM})
    logs_in = True
    knows_motion = True
    device_info = NaoInfo
    quantities = {
        "angle": Quantity("position", "rad"),
        "temperature": Quantity("temperature", "degC"),
        "charge": Quantity("charge", ""),
        "current": Quantity("current", "A"),
    }

    def __init__(self) -> None:
        self._rest_on_stop = False
        self._exchange = exchange = NaoExchange()
        self._orders = orders = JointOrders()
        self._senses = SensePart(exchange, orders)
        self._call_limits = CallLimits(orders)
        self._hosting = Hosting()
        self._calls, self._joints = CallPart(exchange), JointPart(exchange, orders)
        # In a stop the walk ends first: its legs are no joints under way then.
        parts: tuple[NaoPart, ...] = (
            WalkPart(exchange, self._calls.is_moving), self._calls, WholeBodyPart(exchange), self._joints,
            LightPart(exchange), self._senses,
            ModulePart(exchange, self._hosting), SoundPart(exchange),
            CameraPart(exchange),
            MicroPart(exchange, self._hosting),
        )  # fmt: skip
        self._watchdog = WatchdogPart(exchange, parts)
        self._parts = (self._watchdog, *parts)

    # ---------------------------------------------------------------- settings and the link

    def configure(self, settings: Configure) -> None:
        """Take settings.  Raises BadSetting for an option."""
        options = self._exchange.options = NaoOptions.of(settings.options)
        self._hosting.settings = options.end_point()
        self._rest_on_stop = settings.torque_off_on_stop

    def attach(self, port: Port) -> list[FromWorker]:
        """Log in, and learn what there is.  Raises Unavailable, BadUrl, LinkGone."""
        exchange = self._exchange
        exchange.now, exchange.port = port.clock.now, port
        session = open_session(port)
        session.authenticate(exchange.options.login())
        try:
            motion, memory = session.look_up(MOTION), session.look_up(MEMORY)
            found = find(session, motion, memory)
            exchange.info = found.info
            self.identity = found.info.serial
            self._call_limits.begin({joint.name: joint.speed for joint in found.info.joints})
            self._senses.show_first(found)
            exchange.begin(session, motion, memory)
            self._hosting.begin(session, port)
            for part in self._parts:
                part.begin()
        except (Unavailable, LinkGone):
            session.close(LINK_LOST)
            raise
        except Exception as error:
            # An answer of another form is as bad as none.
            session.close(LINK_LOST)
            text = f"{port.url.text}: {describe_error(error)}; is this a Nao?"
            raise Unavailable(errno.EPROTO, text) from error
        if port.warning:
            exchange.news.append(Refused("connection", port.url.target, port.warning))
        return [Found((exchange.info,)), *self._collect(port.clock.now())]

    def detach(self) -> None:
        """The port is gone: what waits fails; what was sent is remembered, for the robot goes on with it."""
        self._hosting.end()
        for part in self._parts:
            part.end()
        self._exchange.end()

    def errors(self) -> dict[str, int]:
        """Failures since ``attach``."""
        if not self._exchange.linked:
            return {}
        found = self._exchange.session.counters
        return {"timeouts": found.timeouts, "refused": found.refused, "unreadable": found.unreadable}

    # ---------------------------------------------------------------- one tick

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """Take in what has come, send what is due.  Raises LinkGone."""
        if self._exchange.linked:
            self._exchange.session.poll()
            if not urgent():
                for part in self._parts:
                    part.send()
            meanwhile()
            for part in self._parts:
                part.read()
        return self._collect(now)

    def _collect(self, now: float) -> list[FromWorker]:
        exchange = self._exchange
        values, exchange.values = exchange.values, {}
        news, exchange.news = [_escaped(each) for each in exchange.news], []
        if values:
            news.append(Samples(now, values, dict.fromkeys(values, now)))
        return news

    # ---------------------------------------------------------------- what the parent wants

    def targets(self, message: Targets) -> list[FromWorker]:
        self._exchange.written, self._exchange.paces = message.time, message.rates
        return super().targets(message)

    def set_target(self, device: Any, item: str, value: Any) -> None:
        """Set a goal for the next cycle; without a robot it is dropped."""
        if not isinstance(value, int | float):
            raise BadValue(f"{value!r} is no number")
        if not self._exchange.linked:
            return
        owner = next((part for part in self._parts if part.owns(device)), None)
        problem = "no such target" if owner is None else owner.set_target(device, item, float(value))
        if problem:
            raise BadValue(problem)

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Everything is read always but streams."""
        for part in self._parts:
            if part.owns(message.device):
                part.watch(message.period is not None)
        return []

    def request(self, message: Request) -> list[FromWorker]:
        """See the head of this file.  Raises LinkGone."""
        if not self._exchange.linked:
            return [Reply(message.reply_id, False, error="the link is down")]
        try:
            for part in self._parts:
                # "write" is a verb of several parts: the device tells which one is meant.
                if message.verb in part.verbs and (message.verb != "write" or part.owns(message.device)):
                    return [_escaped(each) for each in part.request(message)]
        except LinkGone:
            raise
        except (Unavailable, ValueError, TypeError, IndexError) as error:
            return [Reply(message.reply_id, False, error=show_text(error, LONGEST_LINE))]
        except Exception as error:
            # Whatever the robot has answered, or a program has asked for: it fails alone.
            return [Reply(message.reply_id, False, error=describe_error(error))]
        return [Reply(message.reply_id, False, error=f"a Nao knows no request {message.verb!r}")]

    # ---------------------------------------------------------------- motion

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop walking, let joints under way hold where they are; with None end all behaviours.  Raises LinkGone."""
        self._stop_parts(devices)
        if devices is None:
            self._rest()

    def _stop_parts(self, devices: tuple[Any, ...] | None) -> None:
        for part in self._parts:
            part.drop_targets(devices)
        if not self._exchange.linked:
            return
        for part in self._parts:
            part.stop(devices)
        self._watchdog.release()

    def _rest(self) -> None:
        if self._rest_on_stop and self._exchange.linked:
            self._exchange.post_motion("rest")

    def stop_again(self) -> None:
        """See ``Driver``: Choregraphe, a script on the robot or Autonomous Life may begin another motion."""
        moved = self._joints.have_moved()
        if self._exchange.linked:
            self._calls.stop_again(moved)

    def stop_what_moves(self) -> tuple[Any, ...]:
        """See ``Driver``: what another program, or the last worker, has left moving.  Raises LinkGone."""
        try:
            moving = [device for part in self._parts for device in part.find_moving()]
        except (Unavailable, ValueError) as error:
            raise LinkGone(f"NAOqi does not tell whether it moves: {describe_error(error)}") from error
        if moving:
            # Only these: behaviours of others, such as a dialog, may go on.
            self._stop_parts(tuple(moving))
            self._rest()
        return tuple(moving)

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """A goal does, and a stiffness and a speed other than 0."""
        if device == WALK or item == "stiffness":
            return bool(value)
        return item == "angle"

    def implied_targets(self, request: Request) -> Iterable[ImpliedTarget]:
        """See ``Driver``: what calls of services, and hands in space, let move."""
        if request.device in EFFECTORS.values():
            return list(self._call_limits.find_anything(walk=False))
        if request.verb != "call":
            return ()
        return self._call_limits.find_targets(str(request.device), request.item, request.value)

    def request_moves(self, request: Request) -> bool:
        """The place of a hand does; a method may, unless it is known that it only asks."""
        if request.device in EFFECTORS.values():
            return True
        return request.verb == "call" and may_move(str(request.device), request.item)

    def pose(self, device: Any, item: str) -> float | None:
        return self._orders.where.get(device, math.nan) if item == "angle" else None

    def raw_of(self, device: Any, item: str, signed: float) -> Any:
        """See ``Driver``: targets are SI, and no counts."""
        return signed
