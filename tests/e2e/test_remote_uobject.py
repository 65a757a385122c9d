"""Devices in a process of their own, with real processes, sockets and signals."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

TIMEOUT_S = 60.0

MODULE = '''
from urbihw.kernel.uobject import UObject, function, owned, threaded, LOCK_NONE

class Counter(UObject):
    val = owned(0.0)

    def init(self) -> None:
        self.notify_change(self.val, self.written)

    def written(self) -> None:
        self.val.value = self.val.value + 1

    @threaded(LOCK_NONE)
    def slow(self, seconds: float) -> str:
        import time
        time.sleep(seconds)
        return "done"

    def on_connected(self) -> None:
        print("connected", flush=True)

    def on_disconnected(self) -> None:
        print("disconnected", flush=True)
'''


class Setting:
    """A server on a port that stays the same, and a remote; each may be started and stopped."""

    def __init__(self, folder: Path) -> None:
        (folder / "counter.py").write_text(MODULE)
        self.environment = {**os.environ, "URBI_UOBJECT_PATH": str(folder)}
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.running: list[subprocess.Popen[str]] = []

    def start(self, code: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-c", code]
        process = subprocess.Popen(
            command, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.running.append(process)
        return process

    def server(self) -> subprocess.Popen[str]:
        code = f"from urbihw.cli.urbi import main; raise SystemExit(main(['-q', '-P', '{self.port}']))"
        process = self.start(code)
        self.ask("1;", 1)
        return process

    def remote(self, module: str = "counter", more: str = "") -> subprocess.Popen[str]:
        return self.start(
            "import logging; logging.basicConfig(); from urbihw.remote import run; "
            f"raise SystemExit(run([{module!r}], port={self.port}{more}))"
        )

    def connect(self) -> socket.socket:
        """A connection, as soon as there can be one."""
        end = time.monotonic() + TIMEOUT_S
        while True:
            try:
                return socket.create_connection(("127.0.0.1", self.port), timeout=TIMEOUT_S)
            except OSError:
                assert time.monotonic() < end, "there is no server"
                time.sleep(0.05)

    def ask(self, text: str, lines: int) -> list[str]:
        """What a fresh connection is answered."""
        with self.connect() as connection:
            connection.sendall(text.encode())
            with connection.makefile("rb") as file:
                return [file.readline().decode("latin-1").partition("] ")[2].rstrip("\n") for _ in range(lines)]


@pytest.fixture
def setting(tmp_path: Path) -> Iterator[Setting]:
    made = Setting(tmp_path)
    yield made
    for process in made.running:
        process.kill()
        process.communicate()


def test_join_work_lose_the_server_and_come_back(setting: Setting) -> None:
    server = setting.server()
    remote = setting.remote()
    wait = 'waituntil(uobjects.hasSlot("Counter"))|;'
    write = "var Global.c = Counter.new|; c.val = 4| timeout (20s) waituntil (c.val == 5); c.val;"
    assert setting.ask(wait + write, 1) == ["5"]
    assert setting.ask('c.slow(2s), timeout(0.1s) sleep(1s); echo("meanwhile");', 1) == ["*** meanwhile"]
    server.kill()
    server.wait()
    setting.server()
    again = 'waituntil(uobjects.hasSlot("object_1"))|; timeout (20s) waituntil (object_1.val == 5);'
    assert setting.ask(f"{again} object_1.val; object_1.slow(0);", 2) == ["5", '"done"']
    remote.send_signal(signal.SIGTERM)
    said, _ = remote.communicate(timeout=TIMEOUT_S)
    assert remote.returncode == 0
    assert said.split() == ["disconnected", "connected", "disconnected"]


def test_what_cannot_begin_says_why(setting: Setting) -> None:
    for module, code, words in (
        ("counter", 1, f"cannot reach 127.0.0.1:{setting.port}: "),
        ("nix", 66, "module nix not found in "),
    ):
        remote = setting.remote(module)
        _, said = remote.communicate(timeout=TIMEOUT_S)
        assert remote.returncode == code
        assert words in said and "Traceback" not in said


def test_a_second_remote_of_the_same_class_is_told(setting: Setting) -> None:
    setting.server()
    setting.remote()
    setting.ask('waituntil(uobjects.hasSlot("Counter"))|; 1;', 1)
    second = setting.remote()
    _, said = second.communicate(timeout=TIMEOUT_S)
    assert second.returncode == 1
    assert f"class Counter is served at 127.0.0.1:{setting.port} by somebody else already" in said
    assert setting.ask("Counter.new.slow(0);", 1) == ['"done"']


def test_a_server_that_is_none_is_left_alone(setting: Setting) -> None:
    with socket.create_server(("127.0.0.1", setting.port)) as listening:
        remote = setting.remote(more=", stay_alive=False")
        listening.settimeout(TIMEOUT_S)
        connection, _ = listening.accept()
        connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        connection.close()
        _, said = remote.communicate(timeout=TIMEOUT_S)
    assert remote.returncode == 0
    assert "Traceback" not in said
