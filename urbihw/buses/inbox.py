"""What a worker receives: the messages of its parent and the commands of its control socket, in three queues.

Stops have a queue of their own, because they overtake everything else.  An emergency stop also drops the releases that
wait in the other queues: it is newer, so they must not end it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

from urbihw.buses.clock import BusClock
from urbihw.buses.control import ControlSocket
from urbihw.buses.control_client import ESTOP, RELEASE, STOP, ControlCommand
from urbihw.buses.mailbox import Mailbox
from urbihw.buses.messages import EmergencyStop, Release, Stop, ToWorker


class Inbox:
    """The queues of a worker; `state` returns the fields of the answer to a dropped command.

    Attributes:
        urgent: stops of the whole robot, in order of arrival.
        messages: the other messages of the parent.
        commands: the other commands of the control socket.
        heard_at: when a message of the parent was last read, in seconds of the worker's clock.
        dropped_order: the number of the last release of the parent that was dropped (``Latched.order``).
    """

    def __init__(
        self, mailbox: Mailbox, control: ControlSocket | None, clock: BusClock, state: Callable[[], Mapping[str, Any]]
    ) -> None:
        self.urgent: deque[Stop | EmergencyStop | ControlCommand] = deque()
        self.messages: deque[ToWorker] = deque()
        self.commands: deque[ControlCommand] = deque()
        self.heard_at = self._excused_at = clock.now()
        self.dropped_order = 0
        self._longest_silence = (0.0, 0.0)
        self._mailbox = mailbox
        self._control = control
        self._clock = clock
        self._state = state

    def receive(self, until: float) -> bool:
        """Wait until something arrives, or until a time; queue it. Return whether something arrived."""
        ready = self._clock.wait_readable(self.descriptors(), until)
        if not ready:
            return False
        if self._mailbox.fd in ready:
            self._receive_messages()
        if self._control is not None:
            self._receive_commands(self._control.poll(ready))
        return True

    def is_urgent(self) -> bool:
        """Return whether a stop has arrived; a driver calls this between two transactions."""
        self.receive(0.0)
        return bool(self.urgent)

    def descriptors(self) -> list[int]:
        """Return the file descriptors on which something may arrive."""
        mine = [] if self._mailbox.ended else [self._mailbox.fd]
        return mine if self._control is None else mine + self._control.descriptors()

    def find_silence(self, bound: float, now: float) -> float | None:
        """Return since when the parent was silent for longer than `bound` seconds, None if it was not.

        This also counts the silence that ended since the last call.  It is judged before the messages that end it are
        read: when this process was held up too, they are the first it sees after the pause.
        """
        (silence, since), self._longest_silence = self._longest_silence, (0.0, 0.0)
        if silence > bound:
            return since
        return self.heard_at if now - self.heard_at > bound else None

    def excuse_pause(self) -> None:
        """Do not count until now: the worker did not read, since it executed something that takes long."""
        self._excused_at = self._clock.now()
        self._longest_silence = (0.0, 0.0)

    def _receive_messages(self) -> None:
        messages = self._mailbox.receive_messages()
        if messages:
            now = self._clock.now()
            silence = now - max(self.heard_at, self._excused_at)
            self._longest_silence = max(self._longest_silence, (silence, self.heard_at))
            self.heard_at = now
        for message in messages:
            if isinstance(message, EmergencyStop):
                self._drop_releases()
                self.urgent.append(message)
            elif isinstance(message, Stop) and message.devices is None:
                self.urgent.append(message)
            else:
                self.messages.append(message)

    def _receive_commands(self, commands: list[ControlCommand]) -> None:
        # Those that urge come last: a release of another client that came at the same moment may be the older one.
        for command in reversed(commands):
            if command.verb == ESTOP:
                self._drop_releases()
            (self.urgent if command.verb in (STOP, ESTOP) else self.commands).append(command)

    def _drop_releases(self) -> None:
        dropped = [message for message in self.messages if isinstance(message, Release)]
        self.dropped_order = max((self.dropped_order, *(message.order for message in dropped)))
        self.messages = deque(message for message in self.messages if not isinstance(message, Release))
        for command in [command for command in self.commands if command.verb == RELEASE]:
            self.commands.remove(command)
            command.answer(self._state())
