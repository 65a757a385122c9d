"""What a camera of a robot sees in its world, as a JPEG.

MuJoCo draws with EGL or OSMesa, without a screen; where there is neither, or no Pillow, there are no pictures.  All
pictures must be taken by one thread.
"""

from __future__ import annotations

import ctypes.util
import io
import os
from typing import Any

from urbihw_fakes.bodies.simulation import PREFIX, Simulation

QUALITY = 60


def choose_drawing() -> bool:
    """Choose how MuJoCo draws, before it is imported for the first time; whether there are pictures."""
    try:
        import PIL.Image  # noqa: F401
    except ImportError:
        return False
    for library, name in (("EGL", "egl"), ("OSMesa", "osmesa")):
        if ctypes.util.find_library(library):
            os.environ.setdefault("MUJOCO_GL", name)
            return True
    return "MUJOCO_GL" in os.environ


class Eye:
    """The camera ``name`` of the robot; pixels."""

    def __init__(self, simulation: Simulation, name: str, width: int, height: int) -> None:
        self._simulation = simulation
        self._name = PREFIX + name
        self._size = width, height
        self._renderer: Any = None

    def picture(self, dark: bool) -> bytes:
        """The JPEG; ``dark`` is a world without light."""
        import mujoco
        from PIL import Image

        if self._renderer is None:
            # It belongs to the thread that makes it.
            self._renderer = mujoco.Renderer(self._simulation.model, self._size[1], self._size[0])
        self._renderer.update_scene(self._simulation.data, camera=self._name)
        pixels = self._renderer.render()
        out = io.BytesIO()
        Image.fromarray(pixels // 4 if dark else pixels).save(out, "JPEG", quality=QUALITY)
        return out.getvalue()

    def sees(self) -> bool:
        """Whether a picture can be taken; the one who asks need not be the thread that takes them."""
        try:
            self.picture(False)
        except Exception:  # MuJoCo, PyOpenGL and the drivers have errors of many kinds
            return False
        self.close()
        return True

    def close(self) -> None:
        """Give back what drawing takes; a second call does nothing."""
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None
