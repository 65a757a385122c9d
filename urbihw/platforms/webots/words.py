"""Meaning and unit of the slots of a simulation (``platforms.words``)."""

from __future__ import annotations

from typing import Final

from urbihw.platforms.words import COMMON

Words = dict[str, tuple[str, str]]
_NODE: Final = {"node": ("name of the device in the simulator", "")}
SENSOR: Final[Words] = {"load": ("1 samples the device, 0 does not; for all its objects", "1")} | _NODE
ROBOT: Final[Words] = {
    "time": ("time of the simulation", "s"),
    "step": ("time step of the simulation", "s"),
    "mode": ("real, fast or pause", ""),
    "factor": ("simulated seconds in a second of real time, in the mode real", "1"),
    "simulator": ("the program that simulates", ""),
    "world": ("name of the world", ""),
    "deviceNames": ("names of the devices of the simulated robot, each with its kind", ""),
    "deviceOrder": ("names of the devices, in the order of the model", ""),
    "assemble": ("assemble(all): make the object robot, with all devices or none", ""),
    "number": ("number(part, kind, make): add all devices of a kind to robot.body, numbered", ""),
    "heldUp": ("event: programs did not give way, and the simulation went on without them; with its time", ""),
    "problem": ("event: the simulation could not do something; with the reason", ""),
}
MOTOR: Final[Words] = COMMON | _NODE | {
    "angle": ("angle: the target when written, the measured one when read", "rad"),
    "speed": ("speed: the target when written, the measured one when read", "rad/s"),
    "torque": ("torque that the motor gives", "N m"),
    "maxSpeed": ("greatest speed on the way to a target angle", "rad/s"),
}  # fmt: skip
SERVO: Final[Words] = {"force": ("torque that the motor gives, if force feedback is on", "N m")}
WHEEL: Final[Words] = {
    "encoder": ("count of the encoder; writing sets it and turns nothing", "1"),
    "encoderResolution": ("counts of the encoder for 1 rad", "1"),
}
ACCELEROMETER: Final[Words] = {"acceleration": ("acceleration along the axis, with that of gravity", "m/s^2")}
GYRO: Final[Words] = {"speed": ("rate of rotation about the axis", "rad/s")}
GPS: Final[Words] = {
    "x": ("place in the world", "m"), "y": ("place in the world", "m"), "z": ("height in the world", "m"),
    "val": ("place in the world: x, y, z", "m"),
}  # fmt: skip
COMPASS: Final[Words] = {
    "x": ("north along the x axis of the device", "1"), "y": ("north along its y axis", "1"),
    "z": ("north along its z axis", "1"), "angle": ("heading, to the left of the x axis of the world", "rad"),
    "val": ("direction of the north: x, y, z", "1"),
}  # fmt: skip
INERTIAL: Final[Words] = {
    "roll": ("inclination to the side", "rad"), "pitch": ("inclination forward", "rad"),
    "yaw": ("heading, to the left", "rad"), "val": ("roll, pitch, yaw", "rad"),
}  # fmt: skip
DISTANCE: Final[Words] = {
    "distance": ("distance to what is in front", "m"),
    "factor": ("factor of the value that the simulator tells", "1"),
}
TOUCH: Final[Words] = {"pressure": ("1 while something touches it; of a force sensor the force in N", "1")}
LIGHT: Final[Words] = {"val": ("light that falls on it", "1")}
POSITION: Final[Words] = {"val": ("angle or way of the joint", "rad")}
LIDAR: Final[Words] = {
    "val": ("distances, from the left to the right", "m"),
    "angleMin": ("direction of the last one on the right", "rad"), "angleMax": ("direction of the first one", "rad"),
    "resolution": ("angle between two", "rad"), "distanceMin": ("least distance", "m"),
    "distanceMax": ("greatest distance", "m"), "rate": ("scans per second", "Hz"),
}  # fmt: skip
RANGES: Final[Words] = {
    "val": ("distances, row by row", "m"), "width": ("points in a row", "pixel"), "height": ("rows", "pixel"),
    "xfov": ("horizontal field of view", "rad"), "distanceMax": ("greatest distance", "m"),
}  # fmt: skip
CAMERA: Final[Words] = SENSOR | {
    "near": ("distance to the near clipping plane", "m"), "far": ("distance to the far clipping plane", "m"),
    "val": ("the newest picture", ""), "width": ("width", "pixel"), "height": ("height", "pixel"),
    "xfov": ("horizontal field of view", "rad"), "yfov": ("vertical field of view", "rad"), "format": ("rgb", ""),
}  # fmt: skip
BLOB: Final[Words] = {
    "x": ("middle of the blob, from the left", "pixel"), "y": ("middle of the blob, from the top", "pixel"),
    "ratio": ("its share of the picture", "ratio"), "visible": ("whether there is any", ""),
    "threshold": ("how much the shares of red and green may differ", "ratio"),
}  # fmt: skip
LED: Final[Words] = {"val": ("brightness", "ratio")} | _NODE
EMITTER: Final[Words] = {"channel": ("channel of the radio", "1")}
RECEIVER: Final[Words] = SENSOR | EMITTER | {
    "val": ("the last packet, as a text", ""), "received": ("event: a packet has come; with its text", ""),
}  # fmt: skip
SPEAKER: Final[Words] = _NODE | {"spoken": ("the last text", "")}
DISPLAY: Final[Words] = _NODE | {"width": ("width", "pixel"), "height": ("height", "pixel")}
LABEL: Final[Words] = {
    "txt": ("text that is shown", ""), "x": ("place from the left, 0 to 1", "ratio"),
    "y": ("place from the top, 0 to 1", "ratio"), "r": ("red", "ratio"), "g": ("green", "ratio"),
    "b": ("blue", "ratio"), "a": ("opacity", "ratio"), "size": ("height of the letters", "ratio"),
}  # fmt: skip
MANIPULATE: Final[Words] = _NODE | {
    "tx": ("place in the world", "m"), "ty": ("place in the world", "m"), "tz": ("height in the world", "m"),
    "ax": ("rotation vector: the axis, as long as the angle", "rad"), "ay": ("its y component", "rad"),
    "az": ("its z component", "rad"),
}  # fmt: skip
