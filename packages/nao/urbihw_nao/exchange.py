"""What all parts of the driver share: the session, calls of which only one of a kind is under way, and what to tell."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import Any, Final

from urbihw.buses.errors import BadFrame, BadValue, LinkGone, Unavailable
from urbihw.buses.link import Port
from urbihw.buses.messages import FromWorker, Refused
from urbihw_nao.finding import NaoInfo
from urbihw_nao.options import NaoOptions
from urbihw_nao.qimessaging.session import QiCall, QiService, QiSession

CYCLE_TIMEOUT_S: Final = 1.0
"""Seconds in which NAOqi must answer in the cycle; then the link is given up."""
LINK_LOST: Final = "the link went down"
"""The error of calls that were under way when the link was lost."""


class NaoExchange:
    """One per driver.

    Attributes:
        options: the settings of the robot.
        info: the robot as it was found last.
        news: messages for the parent, sent with the next tick.
        values: what was measured, by device and item, sent with the next tick.
        now: the worker's clock, s.
        port: the port of the session; a twin of it leads to the same robot.
        written: when the targets were written that are being set, by the clock of their writer; None if unknown.
        paces: the highest speeds with which they are to be reached, rad/s, by device and item; not of all.
    """

    def __init__(self) -> None:
        self.options = NaoOptions()
        self.info = NaoInfo("", (), (), {})
        self.news: list[FromWorker] = []
        self.values: dict[Any, dict[str, Any]] = {}
        self.now: Callable[[], float] = time.monotonic
        self.port: Port
        self.written: float | None = None
        self.paces: Mapping[tuple[Any, str], float] = {}
        self._session: QiSession | None = None
        self._motion: QiService
        self._memory: QiService
        self._open: dict[str, QiCall] = {}

    # ---------------------------------------------------------------- the link

    def begin(self, session: QiSession, motion: QiService, memory: QiService) -> None:
        """Use this session from now on."""
        self._session, self._motion, self._memory = session, motion, memory
        self._open.clear()

    def end(self) -> None:
        """Close the session: calls under way fail, and what was measured and not told yet is too old."""
        self.values.clear()
        session, self._session = self._session, None
        if session is not None:
            session.close(LINK_LOST)

    @property
    def linked(self) -> bool:
        """Whether there is a session."""
        return self._session is not None

    @property
    def session(self) -> QiSession:
        """The session.  Raises LinkGone when there is none."""
        if self._session is None:
            raise LinkGone("the link is down")
        return self._session

    @property
    def motion(self) -> QiService:
        """The service ALMotion of the robot."""
        return self._motion

    @property
    def memory(self) -> QiService:
        """The service ALMemory of the robot."""
        return self._memory

    # ---------------------------------------------------------------- calls

    def busy(self, kind: str) -> bool:
        """Whether the last call of this kind is still under way: the next one waits for its answer."""
        call = self._open.get(kind)
        return call is not None and not call.done

    def last_error(self, kind: str) -> str:
        """Why the last call of this kind failed, "" if it did not."""
        call = self._open.get(kind)
        return "" if call is None else call.error

    def call(
        self,
        kind: str,
        service: QiService,
        method: str,
        *arguments: Any,
        then: Callable[[QiCall], None] | None = None,
    ) -> None:
        """Call a method; ``then`` gets its answer, and raises BadFrame for one of another form.

        A failure is reported as ``Refused`` of ``kind``.  Raises LinkGone.
        """
        session = self.session

        def answered(call: QiCall) -> None:
            if not call.error:
                try:
                    if then is not None:
                        then(call)
                except BadFrame as error:
                    self.news.append(Refused(kind, method, str(error)))
            elif self._session is session and call.error != LINK_LOST:
                self.news.append(Refused(kind, method, call.error))

        try:
            self._open[kind] = session.call(service, method, *arguments, then=answered, timeout=CYCLE_TIMEOUT_S)
        except BadValue as error:
            self.news.append(Refused(kind, method, str(error)))

    def post(self, service: QiService, method: str, *arguments: Any) -> None:
        """Call a method and want no answer; that a robot has no such method is reported.  Raises LinkGone."""
        try:
            self.session.post(service, method, *arguments)
        except BadValue as error:
            self.news.append(Refused(service.name, method, str(error)))

    def post_motion(self, method: str, *arguments: Any) -> None:
        """The same of ALMotion.  Raises LinkGone."""
        self.post(self._motion, method, *arguments)

    def ask(self, service: QiService, method: str, *arguments: Any, timeout: float | None = None) -> Any:
        """Call a method and wait for its value.  Raises Unavailable, BadValue, LinkGone."""
        session = self.session
        if timeout is None:
            return session.wait(session.call(service, method, *arguments))
        return session.wait(session.call(service, method, *arguments, timeout=timeout))

    def find_service(self, name: str) -> QiService | None:
        """A service that a robot may or may not have.  Raises LinkGone."""
        if name not in self.info.services:
            return None
        try:
            return self.session.look_up(name)
        except Unavailable:
            return None

