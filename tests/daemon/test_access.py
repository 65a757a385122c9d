"""Tokens, the certificate, and the folder that both are kept in."""

from __future__ import annotations

import json
import os
import ssl
import stat
import subprocess
from pathlib import Path

import pytest

from urbihw.cli.main import main
from urbihw.client.credentials import fingerprint
from urbihw.daemon import tls
from urbihw.daemon.access import Tokens
from urbihw.daemon.access_policy import access_policy
from urbihw.daemon.config import Config
from urbihw.daemon.state import state_folder
from urbihw.kernel.uobject import BadConfig


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


# ---------------------------------------------------------------- credentials of the service manager


def test_tokens_and_certificate_of_the_service_manager_are_taken_and_nothing_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, state = tmp_path / "credentials", tmp_path / "state"
    for folder in (given, state, tmp_path / "maker"):
        folder.mkdir()
    token = Tokens(tmp_path / "maker").add("alice")
    tls.make(tmp_path / "maker")
    (tmp_path / "maker" / "tokens").rename(given / "urbihw.tokens")
    (given / "urbihw.tokens").chmod(0o440)  # as systemd shows a file with an access control list
    (tmp_path / "maker" / "certificate.pem").rename(given / "urbihw.certificate.pem")
    monkeypatch.setenv("STATE_DIRECTORY", str(state))
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(given))
    policy = access_policy(Config(host="0.0.0.0"), ["0.0.0.0"])
    assert policy.authenticator is not None and policy.files is not None
    assert policy.authenticator.authenticate("192.0.2.1", token).name == "alice"
    assert policy.files.certificate == given / "urbihw.certificate.pem"
    assert list((state / "access").iterdir()) == []


def test_without_credentials_the_state_folder_has_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "credentials").mkdir()
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path / "credentials"))
    Tokens(state_folder()).add("alice")
    policy = access_policy(Config(host="0.0.0.0"), ["0.0.0.0"])
    assert policy.files is not None
    assert policy.files.certificate == tmp_path / "access" / "certificate.pem"


# ---------------------------------------------------------------- the folder


def test_the_folder_is_that_of_the_service_or_one_of_the_users_own(tmp_path: Path) -> None:
    (tmp_path / "service").mkdir(mode=0o755)
    made = state_folder({"STATE_DIRECTORY": f"{tmp_path}/service:/elsewhere"})
    assert made == tmp_path / "service" / "access"
    assert mode(made) == 0o700


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can write for somebody else")
def test_what_root_makes_for_the_service_belongs_to_the_service(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    os.chown(tmp_path, 65534, 65534)
    monkeypatch.setattr("urbihw.daemon.state.SERVICE_STATE", tmp_path)
    folder = state_folder({})
    Tokens(folder).add("alice")
    assert [path.stat().st_uid for path in (folder, folder / "tokens")] == [65534, 65534]


def test_the_users_own_folder_is_made_for_the_user_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("urbihw.daemon.state.SERVICE_STATE", tmp_path / "none")
    made = state_folder({"XDG_STATE_HOME": str(tmp_path / "state")})
    assert made == tmp_path / "state" / "urbihw" / "access"
    assert mode(made) == 0o700
    assert state_folder({"HOME": str(tmp_path)}) == tmp_path / ".local" / "state" / "urbihw" / "access"


def test_a_folder_in_which_others_can_write_is_refused(tmp_path: Path) -> None:
    (tmp_path / "access").mkdir()
    (tmp_path / "access").chmod(0o770)
    with pytest.raises(BadConfig, match="who could let anybody in: chmod 700"):
        state_folder({"STATE_DIRECTORY": str(tmp_path)})


# ---------------------------------------------------------------- tokens


def test_a_token_is_known_again_but_not_kept(tmp_path: Path) -> None:
    tokens = Tokens(tmp_path)
    alice, bob = tokens.add("alice"), tokens.add("bob@laptop")
    assert len(alice) >= 43 and alice != bob
    assert [entry.name for entry in tokens.entries()] == ["alice", "bob@laptop"]
    holder = Tokens(tmp_path).find_entry(bob)
    assert holder is not None and holder.name == "bob@laptop"
    file = tmp_path / "tokens"
    assert mode(file) == 0o600
    assert alice not in file.read_text() and bob not in file.read_text()
    assert os.listdir(tmp_path) == ["tokens"]


@pytest.mark.parametrize("token", ["", "x", "ü", "0" * 200])
def test_another_token_is_nobodys(tmp_path: Path, token: str) -> None:
    tokens = Tokens(tmp_path)
    assert tokens.find_entry(token) is None
    real = tokens.add("alice")
    assert tokens.find_entry(token) is None
    assert tokens.find_entry(real[:-1]) is None


def test_who_is_removed_is_let_in_no_more(tmp_path: Path) -> None:
    tokens = Tokens(tmp_path)
    alice, bob = tokens.add("alice"), tokens.add("bob")
    tokens.remove("alice")
    assert tokens.find_entry(alice) is None
    assert tokens.find_entry(bob) is not None
    with pytest.raises(BadConfig, match="there is no token of alice; there are: bob"):
        tokens.remove("alice")
    assert tokens.add("alice") != alice


@pytest.mark.parametrize("name", ["", "a b", "-x", "ü", "x" * 65, "a\nb"])
def test_a_name_that_could_not_stand_in_the_file_or_the_log(tmp_path: Path, name: str) -> None:
    with pytest.raises(BadConfig, match="is no name"):
        Tokens(tmp_path).add(name)


def test_a_second_token_of_one_name_is_refused(tmp_path: Path) -> None:
    Tokens(tmp_path).add("alice")
    with pytest.raises(BadConfig, match="urbihw access remove alice"):
        Tokens(tmp_path).add("alice")


def test_a_damaged_file_and_one_that_others_read_are_refused(tmp_path: Path) -> None:
    tokens = Tokens(tmp_path)
    real = tokens.add("alice")
    with (tmp_path / "tokens").open("a") as file:
        file.write("rubbish\n")
    with pytest.raises(BadConfig, match="line 2 is no token"):
        tokens.find_entry(real)
    (tmp_path / "tokens").chmod(0o644)
    with pytest.raises(BadConfig, match="chmod 600"):
        tokens.find_entry(real)


# ---------------------------------------------------------------- the certificate


def test_a_certificate_is_made_once_and_for_its_owner_alone(tmp_path: Path) -> None:
    tls.make(tmp_path)
    file = tmp_path / "certificate.pem"
    first = file.read_bytes()
    assert mode(file) == 0o600
    assert os.listdir(tmp_path) == ["certificate.pem"]
    tls.make(tmp_path)
    assert file.read_bytes() == first
    files = tls.files("", "", tmp_path)
    assert tls.context(files).minimum_version == ssl.TLSVersion.TLSv1_2
    shown = subprocess.run(["openssl", "x509", "-in", file, "-noout", "-fingerprint", "-sha256"],
                           capture_output=True, text=True, check=True).stdout
    assert shown.strip().lower() == f"sha256 fingerprint={tls.fingerprint(files)}".lower()
    der = ssl.PEM_cert_to_DER_cert(first.decode()[first.index(b"-----BEGIN CERT") :])
    assert fingerprint(der) == tls.fingerprint(files)


def test_without_openssl_the_line_says_what_to_do(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(BadConfig, match="apt install openssl, or set tls_cert"):
        tls.make(tmp_path)
    assert os.listdir(tmp_path) == []


def test_a_certificate_of_ones_own(tmp_path: Path) -> None:
    with pytest.raises(BadConfig, match="cannot be read: No such file"):
        tls.context(tls.files(str(tmp_path / "none.pem"), "", tmp_path))
    (tmp_path / "a.pem").write_text("nonsense")
    with pytest.raises(BadConfig, match="no certificate and its key in PEM"):
        tls.context(tls.files(str(tmp_path / "a.pem"), "", tmp_path))
    with pytest.raises(BadConfig, match="there is no certificate in PEM in it"):
        tls.fingerprint(tls.files(str(tmp_path / "a.pem"), "", tmp_path))


def test_a_key_with_a_passphrase_is_refused_and_not_asked_for(tmp_path: Path) -> None:
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-passout",
                    "pass:secret", "-subj", "/CN=x", "-keyout", key, "-out", certificate],
                   capture_output=True, check=True)
    with pytest.raises(BadConfig, match="without a passphrase"):
        tls.context(tls.files(str(certificate), str(key), tmp_path))


# ---------------------------------------------------------------- the command


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    return state_folder()


def test_add_prints_the_token_alone_for_scripts(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["access", "add", "alice"]) == 0
    said = capsys.readouterr()
    token = said.out.removesuffix("\n")
    assert Tokens(home).find_entry(token) is not None
    assert "The token of alice, shown this once" in said.err


def test_list_and_remove(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["access", "list"]) == 0
    assert capsys.readouterr().out == ""
    Tokens(home).add("alice")
    assert main(["access", "list"]) == 0
    assert capsys.readouterr().out.startswith("alice  since 20")
    assert main(["access", "list", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["name"] == "alice" and row["since"].startswith("20")
    assert main(["access", "remove", "bob"]) == 78
    assert capsys.readouterr().err == "urbihw: there is no token of bob; there are: alice\n"
    assert main(["access", "remove", "alice"]) == 0
    assert Tokens(home).entries() == []


def test_list_and_remove_make_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "none"))
    assert main(["access", "list"]) == 0
    assert capsys.readouterr() == ("", "")
    assert main(["access", "remove", "bob"]) == 78
    assert capsys.readouterr().err == "urbihw: there is no token of bob; there are: none\n"
    assert list(tmp_path.iterdir()) == []


def test_the_fingerprint_is_shown_before_the_first_start(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["access", "fingerprint"]) == 0
    assert capsys.readouterr().out.strip() == tls.fingerprint(tls.files("", "", home))
    (home / "urbihw.toml").write_text('tls_cert = "/none.pem"\n')
    assert main(["access", "fingerprint", "--config", str(home / "urbihw.toml")]) == 78
    assert capsys.readouterr().err == "urbihw: /none.pem: cannot be read: No such file or directory\n"
