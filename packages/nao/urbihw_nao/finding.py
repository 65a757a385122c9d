"""What there is on a robot: its joints, services, lights and sensors."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from urbihw.buses.errors import BadFrame
from urbihw_nao import reading
from urbihw_nao.orders import JointInfo
from urbihw_nao.qimessaging.checked import is_name, show_text, to_number, to_row
from urbihw_nao.qimessaging.session import QiService, QiSession

MOTION, MEMORY, LEDS, SONAR = "ALMotion", "ALMemory", "ALLeds", "ALSonar"
PROXIES: Final = (
    MOTION, MEMORY, LEDS, SONAR, "ALRobotPosture", "ALTextToSpeech", "ALBattery", "ALBehaviorManager", "ALAudioPlayer",
    "ALSpeechRecognition", "ALAudioDevice", "ALLogger", "ALFrameManager", "ALAutonomousLife", "DCM",
)  # fmt: skip
"""Services that programs may call without asking for them."""
_NAME: Final = "urbihw"
BODY_NAME: Final = "Device/DeviceList/ChestBoard/BodyNickName"
BODY_ID: Final = "Device/DeviceList/ChestBoard/BodyId"
MAX_TEXT_LENGTH: Final = 100


@dataclass(frozen=True, slots=True)
class NaoInfo:
    """The robot as ``Found`` tells of it; ``methods`` are those of the services in ``PROXIES``."""

    model: str
    joints: tuple[JointInfo, ...]
    services: tuple[str, ...]
    leds: tuple[str, ...]
    methods: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    name: str = ""
    serial: str = ""


@dataclass(frozen=True, slots=True)
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

    names = [_joint_name(name) for name in to_row(ask(motion, "getBodyNames", "Body"), 1)]
    limits = [to_row(row, 3)[:3] for row in to_row(ask(motion, "getLimits", "Body"))]
    joints = tuple(JointInfo(name, *map(to_number, row)) for name, row in zip(names, limits, strict=True))
    services = tuple(session.names())
    lights: list[str] = []
    if LEDS in services:
        for method in ("listGroups", "listLEDs"):
            names_of_lights = to_row(ask(session.look_up(LEDS), method))
            lights += [name for name in names_of_lights if is_name(name) and name.isidentifier()]
    if SONAR in services:
        # Without a subscriber the sonars measure nothing.
        session.post(session.look_up(SONAR), "subscribe", _NAME)
    methods = {name: tuple(session.look_up(name).meta.names()) for name in PROXIES if name in services}
    model = _model(ask(motion, "getRobotConfig"))
    name, serial = map(_text, to_row(ask(memory, "getListData", [BODY_NAME, BODY_ID]), 2)[:2])
    info = NaoInfo(model, joints, services, tuple(dict.fromkeys(lights)), methods, name, serial)
    fast = reading.joint_keys(names)
    keys = fast | reading.slow_keys(names)
    values = list(to_row(ask(memory, "getListData", list(keys))))
    known = reading.known_keys(keys, values)
    return NaoFinding(info, fast, known, [value for name, value in zip(keys, values, strict=True) if name in known])


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
