"""Moves in a second, and goes on when the movement has ended."""

import urbihw

with urbihw.connect() as robot:
    robot.slot("motor6.val").set(0.3, time=1)
    print("there:", round(robot.motor6.val, 1))
