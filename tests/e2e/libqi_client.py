"""A client of a real libqi, for the Nao at a url: a witness for ``test_nao_libqi``."""

from __future__ import annotations

import sys
import threading

import qi

session = qi.Session()
session.connect(sys.argv[1])
names = [row["name"] for row in session.services()]
print("told ALMotion", "ALMotion" in names)
motion, memory = session.service("ALMotion"), session.service("ALMemory")
print("told angles", [round(angle, 3) for angle in motion.getAngles(["HeadYaw", "HeadPitch"], True)])
motion.wakeUp()
print("told awake", motion.robotIsWakeUp())
motion.angleInterpolationWithSpeed("HeadYaw", 0.5, 1.0)
print("told head", round(motion.getAngles("HeadYaw", True)[0], 2))
motion.moveTo(0.1, 0.0, 0.0)
print("told walked", round(motion.getRobotPosition(True)[0], 1))
heard = threading.Event()
values: list[object] = []


def hear(value: object) -> None:
    """Called in a thread of libqi."""
    values.append(value)
    heard.set()


subscriber = memory.subscriber("mine")
subscriber.signal.connect(hear)
memory.raiseEvent("mine", 1.0)
heard.wait(5)
print("told event", *values)
try:
    motion.getAngles("Nose", True)
except RuntimeError as error:
    print("told error", str(error).splitlines()[0])
session.close()
