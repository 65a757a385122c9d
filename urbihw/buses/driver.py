"""Drivers of protocol families: the base class, and the look-up by name."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping
from typing import Any, Final, NamedTuple

from urbihw.buses.errors import BadValue, BusError, LinkGone
from urbihw.buses.link import Port
from urbihw.buses.messages import Configure, FromWorker, Limit, Refused, Reply, Request, Targets, Watch
from urbihw.buses.readings import Quantity, Reading, reading_of

# Protocol family -> driver class. The driver of a single robot lives in its platform and is named "module:Class".
FAMILIES: Final = {"servos": "urbihw.buses.servos.driver:ServoDriver"}
ENTRY_POINTS: Final = "urbihw.families"
"""Group under which other packages add rows to FAMILIES."""


class ImpliedTarget(NamedTuple):
    """A target that is the consequence of a request.

    Attributes:
        device, item: what is written.
        value: the raw value; nan if unknown: then any limit of it is exceeded.
        rate: how fast it changes, counts per second; 0 if that is not of interest.
    """

    device: Any
    item: str
    value: Any
    rate: float = 0.0


def no_stop() -> bool:
    """The default of `urgent`: no stop is waiting."""
    return False


class Driver:
    """Base of the drivers of protocol families.  Methods that return a list return the messages to post.

    The engine calls `configure` first, and again for new settings; it raises BadValue or BadSetting. `attach` gets an
    open port and finds the devices; when it raises Unavailable (no answer, wrong firmware) the engine tries again
    later. `detach` reports that the port is closed. Between the two the engine calls `tick`, `targets`, `watch`,
    `request` and `safe_stop`; all of them may raise LinkGone. `targets`, `watch` and `request` may also be called
    without a port. `targets` calls `set_target` for each, and `request` calls `execute_request`: a driver implements
    these two. `errors` counts failures since `attach`. Watches outlive the port, targets do not. `tick` should call
    `meanwhile` while the wire is busy, must not block for longer than a tick, and returns early between two
    transactions when `urgent()`.

    Attributes:
        slow_verbs: requests during which the cycle pauses on purpose.
        halted: set by the driver during a tick when its motion has ended for a reason of the device (the base was
            switched off by hand); the engine treats it as a stop with this reason.
        logs_in: whether it may send a password through its port: its bytes are then neither kept nor given to those who
            record.
        can_move: whether its devices can move: then a worker that dies is replaced at once, by a spare one.
        knows_motion: whether the devices tell if they move, so that `stop_what_moves` knows.
        url_parameters: parameters of the url that are meant for the robot; the port is opened without them.
        device_info: the frozen dataclass that describes a device in `Found`; None if the next run has no use for it.
        identity: what tells the robot that `attach` has found from others of its kind, such as its serial number; "" if
            nothing does. The engine stops everything when another robot answers than the last time.
        quantities: item -> what it measures, for `reading`.
        exclusive: items of a device of which the one that is written last counts: a motor goes to a place, or turns at
            a speed. What was asked of the others before is over.
    """

    slow_verbs: frozenset[str] = frozenset()
    logs_in: bool = False
    can_move: bool = True
    knows_motion: bool = False
    url_parameters: frozenset[str] = frozenset()
    halted: str = ""
    stopped_devices: Mapping[Any, str] = {}
    device_info: type | None = None
    identity: str = ""
    quantities: Mapping[str, Quantity] = {}
    exclusive: frozenset[str] = frozenset()

    def configure(self, settings: Configure) -> None:
        """Apply settings.  Raises BadValue, BadSetting."""
        raise NotImplementedError

    def expect_devices(self, devices: tuple[Any, ...]) -> None:
        """Called before the first `attach` with what an earlier worker found on this wire."""

    def attach(self, port: Port) -> list[FromWorker]:
        """Find the devices on an open port.  Raises Unavailable, LinkGone."""
        raise NotImplementedError

    def detach(self) -> None:
        """Release the port, which is closed: pending targets are dropped, watches stay."""
        raise NotImplementedError

    def tick(self, now: float, meanwhile: Callable[[], None], urgent: Callable[[], bool] = no_stop) -> list[FromWorker]:
        """Execute one tick: write targets, read what is due.  Raises LinkGone."""
        raise NotImplementedError

    def targets(self, message: Targets) -> list[FromWorker]:
        """Accept targets for the next tick; return a `Refused` for each that is not.  Raises LinkGone."""
        refused: list[FromWorker] = []
        for (device, item), value in message.values.items():
            try:
                self.set_target(device, item, value)
            except BadValue as error:
                refused.append(Refused(device, item, str(error)))
        return refused

    def set_target(self, device: Any, item: str, value: Any) -> None:
        """Accept one target for the next tick; without a port it is dropped.  Raises BadValue, LinkGone."""
        raise NotImplementedError

    def watch(self, message: Watch, now: float) -> list[FromWorker]:
        """Begin, change or end a watch.  By default nothing happens: each tick reads everything."""
        return []

    def request(self, message: Request) -> list[FromWorker]:
        """Execute a request once; its `Reply` may come in a later tick.  Raises LinkGone."""
        try:
            return self.execute_request(message)
        except LinkGone:
            raise
        except BusError as error:
            return [Reply(message.reply_id, False, error=str(error))]

    def execute_request(self, message: Request) -> list[FromWorker]:
        """Execute a request; return its `Reply`, if it is there already.  Raises BusError with the reason why not."""
        raise NotImplementedError

    def safe_stop(self, devices: tuple[Any, ...] | None = None) -> None:
        """Stop the robot, or these devices, and drop their targets.  Raises LinkGone.

        With None the stop goes to everything that is present, whether or not this driver has moved it: another master
        may have set it moving.
        """
        raise NotImplementedError

    def waits_for_parent(self) -> bool:
        """Return whether nothing moves until the parent has answered, however long it is silent: a simulation does."""
        return False

    def stop_again(self) -> None:
        """Called several times a second while an emergency stop holds: stop what another master sets moving meanwhile.

        It must not block for longer than a tick; override it where the full stop takes longer.  Raises LinkGone.
        """
        self.safe_stop()

    def stop_on_reconnect(self) -> tuple[Any, ...]:
        """Called after each `attach` but the first: stop the devices that this driver has moved, and others that move.

        Returns the devices that moved though this driver had not moved them, as far as it can tell: another robot may
        have been plugged in. Raises LinkGone.
        """
        self.safe_stop()
        return ()

    def stop_what_moves(self) -> tuple[Any, ...]:
        """Called after the first `attach`: stop devices that already move; return which ones these were.

        Raises LinkGone.
        """
        return ()

    def moves(self, device: Any, item: str, value: Any) -> bool:
        """Whether this target may set something in motion."""
        raise NotImplementedError

    def request_moves(self, request: Request) -> bool:
        """Whether this request may set something in motion."""
        raise NotImplementedError

    def implied_targets(self, request: Request) -> Iterable[ImpliedTarget]:
        """Return the targets that a request writes by itself: it is refused if one of them is beyond a limit."""
        return ()

    def unheld_target(self, device: Any, item: str, value: Any, limits: Mapping[tuple[Any, str], Limit]) -> str:
        """Return why a target cannot be held within these limits, so that it is refused; "" if it can."""
        return ""

    def unheld_request(self, request: Request, limits: Mapping[tuple[Any, str], Limit]) -> str:
        """Return why a request cannot be held within these limits, so that it is refused; "" if it can."""
        return ""

    def rests(self, request: Request, at: int) -> bool:
        """Whether the write at this place of several lets the device stand, then and after all: no limit changes it.

        In another mode, before or after, the same value may stand for the greatest speed.
        """
        return False

    def displaced(self, request: Request) -> tuple[Any, ...]:
        """Return the devices that may be elsewhere than at their last targets after this request.

        Their torque was off, or the request itself tells their motors what to do.
        """
        return ()

    def limits_changed(self, limits: Mapping[tuple[Any, str], Limit]) -> None:
        """Called with the limits of targets, at first and after each change."""

    def regains_force(self, device: Any, item: str, value: Any) -> bool:
        """Whether this target gives a joint the force back that it was without: it stays where it is then."""
        return False

    def pose(self, device: Any, item: str) -> float | None:
        """Return the position of a device in the unit of the target `item`, nan while it is unknown.

        None for an item that is not a position.  A target that may change only slowly waits until it is known.
        """
        return None

    def reach(self, device: Any, item: str, pace: float, now: float) -> tuple[float, float] | None:
        """Return the lowest and the highest target with which a joint turns no faster than `pace` when it is let go.

        None for what needs no such bounds, such as a drive that plans its way itself; nan while its position is
        unknown. `pace` is in units of the target per second.
        """
        return None

    def joints(self) -> Iterable[tuple[Any, str]]:
        """Return (device, item) of the goals that a device keeps by a force that does not know of any speed.

        When it was forced away and is let go, it comes back as fast as it can, unless its goal was led there.
        """
        return ()

    def lead(self, goals: Mapping[tuple[Any, str], Any]) -> None:
        """Set goals of `joints` that go along with what was forced away, or lead it back: no motion that was asked for.

        Raises LinkGone.
        """

    def standing_goal(self, device: Any, item: str) -> float | None:
        """Return the goal by which one of the `joints` stands, nan while it is unknown; None for what is limp, or no
        joint."""
        return None

    def signed(self, device: Any, item: str, raw: Any) -> float:
        """Return a raw target as a signed number, for comparison with limits; `raw_of` is the inverse.

        Override it where the register has a sign bit instead of two's complement.
        """
        return float(raw)

    def raw_of(self, device: Any, item: str, signed: float) -> Any:
        """Return the raw target of a signed number: the inverse of `signed`."""
        return round(signed)

    def reading(self, device: Any, item: str, raw: Any) -> Reading | None:
        """Return a measured value or a target in SI units; None for an item that tells nothing of the health.

        By default the row of `quantities`; override it where devices differ.
        """
        return reading_of(self.quantities, item, raw)

    def errors(self) -> dict[str, int]:
        """Return the number of failures since `attach`, by kind."""
        raise NotImplementedError

    def turnaround(self) -> float:
        """Return the mean time in s that a device takes to answer, without that of the bytes; 0 if unknown."""
        return 0.0


def driver_of(family: str) -> Driver:
    """Return a fresh driver of a row of FAMILIES, or of "module:Class". Raises BadValue when there is none."""
    row = FAMILIES.get(family, family)
    if ":" not in row:
        # Imported here because it costs a worker 15 ms of its start, and most never need it.
        from importlib.metadata import entry_points

        rows = {**{entry.name: entry.value for entry in entry_points(group=ENTRY_POINTS)}, **FAMILIES}
        row = rows.get(family, "")
        if not row:
            raise BadValue(f"unknown protocol family {family!r}; known: {', '.join(sorted(rows))}")
    module_name, _, class_name = row.partition(":")
    found: Driver = getattr(importlib.import_module(module_name), class_name)()
    return found
