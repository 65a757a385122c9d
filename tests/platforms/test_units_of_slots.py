"""The unit of every slot that is a number, on all robots, against a table that was typed from their documents.

Sources: the manual's chapters 22 ("Interface") and 23 to 29 (the robots), and, for slots that the manual does not have,
the pages ``urbihw/platforms/*/README.md``.  "1" is a number without unit.
"""

from __future__ import annotations

import importlib
from typing import Final, NamedTuple

import pytest
from bioloid_lab import BAUD
from bioloid_lab import Lab as Bioloid
from lab import RobotLab
from nxt_lab import Lab as Nxt

from urbihw.kernel.stdlib.device_slots import Row
from urbihw.kernel.stdlib.documentation import Docstrings
from urbihw.kernel.uobject.uobject import UObjectFace
from urbihw.platforms import folders
from urbihw_fakes.bioloid import Bioloid as Kit

Units = dict[str, str]
"""Unit -> the slots that have it."""

# Chapter 22.
_GAINS: Final = "PGain IGain DGain "
_BATTERY: Final[Units] = {"ratio": "remain", "V": "voltage", "A": "current", "A h": "capacity"}
_PICTURE: Final[Units] = {"pixel": "width height", "rad": "xfov yfov", "s": "exposure"}
_MOBILE: Final[Units] = {
    "m/s": "xSpeed ySpeed zSpeed defaultXSpeed defaultYSpeed defaultZSpeed",
    "rad/s": "yawSpeed pitchSpeed rollSpeed defaultYawSpeed defaultPitchSpeed defaultRollSpeed",
    "s": "watchdogInterval",
}
# docs/teach.md.
_TAUGHT: Final[Units] = {"rad/s": "blendSpeed"}
# docs/operations.md and docs/safety.md: what every robot tells of itself.
_BUS: Final[Units] = {"Hz": "rate", "ratio": "busLoad", "1": "epoch stops"}
# docs/navigation.md.
_ODOMETRY: Final[Units] = {"m": "x y z coveredDistance", "rad": "yaw coveredAngle", "m, rad": "position"}
_PLANNER: Final[Units] = {"m": "path walls", "m/s": "speed", "rad/s": "turnSpeed", "1": "score"}
# The manual's Bioloid chapter, and the control tables of the makers.
_ON_BUS: Final[Units] = {
    "V": "voltage minVoltage maxVoltage",
    "degC": "temperature temperatureLimit",
    "bit/s": "baudRate",
    "s": "age returnDelay",
}
_SERVO: Final[Units] = _ON_BUS | {"rad/s": "speed", "turn": "turn"}
_ANGLES: Final = "val angle cwLimit ccwLimit requested applied "
_NUMBERS: Final = _GAINS + "id model firmware load shutdown "
_AX: Final[Units] = _SERVO | {
    "rad": _ANGLES + "cwComplianceMargin ccwComplianceMargin",
    "N m": "torque torqueLimit maxTorque punch",
    "1": _NUMBERS + "cwComplianceSlope ccwComplianceSlope led lock alarmLed statusReturnLevel",
}
# Feetech tells torques as a share of the stall torque.
_STS: Final[Units] = _SERVO | {
    "rad": _ANGLES + "homingOffset",
    "rad/s^2": "acceleration",
    "A": "current",
    "1": _NUMBERS + "alarmLed lock pGain iGain dGain velocityPGain velocityIGain goalPwm"
    " torque torqueLimit maxTorque punch",
}
# A touch sensor is 0 or 1 for a button, or Pa (chapter 22); those of these robots are buttons.
_BUTTON: Final[Units] = {"1": "val pressure"}
_NXT_SENSOR: Final[Units] = {"1": "port raw", "s": "age"}
_NAO_MOTOR: Final[Units] = {"N m": "torque", "degC": "temperature", "1": _GAINS}

UNITS: Final[dict[str, dict[str, Units]]] = {
    "nxt": {
        "Nxt": _BUS | {"m": "wheelRadius track", "rad/s": "fullSpeed"},
        "Servo": {  # val in degrees: chapter 24, "Servo"
            "deg": "val", "rad": "angle", "turn": "turn", "%": "speed requested applied", "N m": "torque",
            "s": "age", "1": _GAINS,
        },
        "SoundSensor": _NXT_SENSOR | {"ratio": "val"},
        "LightSensor": _NXT_SENSOR | {"ratio": "val"},
        "UltraSonicSensor": {"cm": "val", "m": "distance", "s": "age", "1": "port"},
        "Switch": {"1": "port raw val pressure", "s": "age"},
        "Battery": _BATTERY | {"ratio": "val remain"},
        "NxtOdometry": _ODOMETRY,
        "NxtPlanner": _PLANNER,
        "robot": _MOBILE,
    },
    "bioloid": {
        "Bioloid": _BUS,
        "robot": _TAUGHT,
        "AX12": _AX,
        "AXS1": _ON_BUS | {
            "1": "IRLeft IRCenter IRRight lightLeft lightCenter lightRight lightThreshold lightThresholdDefault"
            " obstacleThreshold obstacleThresholdDefault buzzerIndex clapCount remocon"
            " id model firmware lock statusReturnLevel",
            "ratio": "soundVolume soundVolumeMax",
            "s": "age returnDelay buzzerTime soundTime",
        },
    },
    "segway": {
        "Segway": _BUS | {"1": "epoch stops build"},
        "RMP": {  # chapter "Segway RMP": a coefficient is the unit of its slot for one count
            "m/s": "forwardSpeed leftSpeed rightSpeed forwardSpeedCoeff leftSpeedCoeff rightSpeedCoeff velocityCoeff"
            " requested applied",
            "rad/s": "yawSpeed yawSpeedCoeff turnCoeff pitchRate rollRate",
            "m": "forward left right forwardCoeff leftCoeff rightCoeff",
            "rad": "yaw yawCoeff pitch roll",
            "N m": "leftTorque rightTorque torqueCoeff",
            "V": "voltage boxVoltage lowVoltage",
            "ratio": "remain speedScale accelerationScale turnScale currentLimit",
            "s": "period",
        },
        "SegwayOdometry": _ODOMETRY,
        "SegwayPlanner": _PLANNER,
        "robot": _MOBILE,
    },
    "webots": {  # chapter "Webots": the devices of pioneer-wander
        "Webots": _BUS | {"s": "time step", "1": "epoch stops factor"},
        "DifferentialWheels": {
            "rad": "angle val requested applied", "rad/s": "speed maxSpeed", "turn": "turn", "N m": "torque",
            "1": f"load encoder encoderResolution {_GAINS}",
        },
        "DistanceSensor": {"m": "distance val", "1": "load factor"},
        "TouchSensor": {"1": "pressure val load"},
        "Gyro": {"rad/s": "speed val", "1": "load"},
        "GPS": {"m": "x y z val", "1": "load"},
        "InertialUnit": {"rad": "roll pitch yaw val", "1": "load"},
        "Lidar": {
            "m": "val distanceMin distanceMax", "rad": "angleMin angleMax resolution", "Hz": "rate", "1": "load",
        },
        "Camera": _PICTURE | {"rad": "xfov yfov", "m": "near far", "1": "load gain wb quality resolution"},
        "WorldView": _PICTURE | {"rad": "azimuth elevation xfov yfov", "m": "distance",
                                 "1": "frames gain wb quality resolution"},
        "robot": _MOBILE,
    },
    "p3dx": {
        "P3dx": _BUS | {"m/s": "speedDelta", "rad/s": "speedAlpha", "m": "distMin distMax",
                        "1": "epoch stops motorsLoad laserLoad"},
        "Body": {"m": "safetyDistanceMin safetyDistanceMax", "1": "load digitalIn digitalOut"},
        "Wheel": {"m/s": "speed val", "1": _GAINS},
        "Sonars": {"1": "load"},
        "Sonar": {"m": "val distance"},
        "P3dxLaser": {
            "m": "val distanceMin distanceMax laserDistanceMin laserDistanceMax",
            "rad": "angleMin angleMax resolution",
            "Hz": "rate", "s": "lastCaptureTimestamp", "1": "load",
        },
        "Camera": _PICTURE | {"rad": "yaw pitch xfov yfov", "ratio": "zoom",
                              "1": "load frames gain wb quality resolution"},
        "XSpeed": {"m/s": "speed val requested applied", "m/s^2": "acceleration deceleration", "1": _GAINS},
        "YawSpeed": {"rad/s": "speed val requested applied", "rad/s^2": "acceleration deceleration", "1": _GAINS},
        "Battery": _BATTERY,
        "P3dxOdometry": _ODOMETRY,
        "P3dxPlanner": _PLANNER,
        "robot": _MOBILE,
    },
    "cia402": {
        "Cia402": _BUS,
        "robot": _TAUGHT,
        "ServoDrive": {
            "rad": "val angle requested applied positionCoeff", "rad/s": "speed velocityCoeff", "turn": "turn",
            "N m": "torque", "1": _GAINS + "node increments load",
        },
    },
    "spykee": {
        "Spykee": _BUS | {"%": "power volume", "m/s": "fullSpeed", "rad/s": "fullTurn"},
        "SpykeeTrack": {"%": "val requested applied", "1": _GAINS},  # -100 to 100: chapter "Spykee"
        "SpykeeLed": {"ratio": "val"},
        "SpykeeCamera": _PICTURE | {"1": "frames gain wb quality resolution"},
        "SpykeeMicro": {"ms": "duration", "ratio": "gain"},
        "SpykeeSpeaker": {"ms": "remain", "dB": "volume"},
        "SpykeeMp3": {"ratio": "sent"},
        "SpykeeBattery": _BATTERY,
        "robot": _MOBILE,
    },
    "nao": {
        "Nao": _BUS | {"%": "volume"},
        "NaoJoint": _NAO_MOTOR | {"rad": "val angle requested applied", "turn": "turn", "ratio": "load"},
        "NaoHand": _NAO_MOTOR | {"ratio": "val requested applied load"},
        "NaoLed": {"ratio": "val r g b", "1": "rgb"},
        "NaoCamera": _PICTURE | {"Hz": "rate",
                                 "1": "load index format formatDetail threaded frames gain wb quality resolution"},
        "NaoMicro": {"ms": "duration", "ratio": "gain"},
        "NaoSpeaker": {"ms": "remain", "dB": "volume"},
        "NaoVoice": {"ratio": "volume", "1": "speed pitch"},
        "NaoSpeech": {"ratio": "confidence"},
        "NaoWalk": {"m/s": "xSpeed ySpeed requested applied", "rad/s": "yawSpeed", "m": "x y", "rad": "theta"},
        "NaoMotorControl": {"s": "dcmShift"},
        **{f"sonar{side}": {"m": "val distance"} for side in "LR"},
        **{f"accel{axis}": {"m/s^2": "val acceleration"} for axis in "XYZ"},
        **{f"gyro{axis}": {"rad/s": "val speed"} for axis in "XY"},
        **{f"headSensor{place}": _BUTTON for place in "FMR"},
        "NaoBumper": _BUTTON,
        "NaoBattery": _BATTERY,
        "NaoFsr": {"1": "val left right", "kg": "leftFootTotalWeight rightFootTotalWeight"},
        "robot": _MOBILE | {"rad/s": _MOBILE["rad/s"] + " blendSpeed"},
    },
    "chain": {
        "Chain": _BUS,
        "robot": _TAUGHT,
        "AX-12A": _AX,
        "MX-28": _SERVO | {
            "rad": _ANGLES,
            "rad/s^2": "acceleration",
            "N m": "torque torqueLimit maxTorque punch",
            "1": _NUMBERS + "led lock alarmLed statusReturnLevel pGain iGain dGain",
        },
        "XL330-M288": _SERVO | {
            "rad": _ANGLES + "homingOffset",
            "rad/s^2": "acceleration",
            "A": "current goalCurrent",
            "N m": "torque torqueLimit maxTorque",
            "1": _NUMBERS + "led statusReturnLevel goalPwm pGain iGain dGain velocityPGain velocityIGain"
            " feedForward1 feedForward2",
        },
    },
    "so101": {"robot": _TAUGHT, "SO101": _BUS, "ArmServo": _STS, "GripperServo": _STS},
}  # fmt: skip
"""Platform -> class, or name of a device where a class has several kinds -> unit -> slots."""


class Shown(NamedTuple):
    """What ``help`` shows of one device."""

    names: tuple[str, ...]
    """Its names in the table above: model, names in Global, class."""
    rows: list[Row]


def devices_of(lab: RobotLab) -> list[Shown]:
    """All devices of a robot, and ``robot`` itself."""
    world = lab.kernel.host.world
    docstrings = Docstrings(world)
    found = [Shown(("robot",), docstrings.table(world.global_.slots["robot"]))]
    names: dict[int, list[str]] = {}
    for name, value in world.global_.slots.items():
        names.setdefault(id(value), []).append(name)
    for face in world.peek_obj(world.global_.slots["uobjects"]).slots.values():
        if isinstance(face, UObjectFace) and face.python is not None:
            model = face.python.variables.get("modelName")
            said = ([str(model.sensed)] if model else []) + names.get(id(face), []) + [face.kind.__name__]
            found.append(Shown(tuple(said), docstrings.table(face)))
    return found


@pytest.fixture(params=[folder.name for folder in folders()], scope="module")
def robot(request: pytest.FixtureRequest) -> tuple[str, list[Shown]]:
    """Each platform with its devices."""
    module = importlib.import_module(f"{request.param}_lab")
    lab = module.Lab.ready()
    lab.run(0.5)
    return request.param, devices_of(lab)


def test_every_number_has_the_unit_of_the_table(robot: tuple[str, list[Shown]]) -> None:
    platform, devices = robot
    table, used, problems = UNITS[platform], set(), []
    for names, rows in devices:
        name = next((each for each in names if each in table), names[-1])
        used.add(name)
        units = {slot: unit for unit, slots in table.get(name, {}).items() for slot in slots.split()}
        shown = {row.name: row.unit for row in rows if row.unit or _is_number(row.value)}
        for slot in sorted({*units, *shown}):
            if units.get(slot) != shown.get(slot):
                problems.append(f"{name}.{slot}: {shown.get(slot)!r}, not {units.get(slot)!r}")
    assert problems == []
    assert table.keys() <= used


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def test_every_slot_of_a_robot_has_a_meaning(robot: tuple[str, list[Shown]]) -> None:
    _, devices = robot
    # An object, such as a Group or a part, says itself what it is.
    plain = ('"', "[", "true", "false", "nil", "nan", "inf", "-")
    wanting = {
        f"{names[-1]}.{row.name}"
        for names, rows in devices
        for row in rows
        if not row.meaning and (not row.value or row.value[0].isdigit() or row.value.startswith(plain))
    }
    # What a program or a layout adds has no class that could tell.
    assert wanting <= {"robot.modules"}


def test_the_last_write_has_the_unit_of_the_slot_that_was_written() -> None:
    lab = Bioloid.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    units = "[motor6.requested->unit, motor6.applied->unit]"
    assert lab.look(units) == '["rad", "rad"]'
    lab.say("motor6.speed = 1;")
    assert lab.look(units) == '["rad/s", "rad/s"]'
    lab.say("motor6.val = 0.1;")
    assert lab.look(units) == '["rad", "rad"]'


def test_a_motor_of_the_brick_counts_degrees_and_its_sonar_centimetres() -> None:
    lab = Nxt.ready()
    lab.say("claw.val = 90;", 3)
    assert lab.number("claw.val") == pytest.approx(90, abs=3)
    assert lab.brick.motor("B").position == pytest.approx(lab.number("claw.val"), abs=1)
    assert lab.look("[claw.val->unit, claw.angle->unit, sonar.val->unit]") == '["deg", "rad", "cm"]'
    assert lab.number("sonar.val") == pytest.approx(100 * lab.tribot.distance(), abs=1)


def test_the_raw_value_of_the_light_sensor_is_no_ratio() -> None:
    lab = Nxt.ready()
    assert lab.look("light.val->unit") == '"ratio"'
    lab.say('light.mode = "Normal";', 0.2)
    assert (lab.look("light.val->unit"), lab.number("light.val") > 1) == ('"1"', True)


def test_help_tells_the_age_of_a_device_in_seconds() -> None:
    lab = Bioloid.ready(Kit(servos=(6,), sensors=(), baud=BAUD))
    world = lab.kernel.host.world
    rows = {row.name: row for row in Docstrings(world).table(world.global_.slots["motor6"])}
    assert lab.look("motor6.age->unit") == '"s"'
    assert (rows["age"].unit, 0 <= float(rows["age"].value) < 0.1) == ("s", True)


def test_claps_have_no_range_and_only_0_is_taken() -> None:
    lab = Bioloid.ready(Kit(servos=(), sensors=(100,), baud=BAUD))
    assert lab.look('System.documentation(sensor100, "clapCount")').endswith('Unit: none."')
    assert lab.say("sensor100.clapCount = 5;").endswith("only 0 can be written, which begins a new count")
    assert lab.say("sensor100.clapCount = 0;") == "0"
