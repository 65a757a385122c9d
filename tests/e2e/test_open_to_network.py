"""A robot that is opened to the network, as its owner and its clients meet it: real processes, TLS and terminals."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import starts
from programs_lab import TIMEOUT_S, Terminal, run

from urbihw.kernel.server.tcp import WANTS_TLS

pytestmark = pytest.mark.e2e

URBIHW = (sys.executable, "-m", "urbihw.cli.main")

REMOTE = """
from urbihw.kernel.uobject import UObject, function

class Adder(UObject):
    @function
    def add(self, a: float, b: float) -> float:
        return a + b
"""


class Robot:
    """A folder for all that daemon and clients keep, and a daemon that may be started again."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.environment = {
            "STATE_DIRECTORY": str(folder / "state"),
            "XDG_RUNTIME_DIR": str(folder / "run"),
            "XDG_CONFIG_HOME": str(folder / "config"),
            "XDG_STATE_HOME": str(folder / "history"),
            "URBI_UOBJECT_PATH": str(folder),
        }
        for name in ("state", "run", "config", "history"):
            (folder / name).mkdir(mode=0o700)
        self._log = folder / "log"
        self.process: subprocess.Popen[bytes] | None = None
        self.port = 0

    def access(self, *words: str) -> str:
        code, out, err = run("main", "access", *words, cwd=self.folder, **self.environment)
        assert code == 0, err
        return out.strip()

    def serve(self, settings: str = "") -> None:
        """A simulated Bioloid, for everybody who reaches this machine."""
        file, port_file = self.folder / "urbihw.toml", self.folder / "port"
        file.write_text(f'host = "0.0.0.0"\n{settings}')
        port_file.unlink(missing_ok=True)
        with self._log.open("w") as log:
            self.process = starts.Forked(
                (*URBIHW, "serve", "--platform", "bioloid", "--fake", "--config", str(file), "--port", "0",
                 "--port-file", str(port_file)),
                stdin=subprocess.DEVNULL, stdout=log, stderr=log, env={**os.environ, **self.environment},
            )  # fmt: skip
        end = time.monotonic() + TIMEOUT_S
        while not (port_file.exists() and port_file.read_text().endswith("\n")):
            assert self.process.poll() is None and time.monotonic() < end, self.log()
            time.sleep(0.02)
        self.port = int(port_file.read_text())

    def log(self) -> str:
        return self._log.read_text()

    def console(self, server: str, *options: str, text: str = "20 + 1", token: str = "") -> tuple[int, str, str]:
        environment = {**self.environment, "URBIHW_TOKEN": token}
        return run("main", "console", server, *options, stdin=text, cwd=self.folder, **environment)

    def close(self) -> None:
        if self.process is not None:
            self.process.send_signal(signal.SIGTERM)
            self.process.wait(TIMEOUT_S)
            self.process = None


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    made = Robot(tmp_path)
    yield made
    made.close()


def test_a_robot_for_the_network_without_any_token_does_not_start(robot: Robot) -> None:
    code, _, err = run("main", "serve", "--platform", "bioloid", "--fake", "--host", "0.0.0.0", "--port", "0",
                       cwd=robot.folder, **robot.environment)
    assert code == 78
    (line,) = err.splitlines()
    assert "there is no token yet: " in line and " access add NAME" in line and "allow_plain = true" in line


def test_allow_plain_lets_everybody_in_and_says_so_at_each_start(robot: Robot) -> None:
    robot.serve("allow_plain = true\n")
    assert "allow_plain: every computer that reaches 0.0.0.0 moves the robot and runs programs" in robot.log()
    code, out, _ = robot.console(f"127.0.0.1:{robot.port}")
    assert code == 0 and out.endswith("] 21\n")


def test_the_day_of_a_robot_on_the_network(robot: Robot) -> None:
    alice, bob = robot.access("add", "alice"), robot.access("add", "bob")
    robot.serve()
    assert "TLS on 0.0.0.0 for 2 who have a token" in robot.log()
    server, fingerprint = f"127.0.0.1:{robot.port}", robot.access("fingerprint")
    assert fingerprint in robot.log()

    # A stranger: not by plain text, not without trust, not without a token, not by HTTP.
    assert "speaks TLS, and wants a token: --tls" in robot.console(server)[2]
    code, _, err = robot.console(server, "--tls", token=alice)
    assert code == 69 and f"is not known yet; its fingerprint is {fingerprint}" in err
    code, _, err = robot.console(server, "--tls", "--trust")
    assert code == 69 and "wants a token" in err
    code, _, err = robot.console(server, "--tls", token="x" * 43)
    assert code == 69 and "token refused: it is wrong, or was removed" in err
    with socket.create_connection(("127.0.0.1", robot.port), TIMEOUT_S) as web:
        web.sendall(b"POST / HTTP/1.1\r\nContent-Type: text/plain\r\n\r\n*/;shutdown;\n")
        with contextlib.suppress(ConnectionError):
            assert web.recv(1000) in (b"", WANTS_TLS)

    # With a token, from wherever it comes; who it is can be read off what moves.
    code, out, _ = robot.console(server, "--tls", token=alice, text="motor6.val = 0.1|; motor6.why")
    assert code == 0 and re.search(r'"Lobby_\d+ \(alice, 127\.0\.0\.1\), at ', out)
    tokens = robot.folder / "config" / "urbihw" / "tokens"
    tokens.touch(0o600)
    tokens.write_text(f"127.0.0.1 {bob}\n")
    assert robot.console(server, "--tls")[1].endswith("] 21\n")
    code, _, err = run("send", "-H", "127.0.0.1", "-P", str(robot.port), "--tls", "-e", "echo(7);", "-Q",
                       cwd=robot.folder, **robot.environment)
    assert code == 0, err
    code, out, err = run("ping", "-H", "127.0.0.1", "-P", str(robot.port), "--tls", "-c", "1",
                         cwd=robot.folder, **robot.environment)
    assert code == 0 and "1 asked, 1 answered" in out, err

    # On this machine without a host: the UNIX socket, without a token.
    assert robot.console(f":{robot.port}", text='lobby.hasLocalSlot("remoteIP")')[1].endswith("] false\n")

    # Another certificate than before: the robot was set up anew, or it is another one.
    robot.close()
    (robot.folder / "state" / "access" / "certificate.pem").unlink()
    robot.serve()
    known = robot.folder / "config" / "urbihw" / "known_hosts"
    known.write_text(known.read_text().replace(server, f"127.0.0.1:{robot.port}"))
    code, _, err = robot.console(f"127.0.0.1:{robot.port}", "--tls", "--trust", token=alice)
    assert code == 69 and "somebody may be in between; if that" in err and f"delete line 1 of {known}" in err
    assert "Traceback" not in robot.log()


@pytest.mark.long
def test_who_is_removed_is_disconnected_within_seconds(robot: Robot) -> None:
    token = robot.access("add", "alice")
    robot.serve()
    talk = Terminal("main", "console", f"127.0.0.1:{robot.port}", "--tls", "--trust",
                    cwd=robot.folder, **{**robot.environment, "URBIHW_TOKEN": token})
    try:
        talk.wait("Ctrl-D leaves")
        talk.type("motor6.val = 0 sin:1s ampli:20deg,\r")
        talk.type("1 + 1;\r")
        talk.wait(r"\] 2\n")
        robot.access("remove", "alice")
        talk.wait("token refused: it is wrong, or was removed")
        talk.wait(r"\(denied\)> ")
        talk.type("\x04")
        assert talk.ended() == 0
    finally:
        talk.close()
    assert "(alice) refused: its token was removed" in robot.log()
    assert "6: stopped: the connection of Lobby_" in robot.log()


def test_the_console_shows_the_fingerprint_and_asks_for_the_token(robot: Robot) -> None:
    token = robot.access("add", "alice")
    robot.serve()
    talk = Terminal("main", "console", f"127.0.0.1:{robot.port}", "--tls", cwd=robot.folder, **robot.environment)
    try:
        shown = talk.wait(r"Trust it\? \(yes/no\) ")
        assert robot.access("fingerprint") in shown
        talk.type("yes\r")
        talk.wait("token for 127.0.0.1:")
        talk.type(f"{token}\r")
        assert token not in talk.wait("Ctrl-D leaves")
        talk.type("1 + 1;\r")
        talk.wait(r"\] 2\n")
        # Completion has a connection of its own, which gets in without another question.
        talk.type("System.shutdo\t")
        talk.wait(r"System\.shutdo[\s\S]*wn")
        talk.type("\x03\x04")
        assert talk.ended() == 0
    finally:
        talk.close()


def test_no_is_no(robot: Robot) -> None:
    robot.access("add", "alice")
    robot.serve()
    talk = Terminal("main", "console", f"127.0.0.1:{robot.port}", "--tls", cwd=robot.folder, **robot.environment)
    try:
        talk.wait(r"Trust it\? \(yes/no\) ")
        talk.type("no\r")
        assert talk.ended() == 69
        assert not (robot.folder / "config" / "urbihw").exists()
    finally:
        talk.close()


@pytest.mark.long
def test_a_device_in_a_process_of_its_own_joins_by_tls(robot: Robot) -> None:
    (robot.folder / "adder.py").write_text(REMOTE)
    token = robot.access("add", "camera")
    robot.serve()
    launch = (sys.executable, "-m", "urbihw.cli.launch", "--remote", "-H", "127.0.0.1", "-P", str(robot.port), "--tls")
    environment = {**os.environ, **robot.environment}
    refused = subprocess.run((*launch, "--trust", "adder"), env={**environment, "URBIHW_TOKEN": "wrong"},
                             stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=TIMEOUT_S)
    assert refused.returncode == 69 and "token refused" in refused.stderr
    joined = subprocess.Popen((*launch, "adder"), env={**environment, "URBIHW_TOKEN": token},
                              stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    try:
        text = 'waituntil(uobjects.hasSlot("Adder")); uobjects.Adder.new.add(40, 2)'
        assert robot.console(f":{robot.port}", text=text)[1].endswith("] 42\n")
        joined.send_signal(signal.SIGTERM)
        assert joined.wait(TIMEOUT_S) == 0
    finally:
        joined.kill()
        joined.wait()
        assert joined.stderr is not None
        joined.stderr.close()
