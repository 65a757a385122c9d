"""The light that falls on a site of a MuJoCo model."""

from __future__ import annotations

import math
from typing import Any, Final

from urbihw.platforms.webots import simulator as s

_NEAR_M: Final = 1e-6
"""A surface this close to the light is the place of the light, not in front of it."""


class MujocoLight:
    """A light sensor at a site, which looks along the x axis of the site.

    Its value is 0 in the dark.  Each light that is switched on adds its ambient part, and its diffuse part (the means
    of red, green and blue) times:

    - the cosine of the angle between the x axis of the site and the direction to the light, 0 from behind;
    - ``1 / (a + b d + c d^2)`` with its ``attenuation`` (a, b, c) and the distance d in m, but for directional lights;
    - the cosine of the angle to the axis of a spot, to the power of its ``exponent``; 0 outside of its ``cutoff``;
    - 0 if a shape is between them and the light has ``castshadow``.  The body of the sensor itself gives no shade.

    These are the terms of the fixed pipeline of OpenGL (OpenGL 1.5 specification, 2.14.1), from which MuJoCo has the
    attributes of lights.  The headlight, lights of images, and light that is reflected count nothing.
    """

    def __init__(self, mujoco: Any, model: Any, data: Any, name: str) -> None:
        """Raise KeyError without a site of this name."""
        import numpy  # mujoco cannot be there without it

        self._np, self._mujoco, self._model, self._data = numpy, mujoco, model, data
        site = model.site(name)
        self._site, self._body = int(site.id), int(site.bodyid[0])
        self._geom = numpy.zeros(1, dtype=numpy.int32)
        self.device = s.SimDevice(name, s.LIGHT_SENSOR)

    def read(self) -> float:
        """Return the light that falls on the sensor, without a unit."""
        return sum(self._light(index) for index in range(self._model.nlight))

    def _light(self, index: int) -> float:
        model, kinds = self._model, self._mujoco.mjtLightType
        kind = int(model.light_type[index])
        if not model.light_active[index] or kind == int(kinds.mjLIGHT_IMAGE):
            return 0.0
        np, axis = self._np, self._data.light_xdir[index]
        place = self._data.site_xpos[self._site]
        ahead = self._data.site_xmat[self._site].reshape(3, 3)[:, 0]
        if kind == int(kinds.mjLIGHT_DIRECTIONAL):
            distance, toward, strength = math.inf, -axis, 1.0
        else:
            way = self._data.light_xpos[index] - place
            distance = float(np.linalg.norm(way))
            toward = way / distance if distance > _NEAR_M else ahead
            constant, linear, square = (float(each) for each in model.light_attenuation[index])
            weakened = constant + linear * distance + square * distance**2
            strength = 1 / weakened if weakened > 0 else 0.0
        if kind == int(kinds.mjLIGHT_SPOT):
            aside = float(-toward @ axis)
            inside = aside >= math.cos(math.radians(float(model.light_cutoff[index])))
            strength *= max(aside, 0.0) ** float(model.light_exponent[index]) if inside else 0.0
        ambient, diffuse = (float(np.mean(each[index])) for each in (model.light_ambient, model.light_diffuse))
        facing = max(float(toward @ ahead), 0.0)
        direct = strength * facing * diffuse
        if direct and model.light_castshadow[index] and self._is_shaded(toward, distance):
            direct = 0.0
        return direct + strength * ambient

    def _is_shaded(self, toward: Any, distance: float) -> bool:
        place = self._data.site_xpos[self._site]
        hit = self._mujoco.mj_ray(self._model, self._data, place, toward, None, True, self._body, self._geom)
        return bool(0 <= hit < distance - _NEAR_M)
