"""Errors of urbiscript are exceptions, with their place in the text; a missing slot is an AttributeError, too."""

import urbihw
from urbihw.client.errors import UrbiError

with urbihw.connect() as robot:
    try:
        robot.run("var a = 1;\na + nowhere")
    except UrbiError as error:
        print(f"line and columns {error.location}: {error.text}")
    print(hasattr(robot, "motor99"))
