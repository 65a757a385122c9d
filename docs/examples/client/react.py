"""Lets the server react, which is faster than any client, and only listens to what it tells."""

import urbihw

with urbihw.connect() as robot:
    robot.slot("motor6.val").set(0, time=0.5)
    robot.run("var raised = Event.new|;")
    with robot.events("raised", timeout=10) as warnings:
        robot.run("at (motor6.val > 0.2) raised!(motor6.val > 0.2),", tag="guard")
        robot.motor6.val = 0.5
        print("raised:", next(warnings).args[0])
