"""How the package mujoco is imported: it is heavy, may be missing, and dies of a wrong MUJOCO_GL."""

from __future__ import annotations

import os
from ctypes.util import find_library
from typing import Any, Final

GL: Final = "MUJOCO_GL"
"""The variable that selects how MuJoCo makes pictures."""
_LIBRARIES: Final = {"egl": "EGL", "osmesa": "OSMesa"}
_OTHER_WAYS: Final = ("glfw", "disable", "disabled", "off", "false", "0", "enable", "enabled", "on", "true", "1")
"""What else it takes (mujoco/rendering/classic/gl_context.py)."""


class NoMujoco(Exception):
    """The package mujoco is not installed."""


def import_mujoco(has_screen: bool = False) -> Any:
    """Import mujoco, so that it renders without a screen where that can be, or in windows.  Raises NoMujoco."""
    # It reads MUJOCO_GL when it is imported, and dies of a word that it does not know or a library that is not there.
    if has_screen:
        os.environ[GL] = "glfw"
    else:
        wanted = os.environ.get(GL, "").lower()
        libraries = {way: library for way, library in _LIBRARIES.items() if find_library(library)}
        if not wanted:
            os.environ[GL] = next(iter(libraries), "disable")
        elif wanted not in (*libraries, *_OTHER_WAYS):
            os.environ[GL] = "disable"
    try:
        import mujoco
    except ModuleNotFoundError as error:
        raise NoMujoco(str(error.name)) from error
    # Its own handler writes a file into the present folder.
    mujoco.set_mju_user_warning(lambda text: None)
    return mujoco
