"""What the manifests say of options and limits is what the robots take."""

from __future__ import annotations

import importlib
import re
from typing import Any

import pytest

from urbihw import platforms
from urbihw.kernel.uobject import BadConfig
from urbihw.platforms import DeviceLimits
from urbihw.platforms.segway.robot import DEAD_MAN

NAMES = [folder.name for folder in platforms.folders()]
VALUES: dict[str, Any] = {"position": (-0.5, 0.5), "temperature": (40.0, 50.0, 60.0), "voltage": (10.0, 11.0)}
"""A limit of each kind; 0.1 for the others."""
WHEELS = {
    "bioloid": ("motor6", "motor6.cwLimit = motor6.ccwLimit = 0|;"),
    "chain": ("motor1", 'motor1.mode = "wheel"|;'),
    "so101": ("motor5", 'motor5.mode = "wheel"|;'),
}
"""A servo of a chain, and how it becomes a wheel."""


def lab_of(platform: str) -> Any:
    """The class of the lab of a platform."""
    return importlib.import_module(f"{platform}_lab").Lab


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


def test_the_longest_silence_of_the_manifest_is_that_of_the_robot() -> None:
    declared = {name: platforms.find(name).dead_man for name in NAMES}
    assert {name: longest for name, longest in declared.items() if longest} == {"segway": DEAD_MAN}


@pytest.mark.parametrize("name", NAMES)
def test_the_limits_of_the_manifest_are_those_that_act(name: str) -> None:
    lab, declared = lab_of(name).ready(), platforms.find(name).limits
    found = limited(lab)
    if name in WHEELS:
        motor, switch = WHEELS[name]
        lab.say(switch, 0.5)
        # Only a wheel is accelerated; any of them may become one.
        found = {motor: found[motor] | limited(lab)[motor]}
    assert bool(found) == bool(declared)
    for device, kinds in found.items():
        forms = {each: re.escape(each).replace(r"\#", "[0-9]+").replace(r"\*", ".*") for each in declared}
        (pattern,) = [each for each, form in forms.items() if re.fullmatch(form, device)]
        assert kinds == set(declared[pattern])


@pytest.mark.parametrize("name", NAMES)
def test_options_that_are_not_declared_are_refused_by_the_robot_itself(name: str) -> None:
    known = next(iter(platforms.load_options(platforms.find(name)).rules()), "")
    guess = f"; did you mean {known}\\?" if known else ""
    with pytest.raises(BadConfig, match=rf"^{name}: options\.{known}x: no such option{guess}"):
        lab_of(name)(**{f"{known}x": 1})
