"""The link of a worker to its robot: tried again with back-off until it opens, closed when it fails."""

from __future__ import annotations

import errno
from collections.abc import Callable
from typing import Final

from urbihw import buses
from urbihw.backoff import BackOff
from urbihw.buses.driver import Driver
from urbihw.buses.errors import BadUrl, BusError, Unavailable
from urbihw.buses.link import Context, Port, split_parameters
from urbihw.buses.messages import FromWorker, LinkState
from urbihw.buses.reports import Reports

_FIRST_BACK_OFF_S: Final = 0.2
_LAST_BACK_OFF_S: Final = 1.0
_MISTAKES: Final = frozenset({errno.ENOTTY, errno.ENOPKG})
"""Failures to open a link that no robot mends: no serial port, or a package of this machine is missing."""


class RobotLink:
    """Opens the link of a driver, and tells its state to the parent whenever it changes.

    Attributes:
        port: the open link, None while there is none.
    """

    def __init__(self, url: str, driver: Driver, context: Context, reports: Reports) -> None:
        self._url, _ = split_parameters(url, driver.url_parameters)
        self._driver = driver
        self._context = context
        self._reports = reports
        self._announced: bool | None = None
        self._back_off = BackOff(_FIRST_BACK_OFF_S, _LAST_BACK_OFF_S)
        self._retry_at = context.clock.now()
        self.port: Port | None = None

    def is_due(self, now: float) -> bool:
        """Return True if the link is down and it is time to try to open it."""
        return self.port is None and now >= self._retry_at

    def open(self) -> list[FromWorker] | None:
        """Open the link and attach the driver; return what the driver tells, None if it failed.

        The caller reports that the link is up (`LinkState`), after it has stopped the robot.
        """
        try:
            port = buses.open(self._url, self._context)
        except (BadUrl, Unavailable) as error:
            self._close(str(error), isinstance(error, BadUrl) or error.errno in _MISTAKES)
            return None
        self.port = port
        self._reports.begin_traffic(port, kept=not self._driver.logs_in)
        messages: list[FromWorker] = []
        if not self.attempt(lambda: messages.extend(self._driver.attach(port))):
            return None
        port.before_wait = self._reports.post_heartbeat_before_wait
        self._back_off.reset()
        self._announced = True
        return messages

    def attempt(self, work: Callable[[], None]) -> bool:
        """Call `work`, which uses the link; close the link and return False when it raises a BusError.

        A driver lets only LinkGone out. Any other failure may have left its work half done, so the link is opened
        anew, which stops what moves; the worker goes on.
        """
        try:
            work()
        except BusError as error:
            self._close(str(error))
            return False
        return True

    def end(self) -> None:
        """Close the link for good."""
        if self.port is not None:
            self.port.close()

    def _close(self, reason: str, mistake: bool = False) -> None:
        port, self.port = self.port, None
        if port is not None:
            port.close()
            self._driver.detach()
        if self._announced is not False:
            self._announced = False
            self._reports.post([LinkState(False, reason, mistake)])
        self._retry_at = self._context.clock.now() + self._back_off.next_pause()
