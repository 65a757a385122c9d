"""Show the simulated world of a robot in a window.

It needs a screen, and the extra `mujoco`.  Looking moves nothing: what is done to bodies in the window is not done to
the world.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import threading
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from urbihw.cli.options import CliRefused, complain
from urbihw.cli.reach import add_server, credentials, server
from urbihw.client.connection import Connection
from urbihw.client.errors import ClientError
from urbihw.client.robot import Robot
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE, INTERRUPTED
from urbihw.extras import install_command
from urbihw.platforms.scene.library import NoMujoco, import_mujoco
from urbihw.platforms.scene.painting import NoPictures, load_model
from urbihw.platforms.scene.state import take_state
from urbihw.started import as_typed

TIMEOUT_S: Final = 10.0
CLOSE_S: Final = 2.0
"""Seconds for the window to close."""
RATE_HZ: Final = 25.0
"""Pictures a second."""
_SCREENS: Final = ("DISPLAY", "WAYLAND_DISPLAY")


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw view``."""
    add_server(parser)


def run(options: argparse.Namespace) -> int:
    """Show the world until the window is closed, or the server ends; returns the exit code."""
    try:
        if not any(map(os.environ.get, _SCREENS)):
            raise CliRefused("there is no screen (DISPLAY is not set): the panel shows the world in a browser, and "
                             f"{as_typed('urbihw film')} makes a film of it", EX_CONFIG)
        return _show(options)
    except CliRefused as error:
        return complain("urbihw view", error)
    except KeyboardInterrupt:
        return INTERRUPTED


def _show(options: argparse.Namespace) -> int:
    """Open the window.  Raises CliRefused."""
    try:
        mujoco = import_mujoco(has_screen=True)
    except NoMujoco as error:
        raise CliRefused(f"windows need mujoco: {install_command('mujoco')}", EX_CONFIG) from error
    where = server(options)
    try:
        connection = Connection(where, credentials(options), TIMEOUT_S, False, lambda line, at: None)
        robot = Robot(connection, deque())
        with robot:
            if not robot.run('Global.hasLocalSlot("worldView")'):
                raise CliRefused(f"{where} has no simulated world: serve --platform webots, or --fake --world room",
                                 EX_UNAVAILABLE)
            _follow(mujoco, robot, Path(robot.run("worldView.file")))
    except ClientError as error:
        raise CliRefused(str(error), EX_UNAVAILABLE) from error
    except NoPictures as error:
        raise CliRefused(f"{error}; is this another machine than that of the server?", EX_UNAVAILABLE) from error
    return EX_OK


def _follow(mujoco: Any, robot: Robot, file: Path) -> None:
    """Show each state in the window until it is closed.  Raises NoPictures, CliRefused, ClientError."""
    model = load_model(mujoco, file)
    data = mujoco.MjData(model)
    with robot.pictures("worldView.state", hz=RATE_HZ) as states, _window(model, data) as window:
        for shot in states:
            if not window.is_running():
                return
            state = bytes(shot.value.data)
            if not state:
                continue  # the first one is still to come
            with window.lock():
                try:
                    take_state(mujoco, model, data, state)
                except ValueError as error:
                    raise CliRefused(f"{error}: start {as_typed('urbihw view')} again", EX_UNAVAILABLE) from error
            window.sync()


@contextlib.contextmanager
def _window(model: Any, data: Any) -> Iterator[Any]:
    """MuJoCo's window while the block runs.  Raises CliRefused."""
    import mujoco.viewer

    others = set(threading.enumerate())
    try:
        window = mujoco.viewer.launch_passive(model, data, show_left_ui=False, show_right_ui=False)
    except Exception as error:  # whatever the drivers of the graphics raise
        raise CliRefused(f"no window can be opened: {' '.join(str(error).split())}", EX_CONFIG) from error
    try:
        yield window
    finally:
        window.close()
        # Its thread draws still; Python would take the window away from under it, and crash.
        for thread in set(threading.enumerate()) - others:
            thread.join(CLOSE_S)
