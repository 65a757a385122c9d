"""Fetches the newest pictures of a camera; numpy.asarray(picture) is the array, where numpy is installed."""

import urbihw

with urbihw.connect() as robot, robot.pictures("camera.val", hz=5, timeout=10) as pictures:
    t, picture = next(pictures)
    print(picture.format, picture.width, picture.height, len(picture.data))
