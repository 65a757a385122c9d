"""ALMemory: data, what the robot measures, and events by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from urbihw_nao_fakes.body import Body, Joint
from urbihw_nao_fakes.services import Failed, Service, Signal, as_list, method

PREFIX = "Device/SubDeviceList/"
TOUCHES = (
    "Head/Touch/Front", "Head/Touch/Middle", "Head/Touch/Rear", "LFoot/Bumper/Left", "LFoot/Bumper/Right",
    "RFoot/Bumper/Left", "RFoot/Bumper/Right", "ChestBoard/Button",
)  # fmt: skip
TOUCH_EVENTS = {
    "Head/Touch/Front": "FrontTactilTouched",
    "Head/Touch/Middle": "MiddleTactilTouched",
    "Head/Touch/Rear": "RearTactilTouched",
}
FEET = ("LFoot", "RFoot")
CELLS = {
    "LFoot": ((0.07025, 0.0299), (0.07025, -0.0231), (-0.03025, 0.0299), (-0.02965, -0.0191)),
    "RFoot": ((0.07025, 0.0231), (0.07025, -0.0299), (-0.03025, 0.0191), (-0.02965, -0.0299)),
}
"""Places of a foot's sensors of force from its ankle, ahead and left, m: front left, front right, rear left, rear right
(the maker's page "FSRs")."""
CELL_NAMES = ("FrontLeft", "FrontRight", "RearLeft", "RearRight")
CONTACT = 0.1
"""kg under a foot that touches."""
Measure = Callable[[], Any]
CallService = Callable[[str, str, tuple[Any, ...]], None]
"""Calls a method of a client's service: their names, and the values."""


class Subscriber(Service):
    """The object that `subscriber` returns: one for each event."""

    name = "subscriber"
    raised = Signal("signal", "(m)")


class Memory(Service):
    """ALMemory.

    Attributes:
        stored: what others have put into it.
        measured: what has a value of its own at any time, by key.
        sonars: who has subscribed to ALSonar; without anybody it measures nothing.
    """

    name = "ALMemory"

    def __init__(self, body: Body, call_service: CallService) -> None:
        super().__init__()
        self.body = body
        self.stored: dict[str, Any] = {
            "RobotConfig/Body/Type": "nao",
            "Device/DeviceList/ChestBoard/BodyNickName": "fake",
            "Device/DeviceList/ChestBoard/BodyId": "ALDT000000000001",
        }
        self.sonars: set[str] = set()
        self.measured = {
            **_measure_joints(body), **_measure_inertia(body), **_measure_feet(body), **self._measure_others(),
        }  # fmt: skip
        self._subscribers: dict[str, Subscriber] = {}
        self._modules: dict[tuple[str, str], tuple[str, str]] = {}
        self._call_service = call_service

    # ---------------------------------------------------------------- data

    @method("getData", "(s)", "m")
    def get_data(self, key: str) -> Any:
        """The value of a key.  Raises Failed."""
        found = self._look_up(key)
        if found is None:
            raise Failed(f"ALMemory: data {key} not found\n\n    at almemory.cpp:17")
        return found

    @method("getListData", "(m)", "m")
    def get_list_data(self, keys: Any) -> list[Any]:
        """The values of several keys, None for one that is not there."""
        return [self._look_up(key) for key in as_list(keys)]

    @method("insertData", "(sm)")
    def insert_data(self, key: str, value: Any) -> None:
        """Store a value; no event."""
        self.stored[key] = value

    @method("getDataListName", "()", "[s]")
    def get_keys(self) -> list[str]:
        """The names of all keys."""
        return sorted({*self.stored, *self.measured})

    def _look_up(self, key: Any) -> Any:
        if not isinstance(key, str):
            raise Failed("ALMemory: a key must be a string\n\n    at almemory.cpp:21")
        measure = self.measured.get(key)
        return self.stored.get(key) if measure is None else measure()

    # ---------------------------------------------------------------- events

    @method("raiseEvent", "(sm)")
    @method("raiseMicroEvent", "(sm)")
    def raise_event(self, key: str, value: Any) -> None:
        """Store a value, and tell it to all that have subscribed to the event."""
        self.stored[key] = value
        if key in self._subscribers:
            self._subscribers[key].emit(Subscriber.raised, value)
        for (event, module), (called, message) in list(self._modules.items()):
            if event == key:
                self._call_service(module, called, (key, value, message))

    @method("subscriber", "(s)", "o")
    def get_subscriber(self, key: str) -> Any:
        """The object with the signal of an event."""
        if key not in self._subscribers:
            self._subscribers[key] = Subscriber()
            self.add_object(self._subscribers[key])
        return self._subscribers[key].reference()

    @method("subscribeToEvent", "(sss)")
    def subscribe_module(self, key: str, module: str, called: str) -> None:
        """Call a method of a client's service, with the event's name, its value, and a text."""
        self._modules[key, module] = called, ""

    @method("subscribeToEvent", "(ssss)")
    @method("subscribeToMicroEvent", "(ssss)")
    def subscribe_module_with_text(self, key: str, module: str, message: str, called: str) -> None:
        """The same, with the text of the subscriber."""
        self._modules[key, module] = called, message

    @method("unsubscribeToEvent", "(ss)")
    @method("unsubscribeToMicroEvent", "(ss)")
    def unsubscribe_module(self, key: str, module: str) -> None:
        """End the subscription of a module."""
        self._modules.pop((key, module), None)

    def touch(self, name: str, value: float) -> None:
        """Somebody touches the robot (1), or no longer (0): a sensor, and its event if it has one."""
        self.body.touched[name] = value
        if name in TOUCH_EVENTS:
            self.raise_event(TOUCH_EVENTS[name], value)

    # ---------------------------------------------------------------- what is measured

    def _measure_others(self) -> dict[str, Measure]:
        body = self.body
        sensors: dict[str, Measure] = {
            # Without a subscriber ALSonar measures nothing, and memory keeps the last value.
            "US/Left": lambda: body.sonars[0] if self.sonars else 0.0,
            "US/Right": lambda: body.sonars[1] if self.sonars else 0.0,
            "Battery/Charge": lambda: body.charge,
            "Battery/Current": lambda: 0.5 if body.plugged_in else -0.8,
            "Battery/Temperature": lambda: 31.0,
        }
        sensors.update({touch: partial(body.touched.get, touch, 0.0) for touch in TOUCHES})
        found = _sensor_keys(sensors)
        found["footContact"] = lambda: float(any(_total(body, foot) > CONTACT for foot in FEET))
        found["leftFootContact"] = lambda: float(_total(body, "LFoot") > CONTACT)
        found["rightFootContact"] = lambda: float(_total(body, "RFoot") > CONTACT)
        return found


def _sensor_keys(sensors: dict[str, Measure]) -> dict[str, Measure]:
    return {f"{PREFIX}{name}/Sensor/Value": measure for name, measure in sensors.items()}


def _measure_joints(body: Body) -> dict[str, Measure]:
    found: dict[str, Measure] = {}
    sensors: dict[str, Measure] = {}
    for name, joint in body.joints.items():
        sensors[f"{name}/Position"] = partial(getattr, joint, "angle")
        sensors[f"{name}/Temperature"] = partial(_temperature, joint)
        sensors[f"{name}/ElectricCurrent"] = partial(_current, joint)
        found[f"{PREFIX}{name}/Position/Actuator/Value"] = partial(getattr, joint, "command")
        found[f"{PREFIX}{name}/Hardness/Actuator/Value"] = partial(getattr, joint, "stiffness")
    return {**_sensor_keys(sensors), **found}


def _measure_inertia(body: Body) -> dict[str, Measure]:
    sensors: dict[str, Measure] = {
        "AccelerometerX": lambda: body.feeling.acceleration[0],
        "AccelerometerY": lambda: body.feeling.acceleration[1],
        "AccelerometerZ": lambda: body.feeling.acceleration[2],
        "GyroscopeX": lambda: body.feeling.turning[0],
        "GyroscopeY": lambda: body.feeling.turning[1],
        "GyroscopeZ": lambda: body.feeling.turning[2],
        "AngleX": lambda: body.feeling.lean[0],
        "AngleY": lambda: body.feeling.lean[1],
    }
    return _sensor_keys({f"InertialSensor/{name}": measure for name, measure in sensors.items()})


def _measure_feet(body: Body) -> dict[str, Measure]:
    sensors: dict[str, Measure] = {}
    for foot in FEET:
        for index, cell in enumerate(CELL_NAMES):
            sensors[f"{foot}/FSR/{cell}"] = partial(_cell, body, foot, index)
        sensors[f"{foot}/FSR/TotalWeight"] = partial(_total, body, foot)
        for axis, name in enumerate("XY"):
            sensors[f"{foot}/FSR/CenterOfPressure/{name}"] = partial(_pressure, body, foot, axis)
    return _sensor_keys(sensors)


def _cell(body: Body, foot: str, index: int) -> float:
    return body.feeling.weights[foot][index]


def _total(body: Body, foot: str) -> float:
    return sum(body.feeling.weights[foot])


def _pressure(body: Body, foot: str, axis: int) -> float:
    """Where the weight is on a foot, from its ankle, m; 0 without any."""
    weights = body.feeling.weights[foot]
    total = sum(weights)
    places = (cell[axis] for cell in CELLS[foot])
    return sum(weight * place for weight, place in zip(weights, places, strict=True)) / total if total > 0.0 else 0.0


def _temperature(joint: Joint) -> float:
    return 30.0 + 8 * joint.stiffness


def _current(joint: Joint) -> float:
    return 0.1 * joint.stiffness
