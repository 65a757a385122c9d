"""Watches two slots, fifty times a second: the server sends, nothing is asked."""

import urbihw

with urbihw.connect() as robot, robot.watch("motor6.val", "sensor100.IRCenter", hz=50) as samples:
    for number, (t, (angle, distance)) in enumerate(samples):
        print(f"{t:.3f} {angle:.3f} {distance}")
        if number == 9:
            break
    print("lost:", samples.lost)
