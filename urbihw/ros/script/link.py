"""The process with the node, as the kernel sees it: started when it is needed, asked while the job waits.

A process that has ended is started again by the next call; topics and services of the one before are over.
"""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import sys
import threading
import weakref
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, Protocol

from urbihw.extras import install_command
from urbihw.kernel.library import Completion, SocketChannel, SocketStream, WaitQueue, World, errors, pipes_of
from urbihw.ros.errors import RosError
from urbihw.ros.orders import Order, OrderReader, PeerChange, RosAnswer, Said, ServiceAsked, TopicMessage, packed

log = logging.getLogger("urbihw.ros")

MAX_UNSENT_BYTES: Final = 64 << 20
"""Bytes that wait for the process, above which a call is refused."""
MAX_STUCK_BYTES: Final = 4 * MAX_UNSENT_BYTES
"""Bytes that wait for the process, above which it is ended."""


class RosListener(Protocol):
    """An object that what the process says is for."""

    def hear(self, link: RosLink, said: TopicMessage | PeerChange | ServiceAsked) -> None:
        """Something has come.  Who gets a TopicMessage calls ``link.taken`` when it is handled."""
        ...

    def lose(self) -> None:
        """The process has ended."""
        ...


class RosLink:
    """The process, and what waits for it.  All methods belong to the kernel's thread."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._channel: SocketChannel | None = None
        self._reader = OrderReader()
        self._starting = False
        self._started = WaitQueue(world.scheduler)
        self._last_number = 0
        self._answers: dict[int, Completion[Any]] = {}
        self._listeners: dict[int, RosListener] = {}
        self._untaken: dict[int, tuple[str, int]] = {}
        """Messages by the identity of what was heard: the topic, and how many have not handled it."""

    # ---------------------------------------------------------------- for objects

    def new_handle(self) -> int:
        """A number for an object."""
        self._last_number += 1
        return self._last_number

    def listen(self, handle: int, listener: RosListener) -> None:
        """Tell an object what comes for its handle, until ``forget``."""
        self._listeners[handle] = listener

    def forget(self, handle: int) -> None:
        """Tell an object nothing any more."""
        self._listeners.pop(handle, None)

    def ask(self, verb: str, *arguments: Any) -> Any:
        """The answer to an order; the running job waits.  Raises Exception.Primitive with the reason of a refusal."""
        self._ensure_process()
        number = self.new_handle()
        waiting: Completion[Any] = Completion(self._world.scheduler)
        try:
            self._send(Order(number, verb, arguments), MAX_UNSENT_BYTES)
        except RosError as error:
            raise errors.primitive(str(error)) from error
        self._answers[number] = waiting
        try:
            return waiting.wait()
        finally:
            self._answers.pop(number, None)
            if not waiting.done:
                self.tell("cancel", number)

    def tell(self, verb: str, *arguments: Any) -> None:
        """Send an order without waiting; without a process it is dropped.

        A process that does not keep up is ended: one that has missed an order would be out of step.
        """
        if self._channel is not None and not self._channel.over:
            try:
                self._send(Order(self.new_handle(), verb, arguments), MAX_STUCK_BYTES)
            except RosError as error:
                self._give_up(error)

    def respond(self, call: int, response: Any, refusal: str = "") -> None:
        """Answer a request to an offered service, or tell why there is no answer."""
        try:
            packed(Order(0, "respond", (call, response, refusal)))
        except RosError as error:
            response, refusal = {}, str(error)
        self.tell("respond", call, response, refusal)

    def taken(self, said: TopicMessage) -> None:
        """One of the listeners has handled a message; one of a process that has ended does not count."""
        topic, left = self._untaken.pop(id(said), ("", 0))
        if not topic:
            return
        if left > 1:
            self._untaken[id(said)] = topic, left - 1
        else:
            self.tell("taken", topic)

    # ---------------------------------------------------------------- the process

    def _send(self, order: Order, limit: int) -> None:
        """Raises RosError if more than ``limit`` bytes wait."""
        assert self._channel is not None
        if self._channel.unsent > limit:
            raise RosError("the ROS process does not keep up")
        self._channel.send(packed(order))

    def _ensure_process(self) -> None:
        while self._starting:
            self._started.wait()
        if self._channel is not None and not self._channel.over:
            return
        if find_spec("rosbags") is None:
            raise errors.primitive(f"Ros needs a package: {install_command('ros')}")
        self._starting = True
        try:
            stream = pipes_of(self._world).starter.run_work(_start)
            self._attach(stream)
        except OSError as error:
            raise errors.primitive(f"cannot start the ROS process: {error.strerror}") from error
        finally:
            self._starting = False
            self._started.wake_all()

    def _attach(self, stream: SocketStream) -> None:
        own, scheduler = weakref.ref(self), self._world.scheduler

        def read() -> None:
            link = own()
            if link is not None:
                link._read(channel)

        channel = self._channel = SocketChannel(pipes_of(self._world).poller, stream, lambda: scheduler.post(read))
        self._reader = OrderReader()
        weakref.finalize(self, channel.abort)
        channel.start()

    def _read(self, channel: SocketChannel) -> None:
        """Handle what has come, and the end of the process."""
        if channel is not self._channel:
            return
        try:
            while data := channel.take_received():
                channel.count_handled(len(data))
                for said in self._reader.feed(data):
                    self._handle(said)
        except Exception as error:  # the kernel must go on
            log.exception("our bug: the ROS process says what cannot be handled")
            self._give_up(error)
        if channel.over and channel is self._channel:
            log.warning("the ROS process has ended")
            self._lose_process()

    def _give_up(self, error: Exception) -> None:
        """End a process that cannot be used any more."""
        log.warning("the ROS process is ended: %s", error)
        channel = self._channel
        self._lose_process()
        if channel is not None:
            channel.abort()

    def _lose_process(self) -> None:
        self._channel = None
        for answer in list(self._answers.values()):
            answer.fail(errors.primitive("the ROS process has ended: see the log"))
        for listener in list(self._listeners.values()):
            listener.lose()
        self._listeners.clear()
        self._untaken.clear()

    def _handle(self, said: Said) -> None:
        if isinstance(said, RosAnswer):
            waiting = self._answers.get(said.number)
            if waiting is not None and said.refusal:
                waiting.fail(errors.primitive(said.refusal.encode().decode("latin-1")))
            elif waiting is not None:
                waiting.complete(said.value)
        elif isinstance(said, TopicMessage):
            found = [self._listeners[each] for each in said.handles if each in self._listeners]
            self._untaken[id(said)] = said.topic, len(found)
            for listener in found:
                listener.hear(self, said)
            if not found:
                self.taken(said)
        elif isinstance(said, PeerChange | ServiceAsked):
            listener_of = self._listeners.get(said.handle)
            if listener_of is not None:
                listener_of.hear(self, said)
            elif isinstance(said, ServiceAsked):
                self.respond(said.call, {}, "the service has ended")


def ros_link(world: World) -> RosLink:
    """The link of a world; nothing is started by it."""
    if not world.has_part(RosLink):
        world.install_part(RosLink(world))
    return world.part(RosLink)


def _start() -> SocketStream:
    """Start a process; the kernel's end of the socket.  Raises OSError."""
    mine, theirs = socket.socketpair()
    # The child must find the same urbihw, from wherever it was imported here.
    root = str(Path(__file__).resolve().parents[3])
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    with theirs:
        process = subprocess.Popen(
            (sys.executable, "-m", "urbihw.ros.worker", str(theirs.fileno())),
            pass_fds=(theirs.fileno(),), stdin=subprocess.DEVNULL, start_new_session=True,
            env={**os.environ, "PYTHONPATH": path},
        )  # fmt: skip
    # Its end must be noted by the system, whenever that is.
    threading.Thread(target=process.wait, name="urbihw-ros", daemon=True).start()
    mine.setblocking(False)
    return SocketStream(mine.detach(), ("ros", 0), ("ros", 0))
