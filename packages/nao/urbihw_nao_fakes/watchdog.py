"""UrbihwWatchdog, hosted by the simulated robot: the program for real ones, loaded from its file."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

from urbihw_fakes.errors import UnknownRequest
from urbihw_nao_fakes.services import Failed, Method, Service, method


class Proxy:
    """The methods of a service by their names in NAOqi: what a program on the robot has."""

    def __init__(self, service: Service) -> None:
        self._service = service

    def __getattr__(self, name: str) -> Any:
        for each in self._service.methods.values():
            if each.name == name:
                return lambda *arguments: self._call(each, arguments)
        raise AttributeError(name)

    def _call(self, called: Method, arguments: tuple[Any, ...]) -> Any:
        """Raises RuntimeError, as libqi does."""
        try:
            return self._service.call(called, *arguments)
        except Failed as error:
            raise RuntimeError(str(error)) from error


class Watchdog(Service):
    """The service of the program in ``path``, which stops ``motion``; ``find_service`` gives others by their names.

    Raises:
        UnknownRequest: there is no such program.
    """

    name = "UrbihwWatchdog"

    def __init__(self, path: Path, motion: Service, find_service: Callable[[str], Service]) -> None:
        super().__init__()
        spec = importlib.util.spec_from_file_location("robot_watchdog", path)
        if spec is None or spec.loader is None or not path.is_file():
            raise UnknownRequest(f"{path}: there is no such program")
        program = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(program)
        self._watchdog = program.NaoWatchdog(Proxy(motion), lambda name: Proxy(find_service(name)))
        self._service = program.WatchdogService(self._watchdog)
        self._now = 0.0

    def is_active(self) -> bool:
        """See `Service`: it counts, or stops the robot."""
        return self._service.state() in ("fed", "stopping")

    def advance(self, now: float) -> None:
        self._watchdog.advance(now - self._now)
        self._now = now

    @method("feed", "(m)", "m")
    def feed(self, seconds: Any) -> None:
        """Renew the time.  Raises Failed."""
        try:
            self._service.feed(seconds)
        except (ValueError, TypeError) as error:
            raise Failed(f"ValueError: {error}") from error

    @method("release", "()", "m")
    def release(self) -> None:
        """Count the time down no longer."""
        self._service.release()

    @method("state", "()", "m")
    def tell_state(self) -> str:
        """One of off, fed, stopping, stopped."""
        return str(self._service.state())

    @method("version", "()", "m")
    def tell_version(self) -> str:
        """Version of the program."""
        return str(self._service.version())
