"""The light sensor of MuJoCo: one light 2 m above it, the value computed by hand."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from webots_lab import need_mujoco

from urbihw.platforms.webots.mujoco_world import BadModel, MujocoWorld

UP = -90.0
"""Turn of the site about y, in degrees, that lets its x axis look up."""
GREY = 'diffuse=".8 .8 .8"'
MODEL = """<mujoco><custom><text name="ls0" data="light-sensor"/></custom><worldbody>
<light pos="0 0 2" {light}/>
<body><geom size=".05" mass="1"/><site name="{site}" euler="0 {turn} 0"/></body>
<body pos="{lid} 0 1"><geom type="box" size=".2 .2 .01"/></body>
</worldbody></mujoco>"""


def light_at(folder: Path, light: str = GREY, turn: float = UP, lid: float = 5, site: str = "ls0") -> float:
    """Return what the sensor measures."""
    need_mujoco()
    path = folder / "light.xml"
    path.write_text(MODEL.format(light=light, turn=turn, lid=lid, site=site))
    return float(MujocoWorld(path).read("ls0"))


SPOT_60 = math.cos(math.radians(60))


@pytest.mark.parametrize(
    ("light", "expected"),
    [
        (GREY, 0.8),
        ('diffuse=".9 .6 0"', 0.5),
        (f'{GREY} ambient=".1 .1 .1"', 0.9),
        (f'{GREY} active="false"', 0.0),
        (f'{GREY} attenuation="1 .5 .25"', 0.8 / (1 + 0.5 * 2 + 0.25 * 4)),
        (f'{GREY} attenuation="1 .5 .25" type="directional"', 0.8),
        (f'{GREY} type="directional" dir="1 0 0"', 0.0),
        (f'{GREY} type="point" dir="1 0 0"', 0.8),
        (f'{GREY} dir=".866025 0 -.5"', 0.0),
        (f'{GREY} dir=".866025 0 -.5" cutoff="80" exponent="2"', 0.8 * SPOT_60**2),
    ],
)  # fmt: skip
def test_each_attribute_of_a_light_counts(tmp_path: Path, light: str, expected: float) -> None:
    assert light_at(tmp_path, light) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(("turn", "expected"), [(-30, 0.4), (0, 0.0), (90, 0.0)])
def test_a_sensor_that_looks_aside_gets_less(tmp_path: Path, turn: float, expected: float) -> None:
    assert light_at(tmp_path, turn=turn) == pytest.approx(expected, abs=1e-6)


def test_a_shape_between_gives_shade_unless_the_light_casts_none(tmp_path: Path) -> None:
    dim = f'{GREY} ambient=".1 .1 .1"'
    assert light_at(tmp_path, dim, lid=0) == pytest.approx(0.1)
    assert light_at(tmp_path, f'{dim} castshadow="false"', lid=0) == pytest.approx(0.9)
    assert light_at(tmp_path, dim, lid=0.3) == pytest.approx(0.9)


def test_a_sensor_without_its_site_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(BadModel, match="text 'ls0': 'light-sensor' declares no device: ") as caught:
        light_at(tmp_path, site="another")
    assert "\n" not in str(caught.value)
