"""The cameras: pictures of ALVideoDevice while somebody wants them.

Pictures come over a session of their own, so that a large one on a slow network delays nothing but the next picture.
It is opened by the request "film" and closed when no client wants pictures any more.  One picture is asked for at a
time, and never more than ``rate`` of them in a second.

NAOqi keeps a handle whose client is gone, and gives at most six to one name: what an earlier worker has left is
given back at the login, and ours at each stop of the whole robot, with which the end of a worker begins.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from urbihw.buses.errors import BadUrl, BadValue, LinkGone, Unavailable
from urbihw.buses.link import Port
from urbihw.buses.messages import DeviceReport, FromWorker, Refused, Reply, Request
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.part import Devices, NaoPart
from urbihw_nao.pictures import CameraMode, read_picture
from urbihw_nao.qimessaging.opening import open_session
from urbihw_nao.qimessaging.session import QiCall, QiService, QiSession

CAMERA: Final = "camera"
VIDEO: Final = "ALVideoDevice"
FILM: Final = "film"
LOST: Final = "lost"
NAME: Final = "urbihw"
"""The name under which NAOqi knows this program."""
_CLEAR: Final = "unsubscribeAllInstances"
PICTURE_TIMEOUT_S: Final = 10.0
"""Seconds that a picture may take on a slow network."""
RETRY_S: Final = 2.0
"""Seconds after a failure until the next try."""


class CameraPart(NaoPart):
    """Value "picture" (`Picture`) of ``CAMERA``.

    Request "film" with a `CameraMode`: take pictures from now on; with None: no longer.  Event (``DeviceReport``)
    ("camera", "lost"): the session of the pictures has ended, for a reason.
    """

    verbs = frozenset({FILM})

    def __init__(self, exchange: NaoExchange) -> None:
        super().__init__(exchange)
        self._main: QiService | None = None
        self._mode: CameraMode | None = None
        self._port: Port | None = None
        self._session: QiSession | None = None
        self._video: QiService
        self._handle = ""
        self._subscribed: tuple[int, int, int, int] | None = None
        self._call: QiCall | None = None
        self._due = 0.0

    def begin(self) -> None:
        """See ``Part``: give back the handles of an earlier worker."""
        self._main = self.exchange.find_service(VIDEO)
        if self._main is not None and _CLEAR in self._main.meta.names():
            self.exchange.post(self._main, _CLEAR, NAME)

    def end(self) -> None:
        self._mode, self._handle = None, ""
        self._close("the link went down")

    # ---------------------------------------------------------------- on and off

    def request(self, message: Request) -> list[FromWorker]:
        self._mode = message.value if isinstance(message.value, CameraMode) else None
        if self._mode is None:
            self._release()
            self._close("no client wants pictures")
        elif self._main is None:
            self._mode = None
            raise Unavailable(f"this robot has no {VIDEO}: no pictures")
        elif self._session is None:
            self._open()
        return [Reply(message.reply_id, True)]

    def _open(self) -> None:
        """Log in once more.  Raises Unavailable, and BadValue for a service of another form."""
        port = self._port = self.exchange.port.twin()
        try:
            port.open()
            session = open_session(port)
            session.authenticate(self.exchange.options.login())
            self._video = session.look_up(VIDEO)
            if _CLEAR in self._video.meta.names():
                # The answer to a subscription may not have come before the last session was closed.
                session.wait(session.call(self._video, _CLEAR, NAME))
        except (Unavailable, BadUrl, LinkGone) as error:
            self._close(str(error))
            self._mode = None
            raise Unavailable(f"no second connection for pictures: {error}") from error
        self._session, self._call, self._due = session, None, 0.0

    def _close(self, reason: str) -> None:
        session, self._session = self._session, None
        if session is not None:
            session.close(reason)
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _lose(self, reason: str) -> None:
        """The session of the pictures is gone; the robot's own goes on."""
        self._release()
        self._close(reason)
        self._mode = None
        self.exchange.news.append(DeviceReport(CAMERA, LOST, reason))

    def stop(self, devices: Devices) -> None:
        """See ``Part``: give the handle back, for this may be the end of the worker; otherwise another one follows."""
        if devices is None:
            self._release()

    # ---------------------------------------------------------------- pictures

    def read(self) -> None:
        session = self._session
        if session is None:
            return
        try:
            session.poll()
            if self._session is session and (self._call is None or self._call.done):
                self._proceed(session)
        except BadValue as error:
            self._fail("subscribeCamera", str(error))
        except LinkGone as error:
            self._lose(str(error))

    def _proceed(self, session: QiSession) -> None:
        """Send the next call, if it is time.  Raises LinkGone."""
        mode, now = self._mode, self.exchange.now()
        if mode is None:
            return
        if self._handle and mode.subscription() != self._subscribed:
            self._release()
        if now < self._due:
            return
        if self._handle:
            # A call that is late by a tick does not delay the next one; one that is later does.
            period = 1 / mode.rate
            self._due = now + period - min(now - self._due, period / 2)
            self._call = session.call(
                self._video, "getImageRemote", self._handle,
                then=partial(self._show, mode, self._handle), timeout=PICTURE_TIMEOUT_S,
            )  # fmt: skip
        else:
            self._subscribed = mode.subscription()
            self._call = session.call(self._video, "subscribeCamera", NAME, *self._subscribed, then=self._take_handle)

    def _take_handle(self, call: QiCall) -> None:
        if call.error:
            self._fail("subscribeCamera", call.error)
        elif not isinstance(call.value, str) or not call.value:
            why = "NAOqi gives no handle: it has no such camera or resolution, or six handles were left under our name"
            self._fail("subscribeCamera", why)
        else:
            self._handle = call.value
            self._due = self.exchange.now()

    def _show(self, mode: CameraMode, handle: str, call: QiCall) -> None:
        if handle != self._handle:
            return
        if call.error:
            self._fail("getImageRemote", call.error)
            return
        try:
            picture = read_picture(call.value, mode)
        except BadValue as error:
            self._fail("getImageRemote", str(error))
            return
        if picture is None:
            self._fail("getImageRemote", "NAOqi has no picture")
        else:
            self.exchange.values[CAMERA] = {"picture": picture}

    def _fail(self, method: str, reason: str) -> None:
        """Begin anew after a while."""
        if self._session is None:
            return
        self.exchange.news.append(Refused(CAMERA, method, reason))
        self._release()
        self._due = self.exchange.now() + RETRY_S

    def _release(self) -> None:
        """Give the handle back, over the robot's own session: what waits on the other one does not hold it."""
        handle, self._handle = self._handle, ""
        if handle and self._main is not None and self.exchange.linked:
            self.exchange.post(self._main, "unsubscribe", handle)
