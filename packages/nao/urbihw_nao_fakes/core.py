"""Small services of NAOqi's core: ALLogger, ALFrameManager, ALAutonomousLife."""

from __future__ import annotations

from urbihw_nao_fakes.services import Failed, Service, method

LEVELS = ("silent", "fatal", "error", "warning", "info", "verbose", "debug")
"""The levels of `setVerbosity`, by their number."""
STATES = ("solitary", "interactive", "disabled", "safeguard")


class Logger(Service):
    """ALLogger.  ``lines`` are its entries: level, module, text."""

    name = "ALLogger"

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[tuple[str, str, str]] = []
        self._verbosity = LEVELS.index("info")

    @method("fatal", "(ss)")
    def log_fatal(self, module: str, text: str) -> None:
        """A module, and what it has to tell."""
        self.lines.append(("fatal", module, text))

    @method("error", "(ss)")
    def log_error(self, module: str, text: str) -> None:
        """Log an error of a module."""
        self.lines.append(("error", module, text))

    @method("warn", "(ss)")
    def log_warning(self, module: str, text: str) -> None:
        """Log a warning of a module."""
        self.lines.append(("warning", module, text))

    @method("info", "(ss)")
    def log_info(self, module: str, text: str) -> None:
        """Log a remark of a module."""
        self.lines.append(("info", module, text))

    @method("debug", "(ss)")
    def log_debug(self, module: str, text: str) -> None:
        """Log a detail of a module."""
        self.lines.append(("debug", module, text))

    @method("setVerbosity", "(i)")
    def set_verbosity(self, level: int) -> None:
        """Up to which level lines are shown.  Raises Failed."""
        if not 0 <= level < len(LEVELS):
            raise Failed(f"ALLogger: no level {level}")
        self._verbosity = level

    @method("verbosity", "()", "i")
    def get_verbosity(self) -> int:
        """The level up to which entries count."""
        return self._verbosity


class FrameManager(Service):
    """ALFrameManager: behaviours by files, of which this robot has none."""

    name = "ALFrameManager"

    @method("behaviors", "()", "[s]")
    def get_behaviours(self) -> list[str]:
        """The identifiers of those that are loaded."""
        return []

    @method("playBehavior", "(s)")
    @method("exitBehavior", "(s)")
    def use_behaviour(self, identifier: str) -> None:
        """Raises Failed: no behaviour is installed there."""
        raise Failed(f"ALFrameManager: no behavior {identifier}")


class AutonomousLife(Service):
    """ALAutonomousLife: a robot that does nothing by itself, whatever its state."""

    name = "ALAutonomousLife"

    def __init__(self) -> None:
        super().__init__()
        self.state = "disabled"

    @method("getState", "()", "s")
    def get_state(self) -> str:
        """One of `STATES`."""
        return self.state

    @method("setState", "(s)")
    def set_state(self, state: str) -> None:
        """Change the state of autonomous life.  Raises Failed for an unknown one."""
        if state not in STATES:
            raise Failed(f"ALAutonomousLife: no state {state}")
        self.state = state
