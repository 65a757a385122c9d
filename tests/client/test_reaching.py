"""A client and a server with TLS and tokens, by real sockets: who gets in, who does not, and what is said."""

from __future__ import annotations

import asyncio
import logging
import socket
import ssl
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from lan_server import Lan

from urbihw.cli.console.session import ConsoleSession
from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused
from urbihw.client.connect import connect
from urbihw.client.credentials import Credentials, Denied
from urbihw.client.dial import dial
from urbihw.client.secure import context
from urbihw.client.where import Where
from urbihw.daemon import access, secrets, tls
from urbihw.kernel.server.handshake import HandshakeRefusal
from urbihw.kernel.server.tcp import MAX_UNAUTHENTICATED, WANTS_TLS
from urbihw.kernel.uobject.motion import _client

pytestmark = pytest.mark.e2e

TIMEOUT_S = 20.0


@pytest.fixture
def lan(tmp_path: Path) -> Iterator[Lan]:
    made = Lan(tmp_path)
    yield made
    made.close()


def user(home: Path, token: str = "", trust: bool = True) -> Credentials:
    return Credentials(trust=trust, environment={"XDG_CONFIG_HOME": str(home), "URBIHW_TOKEN": token})


def secure(lan: Lan) -> ssl.SSLSocket:
    """TLS without a word said."""
    plain = socket.create_connection(("127.0.0.1", lan.port), TIMEOUT_S)
    return context().wrap_socket(plain)


def everything(made: socket.socket) -> bytes:
    """All that is said until the end."""
    made.settimeout(TIMEOUT_S)
    said = b""
    try:
        while data := made.recv(4096):
            said += data
    except (ConnectionError, ssl.SSLError):
        pass
    made.close()
    return said


def wait_for(lan: Lan, connections: int) -> None:
    end = time.monotonic() + TIMEOUT_S
    while lan.count()[0] != connections:
        assert time.monotonic() < end
        time.sleep(0.01)


# ---------------------------------------------------------------- with a token


def test_who_has_a_token_gets_banner_and_answers(lan: Lan, tmp_path: Path) -> None:
    lan.kernel.programs.quiet = False
    with LobbyClient(lan.where, user(tmp_path, lan.tokens.add("alice"))) as link:
        assert any("***" in line.text for line in link.read_banner())
        assert link.ask("1 + 1").shown == "2"
        connection = lan.call(lambda: next(iter(lan.server.connections)))
        assert connection.peer.endswith("(alice)")
        assert _client(connection.lobby) == "Lobby_1 (alice, 127.0.0.1)"
    wait_for(lan, 0)


@pytest.mark.parametrize("ending", [b"\n", b"\r\n"])
@pytest.mark.parametrize("size", [1, 7, 1000])
def test_the_first_line_in_pieces_and_with_what_comes_behind_it(lan: Lan, ending: bytes, size: int) -> None:
    made = secure(lan)
    text = b"token " + lan.tokens.add("alice").encode() + ending + b"1 + 2;quit;\n"
    for start in range(0, len(text), size):
        made.sendall(text[start : start + size])
    said = everything(made)
    assert said.startswith(b"*** urbihw: token accepted: alice\n[")
    assert b"] 3\n" in said


async def open_streams(where: Where, credentials: Credentials) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
    reader = asyncio.StreamReader()
    transport, protocol = await dial(where, credentials, lambda: asyncio.StreamReaderProtocol(reader))
    return reader, asyncio.StreamWriter(transport, protocol, reader, asyncio.get_running_loop())


def test_streams_of_asyncio_get_in_and_lose_no_byte(lan: Lan, tmp_path: Path) -> None:
    who = user(tmp_path, lan.tokens.add("alice"))

    async def talk() -> bytes:
        reader, writer = await open_streams(lan.where, who)
        writer.write(b"1 + 2;quit;\n")
        said = await asyncio.wait_for(reader.read(-1), TIMEOUT_S)
        writer.close()
        return said

    said = asyncio.run(talk())
    assert b"token accepted" not in said
    assert said.startswith(b"[0000") and b"] 3\n" in said


def test_much_in_both_directions_at_once(lan: Lan, tmp_path: Path) -> None:
    """Two threads share the connection, as in the console in a pipe."""
    wire = connect(lan.where, user(tmp_path, lan.tokens.add("alice")), TIMEOUT_S)
    wire.settimeout(TIMEOUT_S)

    def send() -> None:
        for _ in range(2000):
            wire.sendall(b'echo("' + b"x" * 1000 + b'");\n')

    sender = threading.Thread(target=send)
    sender.start()
    heard = b""
    while heard.count(b"*** xxx") < 2000:
        data = wire.recv(1 << 16)
        assert data
        heard = heard + data
    sender.join()
    wire.close()


# ---------------------------------------------------------------- without


@pytest.mark.parametrize(
    "first",
    [
        b"token wrong\n", b"1 + 1;\n", b"token \n", b"token\n", b"token a b\n", b"TOKEN x\n",
        b"POST / HTTP/1.1\r\n\r\n", b"\n", b"x" * 300, b"token " + b"x" * 300 + b"\n",
        bytes(range(256)), b"token \xff\n",
    ],
)  # fmt: skip
def test_without_a_token_nothing_is_evaluated_and_one_line_says_why(
    lan: Lan, first: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    lan.tokens.add("alice")
    made = secure(lan)
    with caplog.at_level(logging.INFO):
        made.sendall(first + b'echo("in");\n')
        said = everything(made)
    assert said.startswith(b"*** urbihw: token refused: ")
    assert said.count(b"\n") == 1
    wait_for(lan, 0)
    assert lan.count() == (0, 0)
    assert len(caplog.records) == 1 and "refused" in caplog.text


def test_nothing_is_said_and_there_is_no_lobby_before_the_token(lan: Lan) -> None:
    made = secure(lan)
    wait_for(lan, 1)
    assert lan.count() == (1, 0)
    made.settimeout(0.2)
    with pytest.raises(TimeoutError):
        made.recv(1)
    made.close()


def test_who_says_nothing_in_time_is_disconnected(lan: Lan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(access.TokenHandshake, "timeout", 0.2)
    made = secure(lan)
    made.sendall(b"tok")
    assert everything(made).startswith(b"*** urbihw: ")
    wait_for(lan, 0)


def test_wrong_tokens_wait_longer_each_time_and_a_right_one_never(
    lan: Lan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[float] = []
    fail = secrets.WrongSecrets.fail

    def quickly(self: secrets.WrongSecrets, address: str) -> float:
        waits.append(fail(self, address))
        return waits[-1] / 5

    monkeypatch.setattr(secrets.WrongSecrets, "fail", quickly)
    took = []
    for _ in range(3):
        began = time.monotonic()
        with pytest.raises(Denied, match="token refused: it is wrong"):
            connect(lan.where, user(tmp_path, "wrong"), TIMEOUT_S)
        took.append(time.monotonic() - began)
    assert waits == [0.5, 1.0, 2.0]
    assert took[0] >= 0.1 and took[1] >= 0.2 and took[2] >= 0.4
    monkeypatch.setattr(secrets.WrongSecrets, "fail", lambda self, address: TIMEOUT_S * 10)
    connect(lan.where, user(tmp_path, lan.tokens.add("alice")), TIMEOUT_S).close()


def test_the_addresses_of_wrong_tokens_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(secrets, "MAX_ADDRESSES", 4)
    authenticator = access.Authenticator(access.Tokens(tmp_path))
    delays = []
    for number in [0, 0, 0, 1, 2, 3, 4, 0]:
        with pytest.raises(HandshakeRefusal) as caught:
            authenticator.authenticate(f"10.0.0.{number}", "wrong")
        delays.append(caught.value.delay)
    assert delays == [0.5, 1.0, 2.0, 0.5, 0.5, 0.5, 0.5, 0.5]
    for _ in range(30):
        with pytest.raises(HandshakeRefusal) as caught:
            authenticator.authenticate("10.0.0.9", "wrong")
    assert caught.value.delay == access.MAX_DELAY_S


def test_a_crowd_without_tokens_keeps_nobody_out_who_is_in_or_of_this_machine(
    lan: Lan, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    who = user(tmp_path, lan.tokens.add("alice"))
    lan.server.max_clients = 3
    with LobbyClient(lan.where, who) as inside:
        crowd = [socket.create_connection(("127.0.0.1", lan.port), TIMEOUT_S) for _ in range(MAX_UNAUTHENTICATED + 20)]
        assert inside.ask("1").shown == "1"
        with LobbyClient(Where("127.0.0.1", lan.plain_port), Credentials()) as second:
            assert second.ask("2").shown == "2"
        with pytest.raises(CliRefused):
            LobbyClient(lan.where, who)
        assert "32 others have not shown a token yet" in caplog.text
        assert len(lan.call(lambda: set(lan.server.unauthenticated))) == MAX_UNAUTHENTICATED
        for one in crowd:
            one.close()
        end = time.monotonic() + TIMEOUT_S
        while lan.call(lambda: set(lan.server.unauthenticated)):
            assert time.monotonic() < end
            time.sleep(0.01)
        wait_for(lan, 1)
        with LobbyClient(lan.where, who) as third, LobbyClient(lan.where, who) as fourth:
            assert third.ask("3").shown == fourth.ask("3").shown == "3"
            with pytest.raises(CliRefused, match="too many connections"):
                LobbyClient(lan.where, who)
    wait_for(lan, 0)
    assert lan.call(lambda: set(lan.server.unauthenticated)) == set()


def test_who_is_removed_while_connected_is_disconnected(lan: Lan, tmp_path: Path) -> None:
    alice, bob = lan.tokens.add("alice"), lan.tokens.add("bob")
    with LobbyClient(lan.where, user(tmp_path, alice)) as first, LobbyClient(lan.where, user(tmp_path, bob)) as second:
        assert first.ask("1").shown == second.ask("1").shown == "1"
        lan.call(lambda: lan.access_policy.disconnect_removed(lan.server.connections))
        assert first.ask("2").shown == "2"
        lan.tokens.remove("alice")
        lan.tokens.add("alice")
        lan.call(lambda: lan.access_policy.disconnect_removed(lan.server.connections))
        # Who does not take notice is refused once all the same, and is gone soon.
        lan.call(lambda: lan.access_policy.disconnect_removed(lan.server.connections))
        wait_for(lan, 1)
        lan.call(lambda: lan.access_policy.disconnect_removed(lan.server.connections))
        with pytest.raises((CliRefused, Denied, ConnectionError), match="token refused: it was removed"):
            first.ask("3")
        assert second.ask("3").shown == "3"
    with pytest.raises(Denied, match="wrong, or was removed"):
        connect(lan.where, user(tmp_path, alice), TIMEOUT_S)


def test_tokens_that_cannot_be_read_let_nobody_in_and_the_log_says_why(
    lan: Lan, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    alice = lan.tokens.add("alice")
    (tmp_path / "tokens").chmod(0o644)
    with pytest.raises(Denied, match="cannot read its tokens"):
        connect(lan.where, user(tmp_path, alice), TIMEOUT_S)
    assert "can be read by others" in caplog.text


# ---------------------------------------------------------------- TLS


@pytest.mark.long
def test_plain_text_on_the_port_of_tls(lan: Lan, caplog: pytest.LogCaptureFixture) -> None:
    told = rf"^127.0.0.1:{lan.port} speaks TLS, and wants a token: --tls"
    with pytest.raises(CliRefused, match=told), LobbyClient(Where("127.0.0.1", lan.port), Credentials()) as link:
        link.ask("1")
    for text in (b"1 + 1;\n", b"\r\n", b"GET / HTTP/1.1\r\n\r\n"):
        plain = socket.create_connection(("127.0.0.1", lan.port), TIMEOUT_S)
        plain.sendall(text)
        assert everything(plain) == WANTS_TLS and b"urbihw console HOST:PORT --tls" in WANTS_TLS
    end = time.monotonic() + TIMEOUT_S
    while "speaks no TLS" not in caplog.text:
        assert time.monotonic() < end
        time.sleep(0.01)
    assert lan.count() == (0, 0)


def test_who_says_nothing_to_the_port_of_tls_is_told_in_the_end(lan: Lan, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urbihw.kernel.server.tcp.TLS_TIMEOUT_S", 0.3)
    assert everything(socket.create_connection(("127.0.0.1", lan.port), TIMEOUT_S)) == WANTS_TLS


def test_a_console_without_tls_is_told_why_and_does_not_try_again(lan: Lan) -> None:
    states: list[str] = []
    session = ConsoleSession(Where("127.0.0.1", lan.port), Credentials(), lambda line: None,
                             lambda: states.append(session.state))
    asyncio.run(asyncio.wait_for(session.run(), TIMEOUT_S))
    assert states == ["denied"]
    assert session.reason.startswith(f"127.0.0.1:{lan.port} speaks TLS, and wants a token: --tls")


def test_tls_on_a_plain_port(lan: Lan, tmp_path: Path) -> None:
    where = Where("127.0.0.1", lan.plain_port, True)
    with pytest.raises(CliRefused, match="does not speak TLS.*--no-tls"):
        LobbyClient(where, user(tmp_path, "x"))

    async def talk() -> None:
        await open_streams(where, user(tmp_path, "x"))

    with pytest.raises(Denied, match="does not speak TLS"):
        asyncio.run(talk())


def test_old_tls_is_refused(lan: Lan) -> None:
    old = context()
    with pytest.warns(DeprecationWarning):
        old.minimum_version = ssl.TLSVersion.TLSv1
        old.maximum_version = ssl.TLSVersion.TLSv1_1
    plain = socket.create_connection(("127.0.0.1", lan.port), TIMEOUT_S)
    with pytest.raises((ssl.SSLError, ConnectionError)), old.wrap_socket(plain):
        pass
    plain.close()


def test_another_certificate_gets_no_token(lan: Lan, tmp_path: Path) -> None:
    token = lan.tokens.add("alice")
    connect(lan.where, user(tmp_path, token), TIMEOUT_S).close()
    (tmp_path / "urbihw" / "known_hosts").write_text(f"127.0.0.1:{lan.port} {':'.join(['AB'] * 32)}\n")
    with pytest.raises(Denied, match="another one than before"):
        connect(lan.where, user(tmp_path, token), TIMEOUT_S)

    async def talk() -> None:
        await open_streams(lan.where, user(tmp_path, token))

    with pytest.raises(Denied, match="another one than before"):
        asyncio.run(talk())


AUTHORITY = """
[ca]
default_ca = here
[here]
new_certs_dir = .
database = index
rand_serial = yes
default_md = sha256
policy = any
[any]
commonName = supplied
"""


def test_a_certificate_that_has_expired_is_known_by_its_fingerprint(tmp_path: Path) -> None:
    """A robot whose clock was wrong when it made its certificate, or whose own has run out, is still the same robot."""
    (tmp_path / "index").touch()
    (tmp_path / "conf").write_text(AUTHORITY)
    for command in (
        "req -new -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=x -keyout key -out request",
        "ca -selfsign -batch -notext -config conf -keyfile key -in request -out certificate "
        "-startdate 20000101000000Z -enddate 20010101000000Z",
    ):
        subprocess.run(["openssl", *command.split()], cwd=tmp_path, capture_output=True, check=True)
    lan = Lan(tmp_path, tls.Files(tmp_path / "certificate", tmp_path / "key"))
    try:
        with LobbyClient(lan.where, user(tmp_path, lan.tokens.add("alice"))) as link:
            assert link.ask("1").shown == "1"
        assert lan.fingerprint in (tmp_path / "urbihw" / "known_hosts").read_text()
    finally:
        lan.close()


def test_a_slow_user_is_not_too_late(lan: Lan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The server waits for ten seconds; who has to compare a fingerprint takes longer."""
    monkeypatch.setattr(access.TokenHandshake, "timeout", 0.2)
    monkeypatch.setattr("urbihw.client.connect.PROMPT_TIMEOUT_S", 0.1)
    asked = []

    def slowly(question: str) -> bool:
        asked.append(question)
        time.sleep(0.4)
        return True

    who = Credentials(confirm=slowly, ask=lambda question: token, environment={"XDG_CONFIG_HOME": str(tmp_path)})
    token = lan.tokens.add("alice")
    connect(lan.where, who, TIMEOUT_S).close()
    assert len(asked) == 1


# ---------------------------------------------------------------- this machine


def test_the_unix_socket_and_loopback_want_no_token(lan: Lan) -> None:
    for where in (Where(str(lan.path), 0), Where("127.0.0.1", lan.plain_port)):
        with LobbyClient(where, Credentials(environment={})) as link:
            assert link.ask("1 + 1").shown == "2"
