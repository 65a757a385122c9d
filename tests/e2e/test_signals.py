"""Signals to a real daemon: settings read again, whatever the files have become, and its end at any moment."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from programs_lab import TIMEOUT_S, run

pytestmark = pytest.mark.e2e

LIMITED = "[limits.motor6]\nposition = [-0.5, 0.5]\n"
WRITE = "(motor6.val = 1.5)|; timeout (20s) waituntil (motor6.limitedBy != \"\"); motor6.limitedBy"
WRITE_FREELY = "(motor6.val = 1.5)|; timeout (20s) waituntil (motor6.val > 1); [motor6.val > 1, motor6.limitedBy]"
SERVE = (sys.executable, "-m", "urbihw.cli.main", "serve")


class Daemon:
    """A simulated Bioloid whose settings are in a file."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.config, self._log, self.port_file = folder / "robot.toml", folder / "log", folder / "port"
        self.state = folder / "state"
        self.state.mkdir(mode=0o700, exist_ok=True)
        self.environment = {"STATE_DIRECTORY": str(self.state), "XDG_RUNTIME_DIR": str(folder)}
        if not self.config.exists():
            self.config.write_text("rate = 50\n")
        if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # as in a job of a shell; a program would inherit that
            signal.signal(signal.SIGINT, signal.default_int_handler)
        with self._log.open("w") as written:
            self.process = subprocess.Popen(
                (*SERVE, "--platform", "bioloid", "--fake", "--port", "0", "--port-file", str(self.port_file),
                 "--config", str(self.config), *options),
                stdin=subprocess.DEVNULL, stderr=written, env={**os.environ, **self.environment},
            )  # fmt: skip

    def wait(self) -> None:
        """Until clients may come."""
        until(lambda: "urbihw: port " in self.log(), self.log)  # behind which nothing of the start is logged

    def log(self) -> str:
        return self._log.read_text()

    def reload(self, lines: int = 1) -> list[str]:
        """What it says after a SIGHUP: so many lines, and no more."""
        before = len(self.log().splitlines())
        self.process.send_signal(signal.SIGHUP)
        until(lambda: len(self.log().splitlines()) >= before + lines, self.log)
        time.sleep(1.05)  # the next request is answered at once then
        return self.log().splitlines()[before:]

    def ask(self, text: str) -> str:
        code, out, err = run("main", "console", f":{self.port_file.read_text().strip()}", "--no-tls", stdin=text)
        assert code == 0, err + self.log()
        return out

    def close(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(TIMEOUT_S)
        self.process.kill()
        self.process.wait()


Serve = Callable[..., Daemon]


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Serve]:
    made: list[Daemon] = []

    def start(*options: str) -> Daemon:
        made.append(Daemon(tmp_path, *options))
        return made[-1]

    yield start
    for daemon in made:
        daemon.close()


def until(done: Callable[[], object], log: Callable[[], str]) -> None:
    end = time.monotonic() + TIMEOUT_S
    while not done():
        assert time.monotonic() < end, log()
        time.sleep(0.01)


# ---------------------------------------------------------------- settings read again


def test_settings_are_read_again_and_those_that_wait_are_named(serve: Serve) -> None:
    daemon = serve()
    daemon.wait()
    assert daemon.reload() == ["urbihw: settings read again"]
    daemon.config.write_text("rate = 20\nmax_clients = 9\nhost = 'localhost'\n")
    assert daemon.reload() == ["urbihw: settings read again; with the next start: host, max_clients"]


@pytest.mark.long
def test_a_file_that_cannot_be_used_is_one_line_and_changes_nothing(serve: Serve, tmp_path: Path) -> None:
    file = tmp_path / "robot.toml"
    file.write_text(LIMITED)
    daemon = serve()
    daemon.wait()

    def said() -> str:
        (line,) = daemon.reload()
        assert line.startswith("urbihw: settings stay as they were: "), line
        return line.removeprefix("urbihw: settings stay as they were: ")

    file.write_text("rate = \n")
    assert said() == f"{file}: is not TOML: Invalid value (at line 1, column 8)"
    file.write_text("rate = 20\nprot = 1\n")
    assert said() == f"{file}: prot: no such setting; did you mean port?"
    file.write_text("rate = 20\noptions.protocol = 7\n")
    assert said() == f'{file}: options.protocol: wants 1, 2 or "auto", not 7'
    file.write_bytes(os.urandom(4096))
    assert said().startswith(f"{file}: is not ")
    file.unlink()
    assert said() == f"{file}: cannot be read: No such file or directory"
    file.mkdir()
    assert said() == f"{file}: is not a regular file: name one that is"
    file.rmdir()
    os.mkfifo(file)
    assert said() == f"{file}: is not a regular file: name one that is"
    file.unlink()
    file.symlink_to("/dev/zero")
    assert said() == f"{file}: is not a regular file: name one that is"
    file.unlink()
    with file.open("w") as sparse:
        sparse.truncate(1 << 40)
    assert said() == f"{file}: is longer than 65536 bytes: this is the wrong file"
    if os.geteuid() != 0:
        file.write_text("rate = 20\n")
        file.chmod(0)
        assert said() == f"{file}: cannot be read: Permission denied"
    assert daemon.ask(WRITE).endswith('"limits.motor6.position"\n')
    assert "Traceback" not in daemon.log()


def test_limits_that_are_taken_away_limit_no_more(serve: Serve, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(LIMITED)
    daemon = serve()
    daemon.wait()
    assert daemon.ask(WRITE).endswith('"limits.motor6.position"\n')
    daemon.config.write_text("rate = 50\n")
    (line,) = daemon.reload()
    assert "robot.toml: has no [limits], unlike the settings in force" in line
    daemon.config.write_text("rate = 50\n[limits]\n")
    told = "urbihw: limits removed or raised by the settings: limits.motor6.position [-0.5, 0.5] -> none"
    assert daemon.reload(2) == [told, "urbihw: settings read again"]
    assert daemon.ask(WRITE_FREELY).endswith('[true, ""]\n')


def test_many_requests_are_few_readings_and_the_last_one_counts(serve: Serve) -> None:
    daemon = serve()
    daemon.wait()
    began = time.monotonic()
    for number in range(3000):
        daemon.process.send_signal(signal.SIGHUP)
        if number % 100 == 0:
            time.sleep(0.01)
    daemon.config.write_text("prot = 1\n")
    daemon.process.send_signal(signal.SIGHUP)
    until(lambda: "settings stay as they were" in daemon.log(), daemon.log)
    readings = daemon.log().count("settings read again")
    assert readings <= 2 + (time.monotonic() - began), daemon.log()
    assert "Traceback" not in daemon.log() and "ignored" not in daemon.log()


def test_tokens_and_a_certificate_that_are_spoilt_are_a_line_each(serve: Serve, tmp_path: Path) -> None:
    state = tmp_path / "state"
    state.mkdir(mode=0o700)
    code, _, err = run("main", "access", "add", "alice", STATE_DIRECTORY=str(state))
    assert code == 0, err
    daemon = serve("--host", "0.0.0.0")
    daemon.wait()
    assert daemon.reload() == ["urbihw: settings read again"]
    tokens, certificate = state / "access" / "tokens", state / "access" / "certificate.pem"
    for kind in ("text", "fifo"):
        if kind == "text":
            tokens.write_text("garbage\n")
        else:
            tokens.unlink()
            os.mkfifo(tokens, 0o600)
        settings, line = daemon.reload(2)
        assert settings == "urbihw: settings read again"
        assert line.startswith(f"urbihw: no token is accepted until this is mended: {tokens}: ")
    certificate.write_text("garbage\n")
    _, _, line = daemon.reload(3)
    assert line.startswith(f"urbihw: the certificate stays as it was: tls_cert {certificate} and ")
    assert "Traceback" not in daemon.log()


@pytest.mark.parametrize("words", [("serve", "--platform", "bioloid", "--fake", "--config"), ("config", "check")])
def test_what_is_no_regular_file_is_refused_at_once(tmp_path: Path, words: tuple[str, ...]) -> None:
    fifo = tmp_path / "robot.toml"
    os.mkfifo(fifo)
    for file in (fifo, tmp_path, Path("/dev/zero")):
        code, _, err = run("main", *words, str(file))
        assert (code, err) == (78, f"urbihw: {file}: is not a regular file: name one that is\n")


# ---------------------------------------------------------------- the end


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("after", [0.2, 0.6, 1.0, 1.4])
def test_an_end_during_the_start_is_clean(serve: Serve, number: signal.Signals, after: float) -> None:
    daemon = serve()
    time.sleep(after)
    daemon.process.send_signal(number)
    # Before there is anything to end, the signal does what it does to any program; 1 while Python itself starts.
    assert daemon.process.wait(TIMEOUT_S) in (0, 1, 130, -number)
    # Before ``main`` runs, the interpreter speaks for itself.
    assert ", in main\n" not in daemon.log() and "asyncio" not in daemon.log(), daemon.log()
    assert not daemon.port_file.exists()
    # The bus worker removes its control socket itself, a moment after the daemon has ended.
    until(lambda: not list(daemon.config.parent.rglob("*.sock*")), daemon.log)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("pause", [0.0, 0.005, 0.03, 0.1])
def test_two_signals_end_it_as_one_does(serve: Serve, number: signal.Signals, pause: float) -> None:
    daemon = serve()
    daemon.wait()
    daemon.process.send_signal(number)
    time.sleep(pause)
    daemon.process.send_signal(number)
    assert daemon.process.wait(TIMEOUT_S) == 0
    assert daemon.log().splitlines()[-1] == "urbihw: stopped"
    assert not daemon.port_file.exists()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_an_end_during_a_reload_is_clean(serve: Serve, number: signal.Signals) -> None:
    daemon = serve()
    daemon.wait()
    daemon.process.send_signal(signal.SIGHUP)
    daemon.process.send_signal(number)
    daemon.process.send_signal(signal.SIGHUP)
    assert daemon.process.wait(TIMEOUT_S) == 0
    assert "Traceback" not in daemon.log()
    assert daemon.log().splitlines()[-1] == "urbihw: stopped"
