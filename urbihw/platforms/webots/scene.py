"""The simulation as a source of ``worldView``: its state is sampled like a device."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from urbihw.platforms.webots.simulator import SCENE
from urbihw.platforms.webots.surface import Surface


class SimulatedScene:
    """The scene of a simulated world: the ``SceneSource`` of ``urbihw.platforms.scene.view``."""

    def __init__(self, surface: Surface) -> None:
        self._surface = surface
        self._show: Callable[[bytes, float], None] | None = None

    def begin(self, period: float, show: Callable[[bytes, float], None]) -> None:
        if self._show is None:
            self._surface.add_device(SCENE, self, period)
        else:
            self._surface.channel.watch(SCENE, ("value",), period)
        self._show = show

    def end(self) -> None:
        if self._show is not None:
            self._surface.channel.watch(SCENE, ("value",), None)

    def model(self) -> Path:
        return Path(self._surface.world.model)

    def show(self, value: Any, stamp: float) -> None:
        """Show a sample (``Shown``)."""
        if self._show is not None:
            self._show(value, stamp)

    def mark_stale(self) -> None:
        """The simulation is gone: the last picture stays."""
