"""Whom a client trusts and who it is: the files, without any server."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from urbihw.client.credentials import Credentials, Denied, fingerprint
from urbihw.client.where import Where, where_is

ROBOT = Where("Robot.local", 54000, True)
ONE, OTHER = b"one certificate", b"another one"


def user(home: Path, **options: object) -> Credentials:
    return Credentials(environment={"XDG_CONFIG_HOME": str(home)}, **options)  # type: ignore[arg-type]


# ---------------------------------------------------------------- by which way


@pytest.mark.parametrize(
    ("host", "tls"),
    [
        ("127.0.0.1", False), ("127.1.2.3", False), ("localhost", False), ("LOCALHOST.", False), ("::1", False),
        ("robot.local", True), ("192.168.1.7", True), ("fe80::1%eth0", True), ("localhost.example.org", True),
        ("127.0.0.1.example.org", True), ("/run/x", False), ("", True),
    ],
)  # fmt: skip
def test_other_machines_are_reached_by_tls(host: str, tls: bool) -> None:
    assert where_is(host, 54000).tls is tls


def test_a_server_by_name() -> None:
    assert str(where_is("::1", 3)) == "[::1]:3"
    assert str(where_is("/run/urbihw/urbi-54000.socket", 3)) == "urbi-54000"
    assert where_is("/run/x", 3, True) == Where("/run/x", 3, False)


# ---------------------------------------------------------------- the server


def test_a_server_that_is_not_known_is_shown_and_not_trusted(tmp_path: Path) -> None:
    with pytest.raises(Denied) as caught:
        user(tmp_path).check_certificate(ROBOT, ONE)
    assert fingerprint(ONE) in str(caught.value) and "--trust" in str(caught.value)
    assert not (tmp_path / "urbihw").exists()


@pytest.mark.parametrize("answer", [True, False])
def test_who_is_asked_decides_once(tmp_path: Path, answer: bool) -> None:
    asked: list[str] = []

    def confirm(question: str) -> bool:
        asked.append(question)
        return answer

    me = user(tmp_path, confirm=confirm)
    if not answer:
        with pytest.raises(Denied):
            me.check_certificate(ROBOT, ONE)
        return
    me.check_certificate(ROBOT, ONE)
    me.check_certificate(ROBOT, ONE)
    user(tmp_path).check_certificate(ROBOT, ONE)
    assert len(asked) == 1 and fingerprint(ONE) in asked[0]
    known = tmp_path / "urbihw" / "known_hosts"
    assert known.read_text() == f"robot.local:54000 {fingerprint(ONE)}\n"
    assert stat.S_IMODE(known.stat().st_mode) == 0o600


@pytest.mark.parametrize("trust", [True, False])
def test_another_certificate_is_refused_even_with_trust(tmp_path: Path, trust: bool) -> None:
    user(tmp_path, trust=True).check_certificate(Where("other", 1, True), OTHER)
    user(tmp_path, trust=True).check_certificate(ROBOT, ONE)
    with pytest.raises(Denied) as caught:
        user(tmp_path, trust=trust, confirm=lambda question: True).check_certificate(ROBOT, OTHER)
    assert "somebody may be in between" in str(caught.value)
    assert f"delete line 2 of {tmp_path}/urbihw/known_hosts" in str(caught.value)


def test_each_port_has_a_server_of_its_own(tmp_path: Path) -> None:
    user(tmp_path, trust=True).check_certificate(ROBOT, ONE)
    user(tmp_path, trust=True).check_certificate(Where("robot.local", 54001, True), OTHER)
    user(tmp_path).check_certificate(ROBOT, ONE)


# ---------------------------------------------------------------- the user


def keep(home: Path, text: str, mode: int = 0o600) -> Path:
    (home / "urbihw").mkdir()
    file = home / "urbihw" / "tokens"
    file.write_text(text)
    file.chmod(mode)
    return file


def test_a_token_for_the_host_or_for_one_port_of_it(tmp_path: Path) -> None:
    keep(tmp_path, "# mine\nother aaa\nROBOT.local bbb\nrobot.local:54001 ccc\n\nlonely\n")
    assert user(tmp_path).token(ROBOT) == "bbb"
    assert user(tmp_path).token(Where("robot.local", 54001, True)) == "ccc"


def test_a_file_that_is_named_comes_first_and_then_the_environment(tmp_path: Path) -> None:
    keep(tmp_path, "robot.local bbb\n")
    environment = {"XDG_CONFIG_HOME": str(tmp_path), "URBIHW_TOKEN": "eee"}
    assert Credentials(environment=environment).token(ROBOT) == "eee"
    file = tmp_path / "token"
    file.write_text("fff\n")
    file.chmod(0o600)
    assert Credentials(file, environment=environment).token(ROBOT) == "fff"
    with pytest.raises(Denied, match="cannot read .*none: No such file"):
        Credentials(tmp_path / "none", environment=environment).token(ROBOT)


def test_a_file_that_others_can_read_is_refused(tmp_path: Path) -> None:
    file = keep(tmp_path, "robot.local bbb\n", 0o640)
    with pytest.raises(Denied, match=f"chmod 600 {file}"):
        user(tmp_path).token(ROBOT)
    with pytest.raises(Denied, match="chmod 600"):
        user(tmp_path, token_file=file).token(ROBOT)


def test_a_token_is_asked_for_once_unless_it_was_wrong(tmp_path: Path) -> None:
    answers = iter(["first", "second"])
    me = user(tmp_path, ask=lambda question: next(answers))
    assert [me.token(ROBOT), me.token(ROBOT)] == ["first", "first"]
    me.forget_token(ROBOT)
    assert me.token(ROBOT) == "second"


@pytest.mark.parametrize("text", ["two words", "ümlaut", "x" * 201, "line\nfeed"])
def test_what_cannot_be_a_token_is_not_sent(tmp_path: Path, text: str) -> None:
    with pytest.raises(Denied, match="is invalid"):
        user(tmp_path, ask=lambda question: text).token(ROBOT)


def test_without_a_token_the_line_says_where_it_may_come_from(tmp_path: Path) -> None:
    with pytest.raises(Denied, match=r"urbihw access add NAME.*--token-file.*URBIHW_TOKEN.*tokens"):
        user(tmp_path).token(ROBOT)
