"""Reads and writes slots: attributes of the robot are slots of the server."""

import urbihw

with urbihw.connect() as robot:
    robot.motor6.val = 0.5
    print(robot.motor6.val)
