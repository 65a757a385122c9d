"""What the manifests say of options and limits is what the robots take."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest
from bioloid_lab import Lab as Bioloid
from cia402_lab import Lab as Drives
from nxt_lab import Lab as Nxt
from p3dx_lab import Lab as Pioneer
from segway_lab import Lab as Segway

from urbihw import platforms
from urbihw.kernel.uobject import BadConfig
from urbihw.platforms import DeviceLimits

LABS: dict[str, Callable[[], Any]] = {
    "bioloid": Bioloid.ready,
    "nxt": Nxt.ready,
    "segway": Segway.ready,
    "p3dx": Pioneer.ready,
    "cia402": Drives.ready,
}
VALUES: dict[str, Any] = {"position": (-0.5, 0.5), "temperature": (40.0, 50.0, 60.0), "voltage": (10.0, 11.0)}
"""A limit of each kind; 0.1 for the others."""
WHEEL = "motor6.cwLimit = motor6.ccwLimit = 0|;"


def test_every_platform_is_here() -> None:
    assert LABS.keys() == {folder.name for folder in platforms.folders()}


def limited(lab: Any) -> dict[str, set[str]]:
    """Which limits make a difference, by device."""
    found = {}
    for name, device in lab.robot.limited_devices().items():
        def counts(limits: DeviceLimits, device: Any = device) -> Any:
            return device.limits_in_counts(limits, lambda kind: "a limit")

        free = counts(DeviceLimits())
        found[name] = {
            kind for kind in DeviceLimits.rules() if counts(DeviceLimits(**{kind: VALUES.get(kind, 0.1)})) != free
        }
    return found


@pytest.mark.parametrize("name", LABS)
def test_the_limits_of_the_manifest_are_those_that_act(name: str) -> None:
    lab, declared = LABS[name](), platforms.find(name).limits
    found = limited(lab)
    if name == "bioloid":
        lab.say(WHEEL, 0.5)
        found["motor6"] |= limited(lab)["motor6"]
        # Only a wheel is accelerated; any of them may become one.
        found = {"motor6": found["motor6"]}
    assert found
    for device, kinds in found.items():
        (pattern,) = [each for each in declared if re.fullmatch(each.replace("#", "[0-9]+"), device)]
        assert kinds == set(declared[pattern])


@pytest.mark.parametrize("name", LABS)
def test_options_that_are_not_declared_are_refused_by_the_robot_itself(name: str) -> None:
    known = next(iter(platforms.load_options(platforms.find(name)).rules()))
    kind = LABS[name].__self__  # type: ignore[attr-defined]
    with pytest.raises(BadConfig, match=rf"^{name}: options\.{known}x: no such option; did you mean {known}\?$"):
        kind(**{f"{known}x": 1})
