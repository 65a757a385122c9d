"""Names that methods of ALMotion had in NAOqi 1, which the manual uses, and what they are called since.

A robot of NAOqi 2 may still have some of them: its own come first.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Final

Arguments = Sequence[Any]


def _keep(arguments: Arguments) -> Arguments:
    return arguments


def _frequency_as_config(arguments: Arguments) -> Arguments:
    """The fourth argument was the step frequency, a share of 1."""
    return arguments if len(arguments) != 4 else [*arguments[:3], [["MaxStepFrequency", arguments[3]]]]


MOTION_NAMES: Final[Mapping[str, tuple[str, Callable[[Arguments], Arguments]]]] = {
    # As the manual spells it.
    "waituntilWalkIsFinished": ("waitUntilMoveIsFinished", _keep),
    "waitUntilWalkIsFinished": ("waitUntilMoveIsFinished", _keep),
    "walkTo": ("moveTo", _keep),
    "walkInit": ("moveInit", _keep),
    "walkIsActive": ("moveIsActive", _keep),
    "stopWalk": ("stopMove", _keep),
    "killWalk": ("killMove", _keep),
    "setWalkTargetVelocity": ("moveToward", _frequency_as_config),
    "setWalkArmsEnable": ("setMoveArmsEnabled", _keep),
    "getWalkArmsEnable": ("getMoveArmsEnabled", _keep),
}
"""Old name -> new name, and how the arguments are converted."""
OLD_NAMES: Final = {"ALMotion": MOTION_NAMES}


def with_old_names(service: str, methods: Sequence[str]) -> list[str]:
    """The methods of a service, and the old names of those that it has under a new one only."""
    old = OLD_NAMES.get(service, {})
    return [*methods, *(name for name, (new, _) in old.items() if name not in methods and new in methods)]


def find_new_name(service: str, method: str, arguments: Arguments, methods: Collection[str]) -> tuple[str, Arguments]:
    """A call by an old name as the robot, which has these methods, knows it; any other one as it is."""
    if method in methods or method not in OLD_NAMES.get(service, {}):
        return method, arguments
    new, convert = OLD_NAMES[service][method]
    return new, convert(arguments)
