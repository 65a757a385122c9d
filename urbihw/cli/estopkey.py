"""``urbihw estop --key DEVICE:KEY``: a key of a keyboard, or a button of a gamepad, stops the robot and holds it.

Keys have the names of the Linux kernel (``KEY_SPACE``, ``BTN_SOUTH``); ``evtest`` shows them.  The loss of the device
counts as a press, and the command ends.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from typing import Any, Final

from urbihw.cli import control
from urbihw.exitcodes import EX_CONFIG, EX_UNAVAILABLE, INTERRUPTED
from urbihw.extras import install_command

PRESSED: Final = 1
"""The value of a key event when the key goes down; 0 is up, 2 is held."""


def run(options: argparse.Namespace) -> int:
    """Listen until the device is gone or Ctrl-C; returns the exit code."""
    path, _, name = options.key.rpartition(":")
    if not path or not name:
        return control.complain("--key wants a device and a key, such as /dev/input/event3:KEY_SPACE", EX_CONFIG)
    try:
        import evdev
    except ImportError:
        return control.complain(f"--key needs the Python package evdev: {install_command('evdev')}", EX_CONFIG)
    code = evdev.ecodes.ecodes.get(name)
    if code is None:
        return control.complain(f"no key is called {name}; evtest shows the names", EX_CONFIG)
    try:
        device = evdev.InputDevice(path)
    except OSError as error:
        return control.complain(f"cannot open {path}: {error.strerror}; is it plugged in, may you read it?", EX_CONFIG)
    print(f"{name} of {device.name} ({path}) is an emergency stop; Ctrl-C ends this", flush=True)
    options.who = options.who or f"{name} of {device.name}"
    try:
        return listen(device.read_loop(), (evdev.ecodes.EV_KEY, code), options)
    except KeyboardInterrupt:
        return INTERRUPTED


def listen(events: Iterable[Any], wanted: tuple[int, int], options: argparse.Namespace) -> int:
    """Stop the robot at each press of ``wanted`` (type and code of an event), and when the device is lost."""
    try:
        for event in events:
            if (event.type, event.code) == wanted and event.value == PRESSED:
                control.run("estop", options)
                sys.stdout.flush()
    except OSError as error:
        options.who = f"{options.who}, which was unplugged"
        control.run("estop", options)
        return control.complain(f"the device of the key is gone: {error.strerror}", EX_UNAVAILABLE)
    return 0
