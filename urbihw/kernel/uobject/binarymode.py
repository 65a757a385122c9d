"""A connection in binary mode: frames instead of statements, handled one after the other by the lobby's main job."""

from __future__ import annotations

import logging
from collections import deque
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.sched.waiting import WaitQueue
from urbihw.kernel.uobject.frames import LIMIT, BadFrame, Decoder, Emit, Frame, Program, Result, SlotName, Update
from urbihw.kernel.uobject.uvalue import to_urbi
from urbihw.kernel.uobject.uvar import UVar

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.connection import Connection

log = logging.getLogger("urbihw.uobject")

MOST_WAITING = 2 * LIMIT
"""How many bytes may wait for a statement of the same connection to end."""


class _Intake:
    """The frames that came and were not handled yet."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._decoder = Decoder()
        self._waiting = WaitQueue(connection.world.scheduler)
        self._frames: deque[Frame] = deque()
        self._bytes = 0

    def feed(self, data: bytes) -> None:
        """Bytes of the client."""
        self._bytes += len(data)
        try:
            self._frames.extend(self._decoder.feed(data))
        except BadFrame as error:
            self._give_up(f"not understood: {error}")
            return
        if self._decoder.skipped:
            log.warning("remote %s: unknown code %s skipped", self._name(), self._decoder.skipped[-1])
            self._decoder.skipped.clear()
        if self._bytes > MOST_WAITING and len(self._frames) > 1:
            self._give_up(f"{self._bytes} bytes wait for a statement of it to end")
        self._waiting.wake_one()

    def _name(self) -> str:
        return str(self._connection.lobby.tag.tag.name)

    def _give_up(self, reason: str) -> None:
        log.warning("remote %s closed: %s", self._name(), reason)
        lobby = self._connection.lobby
        lobby.output.line(f"!!! binaryMode: {reason}", "error")
        lobby.quit()

    def get(self) -> Frame:
        """The next frame, when it has come."""
        while not self._frames:
            self._bytes = 0
            self._waiting.wait()
        return self._frames.popleft()


def binary_mode(world: World, connection: Connection, on: bool, tag: str) -> None:
    """``binaryMode(on, tag)``: from now on the running job, the lobby's own, handles frames and nothing else."""
    lobby = connection.lobby
    lobby.output.line("true" if on else "false", tag)
    if not on:
        if connection.binary:
            lobby.output.line("!!! there is no way back from binary mode", "warning")
        return
    if connection.binary:
        return
    connection.binary = True
    intake = _Intake(connection)
    lobby.intake = intake.feed
    while True:
        frame = intake.get()
        world.scheduler.running().renew()
        try:
            _handle(world, connection, frame)
        except Exception as error:
            lobby.report(error)


def _handle(world: World, connection: Connection, frame: Frame) -> None:
    if isinstance(frame, Update):
        connection.update(_var(world, connection, frame.name), value_of(world, connection, frame.value), frame.stamp)
    elif isinstance(frame, Result):
        connection.answer(frame.ticket, value_of(world, connection, frame.value))
    elif isinstance(frame, Emit):
        _event(connection, frame.name).emit([value_of(world, connection, value) for value in frame.payload])
    elif isinstance(frame, Program):
        connection.lobby.execute(frame.text)


def value_of(world: World, connection: Connection, value: Any) -> Any:
    """The urbiscript value for one of a frame; raises ``lookup failed`` for an object that is not there."""
    if isinstance(value, SlotName):
        return connection.registry.object(value.name)
    if isinstance(value, list):
        return world.new_list([world.nil if one is None else value_of(world, connection, one) for one in value])
    if isinstance(value, dict):
        return world.dictionary(
            {key: world.nil if one is None else value_of(world, connection, one) for key, one in value.items()}
        )
    return to_urbi(world, value)


def _var(world: World, connection: Connection, name: str) -> UVar:
    path, _, slot = name.rpartition(".")
    if not path:
        raise errors.lookup_failed(name)
    holder = world.as_obj(connection.registry.object(path))
    if slot not in holder.slots:
        raise errors.lookup_failed(slot)
    found = holder.slots[slot]
    return found if isinstance(found, UVar) else UVar(world, holder, slot, value=found)


def _event(connection: Connection, name: str) -> Event:
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
