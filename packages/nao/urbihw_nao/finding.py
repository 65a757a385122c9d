"""What there is on a robot: its joints, services, lights and sensors."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import field
from typing import Any, Final

from urbihw.buses.errors import BadFrame, Unavailable
from urbihw.frozen import frozen
from urbihw_nao import reading
from urbihw_nao.orders import JointInfo
from urbihw_nao.qimessaging.checked import is_name, show_text, to_number, to_row
from urbihw_nao.qimessaging.session import QiCall, QiService, QiSession

MOTION, MEMORY, LEDS, SONAR = "ALMotion", "ALMemory", "ALLeds", "ALSonar"
PROXIES: Final = (
    MOTION, MEMORY, LEDS, SONAR, "ALRobotPosture", "ALTextToSpeech", "ALBattery", "ALBehaviorManager", "ALAudioPlayer",
    "ALSpeechRecognition", "ALAudioDevice", "ALLogger", "ALFrameManager", "ALAutonomousLife", "DCM",
)  # fmt: skip
"""Services that programs may call without asking for them."""
JOINTS: Final = (
    "HeadYaw", "HeadPitch",
    "LShoulderPitch", "LShoulderRoll", "LElbowYaw", "LElbowRoll", "LWristYaw", "LHand",
    "LHipYawPitch", "LHipRoll", "LHipPitch", "LKneePitch", "LAnklePitch", "LAnkleRoll",
    "RHipYawPitch", "RHipRoll", "RHipPitch", "RKneePitch", "RAnklePitch", "RAnkleRoll",
    "RShoulderPitch", "RShoulderRoll", "RElbowYaw", "RElbowRoll", "RWristYaw", "RHand",
)  # fmt: skip
"""The joints of an H25, in the order of ``getLimits("Body")``."""
_NAME: Final = "urbihw"
BODY_NAME: Final = "Device/DeviceList/ChestBoard/BodyNickName"
BODY_ID: Final = "Device/DeviceList/ChestBoard/BodyId"
MAX_TEXT_LENGTH: Final = 100


@frozen
class NaoInfo:
    """The robot as ``Found`` tells of it; ``methods`` are those of the services in ``PROXIES``, ``leds`` the lights and
    groups with their actuators, none where the robot does not tell them; ``unguarded`` is why ``watchdog.py`` does not
    stop it when it does not hear us, "" if it does."""

    model: str
    joints: tuple[JointInfo, ...]
    services: tuple[str, ...]
    leds: Mapping[str, tuple[str, ...]]
    methods: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    name: str = ""
    serial: str = ""
    unguarded: str = ""


@frozen
class NaoFinding:
    """What was found: the robot, the keys of each cycle, all keys that it has, and their first values."""

    info: NaoInfo
    fast_keys: Mapping[str, reading.Key]
    all_keys: Mapping[str, reading.Key]
    values: list[Any]


def find(session: QiSession, motion: QiService, memory: QiService) -> NaoFinding:
    """Ask for everything, and switch the sonars on.  Raises Unavailable, BadValue, LinkGone."""

    def ask(service: QiService, name: str, *arguments: Any) -> Any:
        return session.wait(session.call(service, name, *arguments))

    joints = _joints(motion, memory, ask)
    names = [joint.name for joint in joints]
    services = tuple(session.names())
    lights = _lights(session) if LEDS in services else {}
    if SONAR in services:
        # Without a subscriber the sonars measure nothing.
        session.post(session.look_up(SONAR), "subscribe", _NAME)
    methods = {name: tuple(session.look_up(name).meta.names()) for name in PROXIES if name in services}
    model = _model(ask(motion, "getRobotConfig") if "getRobotConfig" in motion.meta.names() else None)
    name, serial = map(_text, to_row(ask(memory, "getListData", [BODY_NAME, BODY_ID]), 2)[:2])
    info = NaoInfo(model, joints, services, lights, methods, name, serial)
    fast = reading.joint_keys(names)
    keys = fast | reading.slow_keys(names)
    values = list(to_row(ask(memory, "getListData", list(keys))))
    known = reading.known_keys(keys, values)
    return NaoFinding(info, fast, known, [value for name, value in zip(keys, values, strict=True) if name in known])


def _lights(session: QiSession) -> dict[str, tuple[str, ...]]:
    """The groups of lights and the single lights by their names, with their actuators.

    All questions are on their way at the same time: there are more than a hundred lights.
    """
    service = session.look_up(LEDS)
    found: dict[str, tuple[str, ...]] = {}
    for names, members in (("listGroups", "listGroup"), ("listLEDs", "listLED")):
        told = to_row(session.wait(session.call(service, names)))
        lights = [name for name in told if is_name(name) and name.isidentifier() and name not in found]
        tells = members in service.meta.names()
        calls = {name: session.call(service, members, name) if tells else None for name in lights}
        for name, call in calls.items():
            found[name] = _actuators(session, call)
    return found


def _actuators(session: QiSession, call: QiCall | None) -> tuple[str, ...]:
    """The answer to the question for the actuators of a light; () where the robot has none, or one of another form."""
    if call is None:
        return ()
    try:
        row = to_row(session.wait(call))
    except (Unavailable, BadFrame):
        return ()
    return tuple(sys.intern(name) for name in row if isinstance(name, str) and is_name(name))


def _joints(motion: QiService, memory: QiService, ask: Callable[..., Any]) -> tuple[JointInfo, ...]:
    """The joints; those of a robot without ``getBodyNames``, such as an emulator, have the name by which it tells their
    angles."""
    told = {*motion.meta.names()}
    method = next((method for method in ("getBodyNames", "getJointNames") if method in told), "")
    if method:
        names = [_joint_name(name) for name in to_row(ask(motion, method, "Body"), 1)]
    else:
        places = [f"{reading.PREFIX}{name}/Position/Sensor/Value" for name in JOINTS]
        angles = to_row(ask(memory, "getListData", places), len(JOINTS))
        names = [name for name, angle in zip(JOINTS, angles, strict=False) if isinstance(angle, float)]
    limits = [to_row(row, 3)[:3] for row in to_row(ask(motion, "getLimits", "Body"))]
    return tuple(JointInfo(name, *map(to_number, row)) for name, row in zip(names, limits, strict=True))


def _joint_name(value: Any) -> str:
    """The name of a joint in a key.  Raises BadFrame."""
    if not is_name(value) or not value.isidentifier():
        raise BadFrame(f"a joint is called {show_text(repr(value), MAX_TEXT_LENGTH)}")
    return str(value)


def _text(value: Any) -> str:
    """A text of the robot in one line; "" where it has none."""
    return show_text(" ".join(value.split()), MAX_TEXT_LENGTH) if isinstance(value, str) else ""


def _model(config: Any) -> str:
    """The "Model Type" of getRobotConfig, whose two lists are names and values."""
    try:
        names, values = config
        return _text(dict(zip(names, values, strict=True)).get("Model Type")) or "nao"
    except (TypeError, ValueError):
        return "nao"
