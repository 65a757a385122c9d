"""ALMemory, DCM, ALLeds, ALBattery, ALSonar and ALTextToSpeech."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

from urbihw_fakes.nao.body import Body, Joint
from urbihw_fakes.nao.services import Failed, Later, Service, as_list

PREFIX = "Device/SubDeviceList/"
WORDS_A_SECOND = 2.5
TOUCHES = (
    "Head/Touch/Front", "Head/Touch/Middle", "Head/Touch/Rear", "LFoot/Bumper/Left", "LFoot/Bumper/Right",
    "RFoot/Bumper/Left", "RFoot/Bumper/Right", "ChestBoard/Button",
)  # fmt: skip
WEIGHT = 5.2


class Memory:
    """ALMemory: what others have put into it, and what the robot measures; events by name."""

    def __init__(self, body: Body, raised: Callable[[str, Any], None], subscriber: Callable[[str], Any]) -> None:
        self.body, self._raised = body, raised
        self.stored: dict[str, Any] = {"RobotConfig/Body/Type": "nao"}
        self.subscribed_sonars: set[str] = set()
        self._measured = self._table()
        service = self.service = Service("ALMemory")
        service.add("m", "getData", "(s)", self._get)
        service.add("m", "getListData", "(m)", lambda keys: [self._look(key) for key in keys])
        service.add("v", "insertData", "(sm)", self.stored.__setitem__)
        service.add("v", "raiseEvent", "(sm)", self.raise_event)
        service.add("v", "raiseMicroEvent", "(sm)", self.raise_event)
        service.add("[s]", "getDataListName", "()", lambda: sorted({*self.stored, *self._measured}))
        service.add("o", "subscriber", "(s)", subscriber)

    def raise_event(self, key: str, value: Any) -> None:
        """Something happened."""
        self.stored[key] = value
        self._raised(key, value)

    def touch(self, name: str, value: float) -> None:
        """Somebody touches the robot, or no longer: a sensor, or the event of one."""
        self.body.touched[name] = value
        events = {"Head/Touch/Front": "FrontTactilTouched", "Head/Touch/Middle": "MiddleTactilTouched",
                  "Head/Touch/Rear": "RearTactilTouched"}  # fmt: skip
        if name in events:
            self.raise_event(events[name], value)

    def _get(self, key: str) -> Any:
        found = self._look(key)
        if found is None:
            raise Failed(f"ALMemory: data {key} not found\n\n    at almemory.cpp:17")
        return found

    def _look(self, key: str) -> Any:
        measure = self._measured.get(key)
        return self.stored.get(key) if measure is None else measure()

    def _table(self) -> dict[str, Callable[[], Any]]:
        body = self.body
        found: dict[str, Callable[[], Any]] = {}

        def sensor(name: str, measure: Callable[[], Any]) -> None:
            found[f"{PREFIX}{name}/Sensor/Value"] = measure

        def set_to(value: float) -> Callable[[], float]:
            return lambda: 0.0 if body.fallen else value

        for name, joint in body.joints.items():
            sensor(f"{name}/Position", partial(getattr, joint, "angle"))
            sensor(f"{name}/Temperature", partial(_warmth, joint))
            sensor(f"{name}/ElectricCurrent", partial(_current, joint))
            found[f"{PREFIX}{name}/Position/Actuator/Value"] = partial(getattr, joint, "command")
            found[f"{PREFIX}{name}/Hardness/Actuator/Value"] = partial(getattr, joint, "stiffness")
        for touch in TOUCHES:
            sensor(touch, partial(body.touched.get, touch, 0.0))
        # Without a subscriber ALSonar measures nothing, and memory keeps the last value.
        sensor("US/Left", lambda: body.sonars[0] if self.subscribed_sonars else 0.0)
        sensor("US/Right", lambda: body.sonars[1] if self.subscribed_sonars else 0.0)
        for axis, value in zip("XYZ", (0.1, 0.0, 9.8), strict=True):
            sensor(f"InertialSensor/Accelerometer{axis}", set_to(value))
        sensor("InertialSensor/GyroscopeX", lambda: 0.0)
        sensor("InertialSensor/GyroscopeY", lambda: 0.0)
        sensor("InertialSensor/GyroscopeZ", lambda: body.walk[2])
        sensor("InertialSensor/AngleX", lambda: 0.0)
        sensor("InertialSensor/AngleY", lambda: -math.pi / 2 if body.fallen else 0.0)
        sensor("Battery/Charge", lambda: body.charge)
        sensor("Battery/Current", lambda: 0.5 if body.plugged_in else -0.8)
        sensor("Battery/Temperature", lambda: 31.0)
        for foot in ("LFoot", "RFoot"):
            sensor(f"{foot}/FSR/TotalWeight", set_to(WEIGHT / 2))
        found["footContact"] = lambda: 0.0 if body.fallen else 1.0
        found["leftFootContact"] = found["rightFootContact"] = found["footContact"]
        return found


def _warmth(joint: Joint) -> float:
    return 30.0 + 8 * joint.stiffness


def _current(joint: Joint) -> float:
    return 0.1 * joint.stiffness


def leds(table: dict[str, int]) -> Service:
    """ALLeds; ``table`` gets what was written, as 0xRRGGBB."""
    groups = {"AllLeds", "FaceLeds", "LeftFaceLeds", "RightFaceLeds", "ChestLeds", "FeetLeds", "LeftFootLeds",
              "RightFootLeds", "EarLeds", "LeftEarLeds", "RightEarLeds", "BrainLeds"}  # fmt: skip
    single = {f"FaceLed{side}{index}" for side in ("Left", "Right") for index in range(8)}
    single |= {f"FaceLed{index}" for index in range(8)} | {f"Brain{index}" for index in range(12)}

    def known(name: str) -> str:
        if name not in groups | single:
            raise Failed(f"ALLeds: no such led or group {name}")
        return name

    def colour(name: str, rgb: int, _: float) -> None:
        table[known(name)] = rgb & 0xFFFFFF

    def dim(name: str, value: float) -> None:
        table[known(name)] = round(min(max(value, 0.0), 1.0) * 255) * 0x010101

    made = Service("ALLeds")
    made.add("v", "fadeRGB", "(sif)", colour)
    made.add("v", "setIntensity", "(sf)", dim)
    made.add("v", "on", "(s)", lambda name: dim(name, 1.0))
    made.add("v", "off", "(s)", lambda name: dim(name, 0.0))
    made.add("[s]", "listGroups", "()", lambda: sorted(groups))
    made.add("[s]", "listLEDs", "()", lambda: sorted(single))
    return made


class Voice:
    """ALTextToSpeech: what it has said, and what it is saying."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self.said: list[str] = []
        self.cut_short: list[str] = []
        self.volume, self.language = 0.7, "English"
        self._clock = clock
        self._ends = -math.inf
        service = self.service = Service("ALTextToSpeech")
        service.add("v", "say", "(s)", self._say)
        service.add("v", "say", "(ss)", lambda text, language: self._say(text))
        service.add("v", "stopAll", "()", self._stop)
        service.add("v", "setVolume", "(f)", lambda value: setattr(self, "volume", value))
        service.add("f", "getVolume", "()", lambda: self.volume)
        service.add("v", "setLanguage", "(s)", self._speak)
        service.add("s", "getLanguage", "()", lambda: self.language)
        service.add("[s]", "getAvailableLanguages", "()", lambda: ["English", "French"])

    def _say(self, text: str) -> Later:
        self.said.append(text)
        self._ends = max(self._ends, self._clock()) + len(text.split()) / WORDS_A_SECOND
        end = self._ends
        return Later(lambda: self._clock() >= min(end, self._ends))

    def _stop(self) -> None:
        if self._ends > self._clock():
            self.cut_short.append(self.said[-1])
        self._ends = self._clock()

    def _speak(self, language: str) -> None:
        if language not in ("English", "French"):
            raise Failed(f"ALTextToSpeech: the language {language} is not installed")
        self.language = language


def simple(body: Body, memory: Memory, clock: Callable[[], float]) -> list[Service]:
    """ALBattery, ALSonar and DCM."""
    battery, sonar, dcm = Service("ALBattery"), Service("ALSonar"), Service("DCM")
    battery.add("i", "getBatteryCharge", "()", lambda: round(body.charge * 100))
    sonar.add("v", "subscribe", "(s)", memory.subscribed_sonars.add)
    sonar.add("v", "unsubscribe", "(s)", memory.subscribed_sonars.discard)

    def write(command: Any) -> None:
        """[key, update, [[value, time] ...]]: the last value; times are not waited for."""
        key, _, points = command
        for name in as_list(key):
            joint, _, what = name.removeprefix(PREFIX).partition("/")
            if joint not in body.joints:
                raise Failed(f"DCM: unknown actuator {name}")
            if what.startswith("Hardness"):
                body.joints[joint].stiffness = float(points[-1][0])
            else:
                body.joints[joint].order(float(points[-1][0]), 1.0)

    dcm.add("i", "getTime", "(i)", lambda offset: round(clock() * 1000) % (1 << 31) + offset)
    dcm.add("v", "set", "(m)", write)
    return [battery, sonar, dcm]
