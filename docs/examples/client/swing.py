"""Runs urbiscript in the background under a tag, and stops it by the tag."""

import time

import urbihw

with urbihw.connect() as robot:
    robot.run("motor6.val = 0 sin:1s ampli:20deg,", tag="swing")
    time.sleep(0.2)
    robot.stop("swing")
    print("stopped")
