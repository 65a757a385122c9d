"""The object ``nao`` (the robot on its connection), and how its parts get what the worker says.

Proxies of services are made in ``nao.u``, the tree of components (``robot``) in ``tree.u``.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import BadConfig, Origin, event, function, reading
from urbihw.platforms.base import LimitedDevice, WiredRobot
from urbihw.platforms.nao.call_part import SERVICES, may_move
from urbihw.platforms.nao.devices import (
    SENSOR_OBJECTS,
    NaoBattery,
    NaoBumper,
    NaoFsr,
    NaoLed,
    NaoSensor,
)
from urbihw.platforms.nao.finding import NaoInfo
from urbihw.platforms.nao.joints import NaoHand, NaoJoint, NaoWalk
from urbihw.platforms.nao.reading import SENSOR
from urbihw.platforms.nao.walk_part import WALK

TREE: Final = "tree.u"
"""Builds the standard robot API, when the robot was found."""
SHARED: Final[Mapping[str, str]] = {"RHipYawPitch": "LHipYawPitch"}
"""Joints that have the motor of another one (fact sheet, section 6)."""


class Nao(WiredRobot):
    """A Nao."""

    uname = "NaoRobot"
    classes = (NaoJoint, NaoHand, NaoWalk, NaoLed, NaoSensor, NaoBumper, NaoBattery, NaoFsr)

    robot_name = "nao"
    family = "urbihw.platforms.nao.driver:NaoDriver"

    model = reading("")
    services = reading()
    answered = event()
    happened = event()

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.joints: dict[str, NaoJoint] = {}
        self._sensors: list[Any] = []
        self._methods: Mapping[str, tuple[str, ...]] = {}
        self._count = 0
        self._built = self._complete = False

    def status(self) -> str:
        """See ``Robot``."""
        if not self.link.sensed:
            return "link down"
        stiff = sum(joint.load.sensed > 0 for joint in self.joints.values())
        return f"{self.model.sensed}, {stiff} of {len(self.joints)} joints stiff" + self.rate_words()

    # ---------------------------------------------------------------- what is there

    def on_found(self, message: m.Found) -> None:
        """See ``WiredRobot``.  Comes again when the link is back; the objects are made once."""
        (info,) = message.devices
        self.model.sense(info.model)
        self.services.sense(list(info.services))
        self._methods = info.methods
        if not self._built:
            self._build(info)
            path = Path(__file__).with_name(TREE)
            self.host.run(path.read_text("latin-1"), str(path), self._has_tree)
            return
        self.send_limits()

    def _build(self, info: NaoInfo) -> None:
        self._built = True
        create, channel, motion = self.host.create, self.channel, self.motion
        for joint in info.joints:
            device = SHARED.get(joint.name, joint.name)
            if joint.name.endswith("Hand"):
                made: NaoJoint = create(NaoHand, joint.name, channel, motion, joint, device, self._failed)
            else:
                made = create(NaoJoint, joint.name, channel, motion, joint, device)
            self.joints[joint.name] = made
        for name in info.leds:
            create(NaoLed, name, channel, name)
        self.walk = create(NaoWalk, "naoWalk", channel, motion)
        self._sensors = [create(kind, name, item) for name, (kind, item) in SENSOR_OBJECTS.items()]
        self._sensors += [create(NaoBattery, "battery"), create(NaoFsr, "fsr")]

    def _has_tree(self, problem: str) -> None:
        if problem:
            self.answer_open(BadConfig(problem))
            return
        self._complete = True
        self.send_limits()
        self.wait_for_readings()

    def is_complete(self) -> bool:
        """See ``WiredRobot``."""
        return self._complete

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """See ``WiredRobot``: the joints that have a motor of their own, and walking."""
        if not self._built:
            return {}
        return {name: joint for name, joint in self.joints.items() if name not in SHARED} | {WALK: self.walk}

    # ---------------------------------------------------------------- what the worker says

    def on_samples(self, message: m.Samples) -> None:
        """See ``WiredRobot``."""
        if not self._built:
            return
        for device, values in message.values.items():
            stamp = message.times[device] + self.offset
            if device in self.joints:
                self.joints[device].show(values, stamp)
            elif device == SENSOR:
                for sensor in self._sensors:
                    sensor.show(values, stamp)
            elif device == WALK:
                self.walk.show(values, stamp)

    def on_happened(self, message: m.Happened) -> None:
        """See ``WiredRobot``: an event of ALMemory."""
        self.happened.emit(message.what, message.value)

    def on_link_down(self, reason: str) -> None:
        """See ``WiredRobot``."""
        if self._built:
            self.walk.halted()
        if self._complete:
            # It walks on, but will be stopped when the link is back: no speed is kept.
            self.send("do (Mobility.of(robot)) { abort; xSpeed = 0; yawSpeed = 0 };")

    def on_halt(self, reason: str, devices: tuple[Hashable, ...] | None = None) -> None:
        """See ``WiredRobot``."""
        if self._built and (devices is None or WALK in devices):
            self.walk.halted()

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def methods(self, service: str) -> list[str]:
        """The methods of a service that is known from the start, an empty list for others."""
        return list(self._methods.get(service, ()))

    @function
    def describe(self, service: str) -> int:
        """Ask for the methods of a service; ``answered`` then has this number, the list in a
        list, which is empty if there is none, and why."""
        number = self._next()
        self.channel.send_request("describe", service, self._answer(number))
        return number

    @function("callService")
    def call_service(self, service: str, method: str, arguments: list[Any]) -> int:
        """Call a method of a service of NAOqi; ``answered`` as for ``describe``."""
        number = self._next()
        origin: Origin | None = None
        if may_move(service, method):
            origin = self.motion.admit(SERVICES)
        self.channel.call(service, method, arguments, self._answer(number), origin)
        return number

    @function("mayMove")
    def may_move(self, service: str, method: str) -> bool:
        """Whether a method may move the robot."""
        return may_move(service, method)

    @function
    def listen(self, key: str) -> int:
        """Hear of an event of ALMemory from now on: ``happened`` has its key and value.  ``answered`` as above."""
        number = self._next()
        self.channel.send_request("listen", key, self._answer(number))
        return number

    def _next(self) -> int:
        if not self.link.sensed:
            raise ValueError("the link to the robot is down")
        self._count += 1
        return self._count

    def _answer(self, number: int) -> Any:
        def answered(reply: m.Reply) -> None:
            # Nothing is an answer too.
            value = [] if reply.value is None else [reply.value]
            self.answered.emit(float(number), value, reply.error)

        return answered

    def _failed(self, what: str, reason: str) -> None:
        self.log.warning("%s: not done: %s", what, reason)
