"""The object ``nao`` (the robot on its connection), and how its parts get what the worker says.

Proxies of services are made in ``nao.u``, the tree of components (``robot``) in ``tree.u``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import (
    NIL,
    Opened,
    RobotSettings,
    event,
    function,
    owned,
    reading,
    set_range,
)
from urbihw.platforms.arrival import LINK_DOWN
from urbihw.platforms.base import WiredRobot
from urbihw.platforms.hooks import LimitedDevice
from urbihw.platforms.teach.motions import TaughtMotions
from urbihw_nao import words
from urbihw_nao.call_part import SERVICES, may_move
from urbihw_nao.camera import NaoCamera
from urbihw_nao.camera_part import CAMERA, LOST
from urbihw_nao.devices import (
    SENSOR_OBJECTS,
    NaoBattery,
    NaoBumper,
    NaoFsr,
    NaoLed,
    NaoSensor,
)
from urbihw_nao.finding import NaoInfo
from urbihw_nao.joint_part import MOTORS
from urbihw_nao.joints import NaoHand, NaoJoint, NaoWalk
from urbihw_nao.lights import LightBoard
from urbihw_nao.memory import MemoryLinks
from urbihw_nao.micro_part import MICRO
from urbihw_nao.module_part import MODULE
from urbihw_nao.modules import SLOT as MODULES
from urbihw_nao.modules import NaoModules
from urbihw_nao.motor_control import SLOT as MOTOR
from urbihw_nao.motor_control import NaoMotorControl
from urbihw_nao.old_names import find_new_name, with_old_names
from urbihw_nao.orders import SHARED_MOTORS, SLACK
from urbihw_nao.reading import SENSOR
from urbihw_nao.sense_part import MEMORY_VALUES
from urbihw_nao.service_slot import ServiceSlot
from urbihw_nao.sound import OUTPUT_VOLUME, WORD_EVENT, NaoMicro, NaoSpeaker, NaoSpeech, NaoVoice
from urbihw_nao.walk_part import WALK
from urbihw_nao.watchdog_part import NAME as WATCHDOG
from urbihw_nao.wholebody_part import EFFECTORS

LEG_PARTS: Final = ("Hip", "Knee", "Ankle")
"""Parts of the names of the joints that carry the robot."""
LYING: Final = 1.0
"""Inclination of the torso in rad from which on the robot lies."""
FALLEN: Final = 'the robot lies on the ground: ALRobotPosture.goToPosture("Stand", 0.5) lets it stand up'
"""Explains why a robot that has fallen does not walk."""
SLACK_LEGS: Final = "the legs are slack: robot.wakeUp lets the robot stand"
"""The warning for a client that lets a robot walk or balance that cannot stand."""
VARIABLE: Final = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)?", re.ASCII)
"""A slot, or one of an object."""
NO_SERVICE: Final = "Cannot find service"
"""Words of the directory of NAOqi in its answer to an unknown name."""
TREE: Final = "tree.u"
"""Builds the standard robot API, when the robot was found."""


class Nao(WiredRobot):
    """A Nao, with its joints, senses and services."""

    slot_words = words.BASE

    uname = "NaoRobot"
    classes = (
        NaoJoint, NaoHand, NaoWalk, NaoLed, NaoSensor, NaoBumper, NaoBattery, NaoFsr, NaoModules, NaoMotorControl,
        NaoSpeaker, NaoMicro, NaoVoice, NaoSpeech, NaoCamera,
    )  # fmt: skip

    parts = (TaughtMotions,)

    robot_name = "nao"
    model_name = "Nao"
    family = "urbihw_nao.driver:NaoDriver"

    services = reading()
    volume = owned(math.nan)
    fallen = reading(NIL)
    othersMoving = reading(False)
    answered = event()

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.motions = TaughtMotions(self, self.robot_name, self.motion, self.log)
        self.joints: dict[str, NaoJoint] = {}
        self.hands: dict[str, NaoHand] = {}
        self._sensors: list[Any] = []
        self._methods: Mapping[str, tuple[str, ...]] = {}
        self._count = 0
        self._moving: set[int] = set()
        self._built = False
        set_range(self.volume, 0.0, 100.0)

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        self._settings = settings
        self.motions.use_folder(settings.motions)
        super().open(settings, opened)

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings, also to the control of the motors.  Raises BadConfig."""
        super().configure(settings)
        self._settings = settings
        if self._built:
            self.motor.configure(settings)

    def summary(self) -> str:
        stiff = sum(joint.load.sensed > 0 for joint in self.joints.values())
        return f"{self.identity.model.sensed}, {stiff} of {len(self.joints)} joints stiff" + self.worker.rate_words()

    # ---------------------------------------------------------------- what is there

    def on_found(self, message: m.Found) -> None:
        """Make the objects at the first connection; after each later one, connect them again."""
        (info,) = message.devices
        self.identity.show(name=info.name, model=info.model, serial=info.serial)
        self.services.sense(list(info.services))
        self._methods = info.methods
        if info.unguarded:
            tell = self.log.warning if WATCHDOG in info.services else self.log.info
            tell("%s: a walk goes on when the connection is lost", info.unguarded)
        else:
            self.log.info("the robot has %s, which stops it when it does not hear us", WATCHDOG)
        if not self._built:
            self._build(info)
            self._connect(info)
            self.build_tree(Path(__file__).with_name(TREE))
            return
        self._connect(info)
        self.walk.halted()
        self.modules.offer_again()
        self.motor.choose_again()
        self.walk.send_steps()
        self.limits.send()

    def _connect(self, info: NaoInfo) -> None:
        """Read the settings of the services again, and follow what was followed before."""
        for each in (self.voice, self.speech, self._volume):
            each.connect(info.services)
        self.camera.connect(info.services)
        self.memory.connect()

    def _build(self, info: NaoInfo) -> None:
        self._built = True
        create, channel, motion = self.host.create, self.channel, self.motion
        for joint in info.joints:
            device = SHARED_MOTORS.get(joint.name, joint.name)
            if joint.name in EFFECTORS:
                hand = create(NaoHand, joint.name, channel, motion, joint, device, self.explain_standing, self._failed)
                self.joints[joint.name] = self.hands[EFFECTORS[joint.name]] = hand
            else:
                self.joints[joint.name] = create(NaoJoint, joint.name, channel, motion, joint, device)
        board = LightBoard(info.leds)
        for name in info.leds:
            create(NaoLed, name, channel, board, name)
        create(NaoSpeaker, "speaker", channel, self.log)
        self.camera = create(NaoCamera, "camera", channel, self.log, self.arrival.is_up)
        self.micro = create(NaoMicro, "micro", channel)
        self.voice = create(NaoVoice, "tts", channel, self.log)
        self.speech = create(NaoSpeech, "speech", channel, self.log)
        self._volume = ServiceSlot(self, self.volume, OUTPUT_VOLUME, channel, self.log)
        self.memory = MemoryLinks(self.host, channel, self.log)
        self.walk = create(NaoWalk, "naoWalk", channel, motion, self.explain_standing)
        self.modules = create(NaoModules, MODULES, channel, self.log)
        self.motor = create(NaoMotorControl, MOTOR, channel, self._settings)
        self._sensors = [create(kind, name, item) for name, (kind, item) in SENSOR_OBJECTS.items()]
        self._sensors += [create(NaoBattery, "battery"), create(NaoFsr, "fsr")]

    def is_complete(self) -> bool:
        return self.has_tree

    @function("jointOrder")
    def joint_order(self) -> list[NaoJoint]:
        """The joints in the order in which the robot tells them (``ALMotion.getBodyNames``)."""
        return list(self.joints.values())

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the joints that have a motor of their own, and walking."""
        if not self._built:
            return {}
        return {name: joint for name, joint in self.joints.items() if name not in SHARED_MOTORS} | {WALK: self.walk}

    def explain_standing(self) -> str:
        """The reason why the robot cannot walk or balance, in words; "" if it may."""
        if not self.arrival.is_up():
            return LINK_DOWN
        if self.fallen.sensed is True:
            return FALLEN
        legs = [joint for name, joint in self.joints.items() if any(part in name for part in LEG_PARTS)]
        return SLACK_LEGS if any(joint.stiffness <= SLACK for joint in legs) else ""

    # ---------------------------------------------------------------- what the worker says

    def on_samples(self, message: m.Samples) -> None:
        if not self._built:
            return
        for device, values in message.values.items():
            stamp = message.times[device] + self.offset
            if device in self.joints:
                self.joints[device].show(values, stamp)
            elif device == SENSOR:
                for sensor in self._sensors:
                    sensor.show(values, stamp)
                self._show_fall(values, stamp)
            elif device == WALK:
                self.walk.show(values, stamp)
                if "others" in values:
                    self.othersMoving.sense(bool(values["others"]), stamp)
            elif device in self.hands:
                self.hands[device].show(values, stamp)
            elif device == CAMERA:
                self.camera.show(values["picture"], stamp)
            elif device == MICRO:
                self.micro.show(values["val"], stamp)
            elif device == MEMORY_VALUES:
                self.memory.show(values, stamp)

    def _show_fall(self, values: Mapping[str, float], stamp: float) -> None:
        """Judge whether the robot lies, by the inclination of its torso; without one, by what NAOqi has told last."""
        angles = [abs(values[item]) for item in ("angleX", "angleY") if item in values]
        if angles:
            fallen = max(angles) > LYING
        elif "hasFallen" in values:
            fallen = bool(values["hasFallen"])
        else:
            return
        if fallen is not self.fallen.sensed:
            if fallen:
                self.log.warning("%s", FALLEN)
            elif self.fallen.sensed is True:
                self.log.info("the robot is upright again")
            self.fallen.sense(fallen, stamp)
            self.report.show_part("robot", FALLEN if fallen else "")

    def on_happened(self, message: m.DeviceReport) -> None:
        """Handle an event of ALMemory, or a call of a module."""
        if message.device == MODULE:
            self.modules.handle(message)
            return
        if message.device == CAMERA and message.what == LOST:
            self.camera.lost(str(message.value))
            return
        if message.what == WORD_EVENT:
            self.speech.show(message.value)
        self.memory.emit(message.what, message.value)

    def on_refused(self, message: m.Refused) -> None:
        if message.device == MOTORS and self._built:
            self.motor.was_refused(message)
        if message.device == WALK and self.has_tree:
            self.walk.halted()
            self.call("robot.mobility", "fail", message.reason)

    def on_link_down(self, reason: str) -> None:
        if self._built:
            self.walk.lose()
            self.modules.cancel_all()
            self.fallen.sense(NIL)
            for device in (*self.joints.values(), *self._sensors):
                device.mark_stale()
        if self.has_tree:
            # It walks on, but will be stopped when the link is back: no speed is kept.
            self.send("robot.mobility.lose;")

    def on_halt(self, reason: str, devices: tuple[Hashable, ...] | None = None) -> None:
        if self._built and (devices is None or WALK in devices):
            self.walk.halted()
        if devices is None or SERVICES in devices:
            # Whatever the robot answers, and whenever.
            moving, self._moving = self._moving, set()
            for number in sorted(moving):
                self.answered.emit(float(number), [], reason)

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def methods(self, service: str) -> list[str]:
        """The methods of a service that is known from the start, with their old names; an empty list for others."""
        return with_old_names(service, self._methods.get(service, ()))

    @function("knownService")
    def known_service(self, name: str) -> list[Any]:
        """The name, given with or without the AL, and the methods of a service that is known from the start.

        An empty list for others.
        """
        return next(([each, self.methods(each)] for each in _service_names(name) if each in self._methods), [])

    @function("findService")
    def find_service(self, name: str) -> int:
        """Ask for the name, given with or without the AL, and the methods of a service.

        ``answered`` then has this number, [[name, methods]] or an empty list if there is none, and why.
        """
        number, names = self._next(), _service_names(name)

        def describe(service: str, *others: str) -> None:
            def answered(reply: m.Reply) -> None:
                if reply.ok:
                    self.answered.emit(float(number), [[service, list(reply.value)]], "")
                elif NO_SERVICE not in reply.error:
                    self.answered.emit(float(number), [], reply.error)
                elif others:
                    describe(*others)
                else:
                    self.answered.emit(float(number), [], f"this robot has no service {', and no '.join(names)}")

            self.channel.send_request("describe", service, answered)

        describe(*names)
        return number

    @function("callService")
    def call_service(self, service: str, method: str, arguments: list[Any]) -> int:
        """Call a method of a service of NAOqi; ``answered`` then has this number, the result in a list, which is empty
        if there is none, and the error.

        A stop ends the call of a method that may move the robot: ``answered`` tells so, and the answer is dropped.
        """
        number = self._next()
        method, values = find_new_name(service, method, arguments, self._methods.get(service, ()))
        answered = self._answer(number)
        if not may_move(service, method):
            self.channel.call(service, method, values, answered)
            return number
        origin = self.motion.admit(SERVICES)

        def ended(reply: m.Reply) -> None:
            if number in self._moving:
                self._moving.discard(number)
                answered(reply)

        self.channel.call(service, method, values, ended, origin)
        self._moving.add(number)
        return number

    @function("mayMove")
    def may_move(self, service: str, method: str) -> bool:
        """Whether a method may move the robot."""
        return may_move(service, method)

    @function
    def listen(self, key: str) -> int:
        """Listen to an event of ALMemory, for the Event of ``eventSlot``.  ``answered`` as above."""
        number = self._next()
        self.memory.listen(key, self._answer(number))
        return number

    @function("eventSlot")
    def event_slot(self, key: str) -> str:
        """The slot of ``memoryEvents`` with the Event of an event that is listened to."""
        return self.memory.event_slot(key)

    @function("memoryPath")
    def memory_path(self, key: Any, name: Any) -> str:
        """The path "object.slot" of a variable for a place of ALMemory: "b" stands for "stm.b".

        "" for unknown names.
        """
        if not (isinstance(key, str) and key and isinstance(name, str) and VARIABLE.fullmatch(name)):
            return ""
        return name if "." in name else f"stm.{name}"

    @function("bindMemory")
    def bind_memory(self, key: str, path: str) -> int:
        """Let the variable ``path`` follow a place of ALMemory; it cannot be written.  ``answered`` as above."""
        number = self._next()
        self.memory.bind(key, path, self._answer(number))
        return number

    def _next(self) -> int:
        if not self.arrival.is_up():
            raise ValueError(LINK_DOWN)
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


def _service_names(name: str) -> list[str]:
    """The names that a program can mean."""
    plain = name.removeprefix("AL")
    return [f"AL{plain}", plain]
