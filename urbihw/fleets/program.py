"""``urbihw.fleet("school")``: the robots of a fleet as Python objects, in the words of urbiscript.

::

    with urbihw.fleet("school", name="teacher") as school:
        school.robots                           # ["alice", "bob"]
        school["alice"].sonar.val               # the last value that alice has published
        school["alice"].wheels.speed = 100      # if fleet_drive of alice names the teacher
        school["alice"].robot.go(0.5)
        school.each(lambda robot: robot.robot.stop())
        school.estop()                          # all of them, held until school.release()
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from types import TracebackType
from typing import Any, Final

from urbihw.fleets.line import ANSWER_TIMEOUT_S, FleetError, FleetLine, StopTold
from urbihw.fleets.names import ALL, DEFAULT_ENDPOINT, checked_fleet_name

MOST_THREADS: Final = 32


class FleetProgram:
    """The fleet of a program, for any number of threads."""

    def __init__(self, line: FleetLine) -> None:
        self.line = line

    @property
    def robots(self) -> list[str]:
        """The names of the robots that are there now."""
        return self.line.robots()

    def __getitem__(self, name: str) -> FleetRobot:
        """A robot by its name.  Raises FleetTimedOut if it is not there."""
        return FleetRobot(self.line, checked_fleet_name(name), self.line.info(name))

    def __iter__(self) -> Iterator[FleetRobot]:
        """The robots that are there now."""
        return (self[name] for name in self.robots)

    def each(self, work: Callable[[FleetRobot], Any]) -> dict[str, Any]:
        """Call a function with each robot, at the same time for all; what it returned, by the robot's name.

        If it fails for some, all others go on; then an ExceptionGroup has the errors.
        """
        names = self.robots
        if not names:
            return {}
        with ThreadPoolExecutor(min(MOST_THREADS, len(names))) as pool:
            begun = [(name, pool.submit(lambda name: work(self[name]), name)) for name in names]
        errors = [error for _, each in begun if isinstance(error := each.exception(), Exception)]
        if errors:
            raise ExceptionGroup("some robots failed", errors)
        return {name: each.result() for name, each in begun}

    def estop(self) -> StopTold:
        """Stop all robots and hold them; each one's bus worker confirms it."""
        return self.line.stop("estop")

    def release(self) -> StopTold:
        """Release the emergency stop of this name."""
        return self.line.stop("release")

    def watch(self, robot: str = ALL, timeout: float = 5.0) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """Iterate over what robots publish: ``for name, values in school.watch()``; it ends after so many seconds
        without any."""
        return ((name, told["v"]) for name, told in self.line.watch(robot, timeout))

    def close(self) -> None:
        """Leave the fleet: what this program moves stops."""
        self.line.close()

    def __enter__(self) -> FleetProgram:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class FleetPart:
    """A part of a far robot by its path: attributes that are slots are values, others are parts; a function is called.

    Raises AttributeError, which names the robot, for what it has not.
    """

    name: str
    _line: FleetLine
    _info: Mapping[str, Any]
    _path: str

    def __init__(self, line: FleetLine, name: str, info: Mapping[str, Any], path: str = "") -> None:
        for key, value in (("_line", line), ("name", name), ("_info", info), ("_path", path)):
            object.__setattr__(self, key, value)

    def __getattr__(self, slot: str) -> Any:
        if slot.startswith("__"):
            raise AttributeError(slot)
        path = f"{self._path}.{slot}" if self._path else slot
        if path in self._info["slots"]:
            return self._line.value(self.name, path)["value"]
        begin = f"{path}."
        if path in self._info["calls"] or any(
            known.startswith(begin) for kind in ("slots", "calls") for known in self._info[kind]
        ):
            return FleetPart(self._line, self.name, self._info, path)
        raise AttributeError(f"{self.name} has no {path}")

    def __setattr__(self, slot: str, value: float) -> None:
        """Write a slot: the robot must let this one drive.  Raises FleetError."""
        path = f"{self._path}.{slot}" if self._path else slot
        if not self._info["slots"].get(path, {}).get("effector"):
            raise AttributeError(f"{self.name} has no effector {path}")
        self._line.write(self.name, {path: value})

    def __call__(self, *args: Any, timeout: float = ANSWER_TIMEOUT_S) -> Any:
        """Call the function of this path, and wait for its end.  Raises FleetError."""
        if self._path not in self._info["calls"]:
            raise FleetError(f"{self.name}: {self._path or 'the robot'} is no function that others may call")
        return self._line.call(self.name, self._path, *args, timeout=timeout)

    def __dir__(self) -> list[str]:
        begin = f"{self._path}." if self._path else ""
        known = [*self._info["slots"], *self._info["calls"]]
        return sorted({path[len(begin) :].partition(".")[0] for path in known if path.startswith(begin)})

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.name}{'.' if self._path else ''}{self._path}>"


class FleetRobot(FleetPart):
    """A robot of the fleet."""


def fleet(fleet: str = "", name: str = "", endpoint: str = DEFAULT_ENDPOINT) -> FleetProgram:
    """Join a fleet; ``fleet`` "" is the only one there, ``name`` who asks (the user), for rights and for the log.

    Raises NoMeeting where no fleet meets, FleetError if there are several, ValueError for impossible names.
    """
    return FleetProgram(FleetLine(fleet, name, endpoint))
