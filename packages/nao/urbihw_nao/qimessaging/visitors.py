"""A connection that somebody else has made to us: log in, then call our objects.  No I/O.

Who has not logged in may send little, and is dismissed after a few seconds, or at once when the login is wrong.
"""

from __future__ import annotations

import hmac
from collections import deque
from typing import Any, Final

from urbihw.buses.errors import BadFrame, Unavailable
from urbihw.buses.listening import Visitor
from urbihw_nao.qimessaging import frames as f
from urbihw_nao.qimessaging.login import AUTH_DONE, AUTH_ERROR, AUTH_STATE, Login
from urbihw_nao.qimessaging.login_guard import LoginGuard
from urbihw_nao.qimessaging.serving import Address, ObjectServer
from urbihw_nao.qimessaging.values import decode, encode

LARGEST_LOGIN: Final = 4096
"""Bytes of a message before the login."""
LARGEST: Final = 72 << 10
"""Bytes of a message after it: 170 ms of four microphones have 65 kB."""
BYTES_A_UNIT: Final = 1024
"""Bytes of a message that count as one more message."""
LOGIN_TIMEOUT_S: Final = 5.0
"""Seconds in which a visitor must have logged in."""
MOST_WORDS: Final = 64
"""Elements of a login."""
SERVER: Final = 0
AUTHENTICATE: Final = 8
REASON: Final = "__qi_auth_err_reason"


class QiVisitor(Visitor):
    """One connection.  Who calls must know what ``login`` knows; everybody may where that is nothing."""

    def __init__(
        self, server: ObjectServer, now: float, address: str, guard: LoginGuard, login: Login | None = None
    ) -> None:
        """``address`` is where the connection comes from; ``guard`` counts its wrong logins."""
        super().__init__(now + LOGIN_TIMEOUT_S)
        self._server = server
        self._address, self._guard = address, guard
        self._login = login if login is not None else Login()
        self._allowed = False
        self._framer = f.QiFramer(LARGEST_LOGIN)
        self._messages: deque[f.QiMessage] = deque()

    # ---------------------------------------------------------------- in

    def wants_data(self) -> bool:
        """Only when all that came before was handled."""
        return not self._messages

    def receive(self, data: bytes) -> None:
        """Take the bytes apart; a visitor that speaks something else is dismissed."""
        try:
            self._messages += self._framer.feed(data)
        except BadFrame:
            self.closing = True

    def work(self, most: int) -> int:
        """Handle messages of so much work; return how much it was."""
        count = 0
        while self._messages and count < most and not self.closing:
            message = self._messages.popleft()
            count += 1 + len(message.payload) // BYTES_A_UNIT
            self._handle(message)
        return count

    def leave(self) -> None:
        """The connection is closed."""
        self._server.drop_caller(self)

    def _handle(self, message: f.QiMessage) -> None:
        if message.type not in (f.CALL, f.POST, f.CANCEL):
            return
        if message.service == SERVER:
            self._log_in(message)
        elif self._allowed:
            self._server.answer_call(self, message)
        else:
            self._say(f.ERROR, message, encode("m", "log in first"))
            self.closing = True

    def _log_in(self, message: f.QiMessage) -> None:
        try:
            words = decode("{sm}", message.payload, MOST_WORDS)
        except BadFrame:
            words = {}
        reason = self._guard.find_refusal(self._address)
        if not reason and not (message.action == AUTHENTICATE and self._may_enter(words)):
            reason = "user or password is wrong"
            self._guard.count_wrong(self._address)
        self._allowed = not reason
        answer: dict[str, Any] = {AUTH_STATE: AUTH_DONE}
        if self._allowed:
            self.deadline = None
            self._framer.largest = LARGEST
        else:
            answer = {AUTH_STATE: AUTH_ERROR, REASON: reason}
            self.closing = True
        self._say(f.REPLY, message, encode("{sm}", answer))

    def _may_enter(self, words: dict[str, Any]) -> bool:
        try:
            known = self._login.words()
        except Unavailable:
            return False
        return all(hmac.compare_digest(str(words.get(key, "")).encode(), each.encode()) for key, each in known.items())

    # ---------------------------------------------------------------- out

    def _say(self, kind: int, message: f.QiMessage, payload: bytes) -> None:
        self.send(kind, (message.service, message.object, message.action), payload, message.id)

    def send(self, kind: int, address: Address, payload: bytes, number: int | None = None) -> int:
        """See `serving.Caller`; it goes out with the next look at the connection."""
        self.write(bytes(f.QiMessage(kind, number or 0, *address, payload)))
        return number or 0
