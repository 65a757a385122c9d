"""Waits for an event, here one that the program emits itself."""

import urbihw

with urbihw.connect() as robot:
    robot.run("var clapped = Event.new|;")
    with robot.events("clapped", timeout=10) as claps:
        robot.run("clapped!(2)")
        print("claps:", next(claps).args[0])
