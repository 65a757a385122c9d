"""LeRobot's interface without LeRobot, which brings torch: what a robot, a leader and a camera are made from.

Signatures, abstract methods and names are those of the wheel of lerobot 0.6.1: ``robots/robot.py``,
``robots/config.py``,
``teleoperators/teleoperator.py``, ``cameras/camera.py``, ``cameras/configs.py``, ``utils/import_utils.py``
(``make_device_from_device_class``).  ``installed()`` stands in for the package while a block runs.
"""

from __future__ import annotations

import importlib
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

OURS = "lerobot_robot_urbihw"


class ChoiceRegistry:
    """That of draccus: the classes of configurations by the word of ``--robot.type=``."""

    choices: ClassVar[dict[str, type]]

    def __init_subclass__(cls, **_: Any) -> None:
        if ChoiceRegistry in cls.__bases__:
            cls.choices = {}

    @classmethod
    def register_subclass(cls, name: str) -> Callable[[type], type]:
        def register(made: type) -> type:
            cls.choices[name] = made
            return made

        return register


@dataclass(kw_only=True)
class RobotConfig(ChoiceRegistry, ABC):
    id: str | None = None
    calibration_dir: Path | None = None

    def __post_init__(self) -> None:
        for config in getattr(self, "cameras", {}).values():
            assert None not in (config.width, config.height, config.fps)


@dataclass(kw_only=True)
class TeleoperatorConfig(ChoiceRegistry, ABC):
    id: str | None = None
    calibration_dir: Path | None = None


@dataclass(kw_only=True)
class CameraConfig(ChoiceRegistry, ABC):
    fps: int | None = None
    width: int | None = None
    height: int | None = None


def abstract(*names: str) -> dict[str, Any]:
    """Methods that a subclass must have."""
    return {name: abstractmethod(lambda self: None) for name in names}


class Device(ABC):
    name: str

    def __init__(self, config: Any) -> None:
        self.id = config.id
        self.robot_type = self.name


Robot = type("Robot", (Device,), abstract(
    "observation_features", "action_features", "is_connected", "connect", "is_calibrated", "calibrate", "configure",
    "get_observation", "send_action", "disconnect",
))  # fmt: skip
Teleoperator = type("Teleoperator", (Device,), abstract(
    "action_features", "feedback_features", "is_connected", "connect", "is_calibrated", "calibrate", "configure",
    "get_action", "send_feedback", "disconnect",
))  # fmt: skip


class CameraBase(ABC):  # noqa: B024 - its abstract methods follow
    def __init__(self, config: CameraConfig) -> None:
        self.fps, self.width, self.height = config.fps, config.width, config.height


Camera = type("Camera", (CameraBase,), abstract(
    "is_connected", "find_cameras", "connect", "read", "async_read", "disconnect",
))  # fmt: skip


def device_of(config: Any) -> Any:
    """The device of a configuration: the class of the same name less "Config", in the package around its module."""
    kind = type(config)
    package = importlib.import_module(kind.__module__.rpartition(".")[0])
    return getattr(package, kind.__name__.removesuffix("Config"))(config)


def make_cameras_from_configs(configs: dict[str, CameraConfig]) -> dict[str, Any]:
    return {name: device_of(config) for name, config in configs.items()}


MODULES: dict[str, dict[str, Any]] = {
    "lerobot": {},
    "lerobot.robots": {},
    "lerobot.robots.config": {"RobotConfig": RobotConfig},
    "lerobot.robots.robot": {"Robot": Robot},
    "lerobot.teleoperators": {},
    "lerobot.teleoperators.config": {"TeleoperatorConfig": TeleoperatorConfig},
    "lerobot.teleoperators.teleoperator": {"Teleoperator": Teleoperator},
    "lerobot.cameras": {"CameraConfig": CameraConfig, "make_cameras_from_configs": make_cameras_from_configs},
    "lerobot.cameras.camera": {"Camera": Camera},
}


@contextmanager
def installed() -> Iterator[Any]:
    """Our package, as LeRobot imports it."""
    before = {name: module for name, module in sys.modules.items() if name.partition(".")[0] in ("lerobot", OURS)}
    for name in before:
        del sys.modules[name]
    for name, contents in MODULES.items():
        sys.modules[name] = ModuleType(name)
        vars(sys.modules[name]).update(contents)
    try:
        yield importlib.import_module(OURS)
    finally:
        for name in [name for name in sys.modules if name.partition(".")[0] in ("lerobot", OURS)]:
            del sys.modules[name]
        sys.modules.update(before)
