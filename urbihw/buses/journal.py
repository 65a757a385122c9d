"""All that happens in a worker, as events for those who record it by the control socket (``record``).

As long as no client records, nothing is made of what happens. A client that does not read loses the oldest events, and
the next one tells how many (`ControlClient.send_telemetry`): a recorder never holds a tick up.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from urbihw.buses.clock import BusClock
from urbihw.buses.control import ControlSocket
from urbihw.buses.events import message_event
from urbihw.buses.messages import Begin, Configure, FromWorker, Heartbeat, ToWorker, Watch, WorkerHeartbeat

_LEFT_OUT: Final = (Heartbeat, WorkerHeartbeat, Watch, Configure)
"""Messages that say nothing of the robot, or may contain a password."""
APPLIED: Final = "Applied"
"""The event of targets that the driver gets, after all limits."""


class WorkerJournal:
    """Sends the messages of both directions with the time at which they were handled, in seconds of the clock."""

    def __init__(self, control: ControlSocket | None, begin: Begin, clock: BusClock) -> None:
        self._control = control
        self._settings = begin.settings
        self._clock = clock

    def note(self, message: FromWorker | ToWorker) -> None:
        """Send a message of the worker, or of its parent."""
        if isinstance(message, Configure):
            self._settings = message
        control = self._control
        if control is None or not control.is_recorded or isinstance(message, _LEFT_OUT):
            return
        control.publish_record({**message_event(message), "at": self._clock.now()})

    def note_applied(self, values: Mapping[tuple[Any, str], Any]) -> None:
        """Send the targets that the driver gets now."""
        if self._control is not None and self._control.is_recorded:
            rows = [[device, item, value] for (device, item), value in values.items()]
            self._control.publish_record({"event": APPLIED, "values": rows, "at": self._clock.now()})

    def fields(self) -> dict[str, Any]:
        """Return what a client must know before the first event: the settings, without the options of the family,
        which may be passwords."""
        settings = self._settings
        return {
            "settings": {
                "rate": settings.rate,
                "dead_man": settings.dead_man,
                "torque_off_on_stop": settings.torque_off_on_stop,
                "resume": settings.resume,
            }
        }
