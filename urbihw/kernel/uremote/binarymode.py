"""A connection in binary mode: frames instead of statements, handled in order by the lobby's main job."""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.sched.arrivals import Arrivals
from urbihw.kernel.sched.signals import Interrupted, StopTag
from urbihw.kernel.sched.waiting import WaitQueue
from urbihw.kernel.uobject.uvalue import to_urbi
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uremote.frames import (
    MAX_FRAME_SIZE,
    VALUES_PER_STEP,
    BadBinaryFrame,
    BinaryDecoder,
    EmitRequest,
    Frame,
    ProgramText,
    Result,
    SlotName,
    Update,
)

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uremote.connection import RemoteConnection

log = logging.getLogger("urbihw.uobject")

MAX_WAITING_SIZE = 2 * MAX_FRAME_SIZE
"""Maximum number of bytes that wait for the end of a statement of the same connection."""


class _Intake:
    """The received, unhandled bytes; they are decoded only in the job that handles them."""

    def __init__(self, connection: RemoteConnection) -> None:
        self._connection = connection
        self._scheduler = connection.world.scheduler
        self._decoder = BinaryDecoder()
        self._more = WaitQueue(self._scheduler)
        self._skipped = False
        self._arrivals = Arrivals()
        self.ordered = 0
        """When the last frame was ordered (``Job.ordered``)."""

    def feed(self, data: bytes, ordered: int) -> None:
        """Add bytes that have come, and were ``ordered`` then (``Job.ordered``)."""
        self._decoder.add(data)
        self._arrivals.add(len(data), ordered)
        if self._decoder.waiting > MAX_WAITING_SIZE:
            self._give_up(f"{self._decoder.waiting} bytes wait for a statement of it to end")
        self._more.wake_one()

    def _give_up(self, reason: str) -> None:
        log.warning("remote %s closed: %s", self._connection.name, reason)
        lobby = self._connection.lobby
        lobby.output.line(f"!!! binaryMode: {reason}", "error")
        lobby.quit()

    def get(self) -> Frame:
        """Wait for the next frame and return it; invalid bytes end the connection."""
        while True:
            waiting = self._decoder.waiting
            try:
                frame = self._decoder.next()
            except BadBinaryFrame as error:
                self._give_up(f"not understood: {error}")
                frame = None
            if self._decoder.skipped and not self._skipped:
                self._skipped = True
                log.warning("remote %s: unknown code %s skipped", self._connection.name, self._decoder.skipped[0])
            self._decoder.skipped.clear()
            if waiting > self._decoder.waiting:
                self.ordered = self._arrivals.take(waiting - self._decoder.waiting)
            if frame is not None:
                return frame
            if not self._decoder.paused:
                self._more.wait()
            elif self._scheduler.ready:
                self._scheduler.yield_()


def binary_mode(world: World, connection: RemoteConnection, on: bool, tag: str) -> None:
    """``binaryMode(on, tag)``: from now on the running job, the lobby's own, handles frames and nothing else.

    Stopping one of its tags, or interrupting the job, ends only the handling of the present frame: there is no other
    job that could handle the next one.
    """
    lobby = connection.lobby
    lobby.output.line("true" if on else "false", tag)
    if not on:
        if connection.binary:
            lobby.output.line("!!! there is no way back from binary mode", "warning")
        return
    if connection.binary:
        return
    connection.binary = True
    input_handler = _Intake(connection)
    lobby.input_handler = input_handler.feed
    scheduler = world.scheduler
    while True:
        try:
            frame = input_handler.get()
            ordered = input_handler.ordered
            scheduler.running().begin_statement(ordered if lobby.ordered is None else min(ordered, lobby.ordered))
            _handle(world, connection, frame)
        except Exception as error:
            lobby.report(error)
        except (StopTag, Interrupted):
            if not lobby.connected:
                raise
        if scheduler.ready:
            scheduler.yield_()


def _handle(world: World, connection: RemoteConnection, frame: Frame) -> None:
    if isinstance(frame, Update):
        connection.update(_var(world, connection, frame.name), value_of(world, connection, frame.value), frame.stamp)
    elif isinstance(frame, Result):
        connection.answer(frame.ticket, value_of(world, connection, frame.value))
    elif isinstance(frame, EmitRequest):
        _event(connection, frame.name).emit([value_of(world, connection, value) for value in frame.payload])
    elif isinstance(frame, ProgramText):
        connection.lobby.execute(frame.text)


def value_of(world: World, connection: RemoteConnection, value: Any) -> Any:
    """The urbiscript value of a frame's value.  Raises ``lookup failed`` for an object that does not exist.

    A large value is converted in slices, between which other jobs get turns.
    """
    scheduler, made = world.scheduler, 0

    def one(value: Any) -> Any:
        nonlocal made
        made += 1
        if made % VALUES_PER_STEP == 0 and scheduler.ready:
            scheduler.yield_()
        if value.__class__ is float:
            return value
        if isinstance(value, SlotName):
            return connection.registry.object(value.name)
        if isinstance(value, list):
            return world.new_list([member(each) for each in value])
        if isinstance(value, dict):
            return world.dictionary({key: member(each) for key, each in value.items()})
        return to_urbi(world, value)

    def member(value: Any) -> Any:
        return world.nil if value is None else one(value)

    return one(value)


def _var(world: World, connection: RemoteConnection, name: str) -> UVar:
    path, _, slot = name.rpartition(".")
    if not path:
        raise errors.lookup_failed(name)
    holder = world.as_obj(connection.registry.object(path))
    if slot not in holder.slots:
        raise errors.lookup_failed(slot)
    found = holder.slots[slot]
    if not isinstance(found, UVar):
        raise errors.primitive(f"{name} is no variable of a device", "binaryMode")
    return found


def _event(connection: RemoteConnection, name: str) -> Event:
    path, _, slot = name.rpartition(".")
    world = connection.world
    try:
        holder = connection.registry.object(path)
    except errors.Raised:
        raise errors.primitive(f"no such UObject: {path}", "binaryMode") from None
    found = world.get_slot(holder, slot)
    if not isinstance(found, Event):
        raise world.type_error(None, found, "Event", "binaryMode")
    return found
