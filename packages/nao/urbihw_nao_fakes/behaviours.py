"""ALBehaviorManager: behaviours that are installed on the robot, each of which moves a joint or only takes time."""

from __future__ import annotations

from collections.abc import Callable

from urbihw_nao_fakes.body import Body
from urbihw_nao_fakes.services import Failed, Later, Service, method

INSTALLED: dict[str, tuple[str, float, float]] = {
    "animations/nod": ("HeadPitch", 0.3, 2.0),
    "animations/wave": ("RShoulderPitch", -1.0, 4.0),
    "dialog/wait": ("", 0.0, 60.0),
}
"""Name -> a joint, how far it swings (rad, half of it each second to each side), and how long it lasts in s."""


class Behaviours(Service):
    """ALBehaviorManager of a body; ``clock`` gives seconds.  ``finished`` and ``stopped`` are names, in their order."""

    name = "ALBehaviorManager"

    def __init__(self, body: Body, clock: Callable[[], float]) -> None:
        super().__init__()
        self.body, self._clock = body, clock
        self._started: dict[str, float] = {}
        self.finished: list[str] = []
        self.stopped: list[str] = []

    def advance(self, now: float) -> None:
        """Let the running behaviours move their joints, and end those whose time is over."""
        for name, started in list(self._started.items()):
            joint, swing, seconds = INSTALLED[name]
            if joint and self.body.joints[joint].stiffness > 0:
                self.body.joints[joint].order(swing if int(now - started) % 2 == 0 else -swing, 0.3)
            if now - started >= seconds:
                del self._started[name]
                self.finished.append(name)

    def is_active(self) -> bool:
        """Whether a behaviour runs at present."""
        return bool(self._started)

    @method("runBehavior", "(s)")
    def run(self, name: str) -> Later:
        """The answer comes at its end.  Raises Failed."""
        self.start(name)
        return Later(lambda: name not in self._started)

    @method("startBehavior", "(s)")
    def start(self, name: str) -> None:
        """The answer comes at once.  Raises Failed."""
        if name not in INSTALLED:
            raise Failed(f"ALBehaviorManager: behavior {name} is not installed\n\n    at albehaviormanager.cpp:231")
        if name in self._started:
            raise Failed(f"ALBehaviorManager: behavior {name} is already running")
        self._started[name] = self._clock()

    @method("stopBehavior", "(s)")
    def stop(self, name: str) -> None:
        """End one.  Raises Failed."""
        if self._started.pop(name, None) is None:
            raise Failed(f"ALBehaviorManager: behavior {name} is not running")
        self.stopped.append(name)

    @method("stopAllBehaviors")
    def stop_all(self) -> None:
        """End all behaviours that run."""
        for name in list(self._started):
            self.stop(name)

    @method("getRunningBehaviors", "()", "[s]")
    def get_running(self) -> list[str]:
        """The names of the behaviours that run."""
        return list(self._started)

    @method("getInstalledBehaviors", "()", "[s]")
    @method("getBehaviorNames", "()", "[s]")
    def get_installed(self) -> list[str]:
        """The names of the installed behaviours."""
        return list(INSTALLED)

    @method("isBehaviorInstalled", "(s)", "b")
    def is_installed(self, name: str) -> bool:
        """Whether there is one of this name."""
        return name in INSTALLED

    @method("isBehaviorRunning", "(s)", "b")
    def is_running(self, name: str) -> bool:
        """Whether a behaviour runs at present."""
        return name in self._started
