"""Logging in to NAOqi: who does not speak QiMessaging, credentials, and the token of a first login."""

from __future__ import annotations

import stat
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urbihw.buses.clock import BusSimClock
from urbihw.buses.errors import Unavailable
from urbihw.buses.link import Context, Url
from urbihw.buses.pipe import PipeEnd, PipeLink
from urbihw_nao.qimessaging import frames as f
from urbihw_nao.qimessaging.login import AUTH_CONTINUE, AUTH_DONE, AUTH_ERROR, AUTH_STATE, NEW_TOKEN, Login
from urbihw_nao.qimessaging.opening import open_session
from urbihw_nao.qimessaging.session import QiSession
from urbihw_nao.qimessaging.values import decode, encode


class Stranger:
    """A server whose answers are a function of what it was sent."""

    def __init__(self, answer: Callable[[bytes], bytes]) -> None:
        self.received = b""
        self._answer = answer
        self._clock = BusSimClock(100.0)
        self.end = PipeEnd(self._receive)
        self._link = PipeLink(Url.parse("pipe://nao?baud=100000000"), Context(self._clock, {"nao": self.end}))
        self._link.open()
        self.session: QiSession = open_session(self._link)

    def _receive(self, data: bytes, at: float) -> None:
        self.received += data
        self.end.send(self._answer(data), at)

    def refuse(self, login: Login | None = None) -> str:
        """Log in; return why not."""
        begun = self._clock.now()
        with pytest.raises(Unavailable) as error:
            self.session.authenticate(login)
        assert self._clock.now() - begun < 5.0
        return str(error.value)


def deny(data: bytes) -> bytes:
    """A web server: it answers when the line has an end."""
    return b"HTTP/1.0 400 Bad Request\r\n\r\n" if b"\r\n" in data else b""


@pytest.mark.parametrize(
    "answer",
    [
        lambda data: b"HTTP/1.1 400 Bad Request\r\nContent-Length: 0\r\n\r\n",
        lambda data: b"HTTP/1.1 500\r\n\r\n",
        lambda data: b'<?xml version="1.0"?><SOAP-ENV:Envelope/>' + b" " * 100,
        deny,
    ],
)
def test_a_robot_that_speaks_http_has_naoqi_1(answer: Callable[[bytes], bytes]) -> None:
    assert Stranger(answer).refuse() == (
        "pipe://nao?baud=100000000 answers in HTTP: this is NAOqi 1, which does not speak QiMessaging; put NAOqi 2.1 "
        "on the robot, which all Nao from version 3.3 on can have"
    )


def test_silence_is_said() -> None:
    assert Stranger(lambda data: b"").refuse() == (
        "pipe://nao?baud=100000000: connected, but no answer to the login in 2 s; NAOqi may still be starting, or this "
        "is no NAOqi 2"
    )


def test_who_hangs_up_is_said() -> None:
    stranger = Stranger(lambda data: b"")
    stranger.end.hang_up()
    assert "hangs up at the login; NAOqi 1 does so, which needs NAOqi 2.1" in stranger.refuse()


def test_tls_and_strangers_are_said() -> None:
    alert = bytes.fromhex("15030300020246")
    assert "speaks TLS: write qis:// instead of qi://" in Stranger(lambda data: alert).refuse()
    assert "what answers there is no NAOqi 2" in Stranger(lambda data: b"SSH-2.0-OpenSSH_9.2\r\n").refuse()


def door(rows: list[dict[str, Any]], sent: list[dict[str, Any]]) -> Callable[[bytes], bytes]:
    """A server of QiMessaging that answers logins with these maps, one after the other."""

    def answer(data: bytes) -> bytes:
        (message,) = f.QiFramer().feed(data)
        sent.append(decode("{sm}", message.payload))
        row = rows[min(len(sent), len(rows)) - 1]
        return bytes(f.QiMessage(f.REPLY, message.id, 0, 0, message.action, encode("{sm}", row)))

    return answer


def test_credentials_go_under_the_names_of_the_settings() -> None:
    sent: list[dict[str, Any]] = []
    Stranger(door([{AUTH_STATE: AUTH_DONE}], sent)).session.authenticate(Login("nao", "secret"))
    Stranger(door([{AUTH_STATE: AUTH_DONE}], sent)).session.authenticate(Login("nao", "secret", "login", "word"))
    # libqi of NAOqi 2.1 tells no state: it knows no login.
    Stranger(door([{"ClientServerSocket": True}], sent)).session.authenticate()
    assert sent == [{"auth_user": "nao", "auth_token": "secret"}, {"login": "nao", "word": "secret"}, {}]


def test_a_refused_login_names_the_options_and_no_password() -> None:
    text = Stranger(door([{AUTH_STATE: AUTH_ERROR}], [])).refuse(Login("nao", "secret"))
    assert text.endswith("the robot refuses user or password: options.user, options.password")
    assert "secret" not in text and "secret" not in repr(Login("nao", "secret"))
    assert "more than a user and a password" in Stranger(door([{AUTH_STATE: AUTH_CONTINUE}], [])).refuse()


def test_a_login_that_is_answered_by_an_error() -> None:
    def answer(data: bytes) -> bytes:
        (message,) = f.QiFramer().feed(data)
        reason = encode("m", "no such user\n\n at auth.cpp:7")
        return bytes(f.QiMessage(f.ERROR, message.id, 0, 0, message.action, reason))

    assert Stranger(answer).refuse(Login("nao", "secret")).endswith("options.user, options.password (no such user)")
    assert Stranger(answer).refuse().endswith("the login failed (no such user)")


def test_a_token_that_the_robot_hands_out_is_kept_and_used(tmp_path: Path) -> None:
    file = tmp_path / "token"
    first = {AUTH_STATE: AUTH_CONTINUE, NEW_TOKEN: "handed-out"}
    sent: list[dict[str, Any]] = []
    login = Login("nao", token_file=str(file))
    Stranger(door([first, {AUTH_STATE: AUTH_DONE}], sent)).session.authenticate(login)
    assert file.read_text() == "handed-out\n" and stat.S_IMODE(file.stat().st_mode) == 0o600
    assert [each["auth_token"] for each in sent] == ["", "handed-out"]
    # The next time it is there from the beginning.
    sent.clear()
    Stranger(door([{AUTH_STATE: AUTH_DONE}], sent)).session.authenticate(login)
    assert sent == [{"auth_user": "nao", "auth_token": "handed-out"}]


def test_a_token_is_refused_where_it_cannot_be_kept(tmp_path: Path) -> None:
    first = {AUTH_STATE: AUTH_CONTINUE, NEW_TOKEN: "handed-out"}
    sent: list[dict[str, Any]] = []
    text = Stranger(door([first, {AUTH_STATE: AUTH_DONE}], sent)).refuse(Login("nao"))
    assert "hands out a token, which must be kept: set options.token_file" in text
    assert len(sent) == 1, "nothing is tried with a token that would be lost"
    sent.clear()
    file = str(tmp_path / "no" / "token")
    text = Stranger(door([first, {AUTH_STATE: AUTH_DONE}], sent)).refuse(Login("nao", token_file=file))
    assert "which cannot be written to" in text and "handed-out" not in text
    assert len(sent) == 1
    folder = tmp_path / "folder"
    folder.mkdir()
    assert "cannot be read" in Stranger(door([first], [])).refuse(Login("nao", token_file=str(folder)))


def test_a_token_that_is_there_is_never_replaced(tmp_path: Path) -> None:
    file = tmp_path / "token"
    file.write_text("of-our-robot\n")
    sent: list[dict[str, Any]] = []
    stranger = door([{AUTH_STATE: AUTH_CONTINUE, NEW_TOKEN: "of-a-stranger"}, {AUTH_STATE: AUTH_DONE}], sent)
    text = Stranger(stranger).refuse(Login("nao", token_file=str(file)))
    assert "hands out a new token, which is not taken: if the robot was reset, delete the file" in text
    assert file.read_text() == "of-our-robot\n" and len(sent) == 1 and "of-a-stranger" not in text
    # Nor does one take the place of a password.
    sent.clear()
    text = Stranger(stranger).refuse(Login("nao", "secret", token_file=str(tmp_path / "none")))
    assert "remove options.password" in text and not (tmp_path / "none").exists()


@pytest.mark.parametrize("token", ["", "a" * 257, "a\nb", "\x1b[31m", "\xe9", "a b", "x" * 3_000_000])
def test_a_token_that_is_none_is_refused(tmp_path: Path, token: str) -> None:
    file = tmp_path / "token"
    first = {AUTH_STATE: AUTH_CONTINUE, NEW_TOKEN: token}
    text = Stranger(door([first], [])).refuse(Login("nao", token_file=str(file)))
    assert "hands out an invalid token: 1 to 256 printable characters" in text and text.isprintable()
    assert list(tmp_path.iterdir()) == []
    file.write_text(token)
    text = Stranger(door([{AUTH_STATE: AUTH_DONE}], [])).refuse(Login("nao", token_file=str(file)))
    assert "has no token: 1 to 256 printable characters" in text and text.isprintable()


def test_a_token_is_never_read_or_written_through_a_link(tmp_path: Path) -> None:
    target, file = tmp_path / "target", tmp_path / "token"
    file.symlink_to(target)
    first = {AUTH_STATE: AUTH_CONTINUE, NEW_TOKEN: "handed-out"}
    sent: list[dict[str, Any]] = []
    assert "cannot be read: it is a link" in Stranger(door([first], sent)).refuse(Login("nao", token_file=str(file)))
    assert not target.exists() and file.is_symlink() and sent == []
