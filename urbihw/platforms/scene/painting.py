"""Draws states of a simulated world as pictures, with OpenGL without a screen (EGL or OSMesa)."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any, Final

from urbihw.frozen import frozen
from urbihw.platforms.scene.state import take_state

ROBOT: Final = "robot/"
"""Prefix of all names of a robot that was put into a world (``urbihw_fakes.bodies``)."""
NEAR: Final = 4.0
"""Distance of the eye from a robot, in radii of it."""
FAR: Final = 0.75
"""Distance of the eye from the middle of a world, in extents of it."""


class NoPictures(Exception):
    """No pictures can be drawn; the message is one line that says why and what to do."""


@frozen(slots=False)
class ViewPoint:
    """From where the world is seen.

    Attributes:
        azimuth: direction of the look, in rad, to the left of the x axis of the world.
        elevation: how far the look goes upwards, in rad; below zero from above.
        distance: of the eye from the target, in m; 0: so that the target is seen whole.
        target: name of the body that stays in the middle; "" for the robot, else the middle of the world.
    """

    azimuth: float = 2.36
    elevation: float = -0.45
    distance: float = 0.0
    target: str = ""


def load_model(mujoco: Any, file: Path) -> Any:
    """Load a model as the simulation does; ``.mjb`` is one that MuJoCo has written.  Raises NoPictures."""
    try:
        if file.suffix == ".mjb":
            return mujoco.MjModel.from_binary_path(str(file))
        return mujoco.MjSpec.from_file(str(file)).compile()
    except (ValueError, OSError) as error:
        raise NoPictures(f"the model cannot be read: {' '.join(str(error).split())}") from error


class Painter:
    """Draws one model.  It belongs to the thread that makes it."""

    def __init__(self, mujoco: Any, file: Path, width: int, height: int) -> None:
        """``file``: the model; pixels.  Raises NoPictures."""
        self._mujoco = mujoco
        self.model = load_model(mujoco, file)
        self.data = mujoco.MjData(self.model)
        visual = self.model.vis.global_
        visual.offwidth, visual.offheight = max(visual.offwidth, width), max(visual.offheight, height)
        try:
            self._renderer = mujoco.Renderer(self.model, height=height, width=width)
        except Exception as error:  # whatever the drivers of the graphics raise
            raise NoPictures(
                f"no OpenGL ({' '.join(str(error).split()) or 'not found'}): install libegl1 and libgl1-mesa-dri, or "
                "libosmesa6; then MUJOCO_GL is egl, osmesa or not set"
            ) from error
        self._camera = mujoco.MjvCamera()

    def close(self) -> None:
        """Free what drawing takes."""
        with contextlib.suppress(Exception):  # a context that is already gone
            self._renderer.close()

    def draw(self, state: bytes, view: ViewPoint) -> Any:
        """Return the picture of a state: an array of height, width and 3 colours, 0 to 255.  Raises ValueError."""
        take_state(self._mujoco, self.model, self.data, state)
        self._look(view)
        self._renderer.update_scene(self.data, camera=self._camera)
        return self._renderer.render()

    def _look(self, view: ViewPoint) -> None:
        camera, degrees = self._camera, 57.29577951308232
        body, radius = self._target(view.target)
        camera.type = self._mujoco.mjtCamera.mjCAMERA_FREE
        if body:
            camera.lookat[:] = self.data.subtree_com[body]
            distance = NEAR * radius
        else:
            camera.lookat[:] = self.model.stat.center
            distance = FAR * self.model.stat.extent
        camera.azimuth, camera.elevation = view.azimuth * degrees, view.elevation * degrees
        camera.distance = view.distance or distance

    def _target(self, name: str) -> tuple[int, float]:
        """Return the number and the radius (m) of the body to look at; 0 for the world.  Raises ValueError."""
        model = self.model
        if name:
            body = self._mujoco.mj_name2id(model, self._mujoco.mjtObj.mjOBJ_BODY, name)
            if body < 0:
                names = [model.body(i).name for i in range(1, model.nbody)]
                raise ValueError(f"no body {name!r}; there are: {', '.join(filter(None, names))}")
        else:
            body = next((i for i in range(1, model.nbody) if model.body(i).name.startswith(ROBOT)), 0)
        if body <= 0:
            return 0, 0.0
        middle, radius = self.data.subtree_com[body], 0.05
        for geom in range(model.ngeom):
            if model.body_rootid[model.geom_bodyid[geom]] == model.body_rootid[body]:
                way = self.data.geom_xpos[geom] - middle
                radius = max(radius, float((way @ way) ** 0.5) + float(model.geom_rbound[geom]))
        return body, radius
