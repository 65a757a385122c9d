"""What drives the wire of a protocol family: the base of all drivers, and how one is found by name."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.buses.link import Port
from urbihw.buses.messages import Configure, FromWorker, Request, Targets, Watch

# Protocol family of a wire -> what drives it. A family of one robot lives with it, and is named "module:Class".
FAMILIES: Final = {"dynamixel": "urbihw.buses.dynamixel.driver:DynamixelDriver"}


def never() -> bool:
    """Nothing is urgent."""
    return False


class Driver:
    """Base of what drives the wire of a protocol family.  Methods that return a list return the messages to post.

    `attach` is handed an open port and finds the devices, or raises Unavailable (nobody answers, wrong firmware), after
    which it is tried again later; `detach` is told that the port is gone. In between come `tick`, `targets`, `watch`,
    `request` and `safe_stop`; all but `detach` may raise LinkGone. `targets`, `watch` and `request` may also come
    while there is no port. `configure` comes first, and again for new settings; it raises BadValue or BadSetting.
    `errors` counts failures since `attach`. Watches must outlive the port, targets must not. `tick` should call
    `meanwhile` when the wire is busy, must not wait for longer than a tick lasts, and gives up between two transactions
    when `urgent()`.

    Attributes:
        slow_verbs: the requests for which the cycle rests on purpose.
        halted: set by the driver in a tick when what it was told to do is over (the base was switched off by hand);
            the engine then treats it as a stop, for this reason.
        url_parameters: what may stand in the url for the robot's sake; the port is opened without.
    """

    slow_verbs: frozenset[str] = frozenset()
    url_parameters: frozenset[str] = frozenset()
    halted: str = ""

    def configure(self, settings: Configure) -> None:
        """Take settings.  Raises BadValue, BadSetting."""
        raise NotImplementedError

    def expect(self, devices: tuple[Any, ...]) -> None:
        """Called before the first `attach` with what an earlier worker found on this wire."""

    def attach(self, port: Port) -> list[FromWorker]:
        """Find the devices on an open port.  Raises Unavailable, LinkGone."""
        raise NotImplementedError

    def detach(self) -> None:
        """The port is gone."""
        raise NotImplementedError

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = never) -> list[FromWorker]:
        """One tick.  Raises LinkGone."""
        raise NotImplementedError

    def targets(self, message: Targets) -> list[FromWorker]:
        """Take targets for the next tick.  Raises LinkGone."""
        raise NotImplementedError

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Begin, change or end a watch."""
        raise NotImplementedError

    def request(self, message: Request) -> list[FromWorker]:
        """Do something once.  Raises LinkGone."""
        raise NotImplementedError

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop the robot, or these devices, and forget their targets.  Raises LinkGone."""
        raise NotImplementedError

    def rest(self) -> None:
        """Called after each `attach` but the first: stop what we had set in motion.  Raises LinkGone."""
        self.safe_stop()

    def stop_what_moves(self) -> tuple[Any, ...]:
        """Called after the first `attach`: stop what somebody else has set in motion, and tell which devices that were.

        Raises LinkGone.
        """
        return ()

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """Whether this target may set something in motion."""
        raise NotImplementedError

    def request_moves(self, request: Request) -> bool:
        """Whether this request may set something in motion."""
        raise NotImplementedError

    def implied(self, request: Request) -> Mapping[tuple[Any, str], Any]:
        """The targets that a request sets past the targets, for those that can be limited."""
        return {}

    def pose(self, device: Any, item: str) -> float | None:
        """Where the device is, in the unit of the target `item`; None if that is no place, or not known."""
        return None

    def signed(self, device: Any, item: str, raw: Any) -> float:
        """A target as a number that grows with what it asks for, for comparing it with limits; `raw_of` is its inverse.

        A count is that by itself, unless it keeps its sign in a bit of its own.
        """
        return float(raw)

    def raw_of(self, device: Any, item: str, signed: float) -> Any:
        """See `signed`."""
        return round(signed)

    def errors(self) -> dict[str, int]:
        """Failures since `attach`, by kind."""
        raise NotImplementedError


def driver_of(family: str) -> Driver:
    """Return a fresh driver of a row of FAMILIES, or of "module:Class". Raises BadValue when there is none."""
    module_name, colon, class_name = FAMILIES.get(family, family).partition(":")
    if not colon:
        raise BadValue(f"unknown protocol family {family!r}; known: {', '.join(sorted(FAMILIES))}")
    found: Driver = getattr(importlib.import_module(module_name), class_name)()
    return found
