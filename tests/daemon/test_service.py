"""The service in this process: what it refuses to start with, and its helpers.  What it does is in tests/e2e."""

from __future__ import annotations

import asyncio
import dataclasses
import logging
import os
import socket
from pathlib import Path

import pytest

from urbihw import platforms
from urbihw.buses import ports
from urbihw.buses.ports import SerialPort
from urbihw.daemon.access import Tokens
from urbihw.daemon.config import Config
from urbihw.daemon.holders import holder_of_file, holder_of_port
from urbihw.daemon.service import DaemonService, StartError
from urbihw.daemon.state import state_folder


def refusal(config: Config) -> str:
    with pytest.raises(StartError) as caught:
        asyncio.run(_run(config))
    assert "\n" not in str(caught.value)
    return str(caught.value)


async def _run(config: Config) -> int:
    return await DaemonService(config).run()


def test_an_unknown_platform_is_refused_with_those_there_are() -> None:
    assert refusal(Config(platform="roomba")).startswith("no platform 'roomba'; there are: bioloid")


def test_a_port_in_use_is_refused_before_the_robot_is_touched() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        line = refusal(Config(platform="bioloid", url="/dev/there-is-none", port=port))
    assert f"port {port} is in use" in line
    assert f"--port {port + 1}" in line


def test_an_address_of_another_machine_is_refused() -> None:
    assert "--host" in refusal(Config(platform="bioloid", host="192.0.2.1", port=0))


def test_an_address_that_others_reach_wants_tokens_and_a_certificate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    open_to_all = Config(platform="bioloid", url="/dev/null", host="0.0.0.0", port=0)
    assert "there is no token yet: urbihw access add NAME" in refusal(open_to_all)
    assert list((tmp_path / "access").iterdir()) == []
    Tokens(state_folder()).add("alice")
    assert refusal(dataclasses.replace(open_to_all, tls_cert="/none.pem")).startswith("/none.pem: cannot be read")
    assert "/dev/null is no serial port" in refusal(open_to_all)
    assert "/dev/null is no serial port" in refusal(dataclasses.replace(open_to_all, allow_plain=True))


def test_the_port_is_logged_before_the_file_that_tells_it_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Who waits for the file looks into the log next: a test, a script."""
    tmp_path.chmod(0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path))
    caplog.set_level(logging.INFO, "urbihw.daemon")
    config = Config(platform="bioloid", url=str(tmp_path / "none"), port=0, port_file=str(tmp_path / "no" / "port"))
    assert "cannot write the port" in refusal(config)
    assert " of 127.0.0.1: bioloid: waiting for the robot" in caplog.text


def test_a_url_without_sense_is_refused() -> None:
    assert "carrier pigeon" in refusal(Config(platform="bioloid", url="carrier pigeon://x", port=0))


def test_options_without_sense_are_refused() -> None:
    line = refusal(Config(platform="bioloid", url="/dev/x", port=0, options={"protocol": 7}))
    assert line == 'bioloid: options.protocol: wants 1, 2 or "auto", not 7'


def test_several_adapters_that_may_be_the_robot_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    found = [
        SerialPort("/dev/ttyUSB0", 0x0403, 0x6014, "U2D2", "FT1"),
        SerialPort("/dev/ttyUSB1", 0x0403, 0x6014, "U2D2", "FT2"),
        SerialPort("/dev/ttyACM0", 0x1234, 0x5678, "a modem"),
    ]
    monkeypatch.setattr(ports, "serial_ports", lambda: found)
    assert refusal(Config(platform="bioloid", port=0)) == (
        "several adapters may be the bioloid: /dev/ttyUSB0 (U2D2 FT1), /dev/ttyUSB1 (U2D2 FT2); choose one: --url"
    )
    found.pop(0)
    assert [each.url for each in platforms.adapters(platforms.find("bioloid"))] == ["/dev/ttyUSB1"]


# ---------------------------------------------------------------- who holds what


def process(proc: Path, number: int, name: str, *targets: str) -> None:
    """A process in a /proc of our own."""
    folder = proc / str(number)
    (folder / "fd").mkdir(parents=True)
    (folder / "comm").write_text(name + "\n")
    for descriptor, target in enumerate(targets):
        (folder / "fd" / str(descriptor)).symlink_to(target)


TCP = """  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode
   0: 0100007F:D2F0 00000000:0000 0A 00000000:00000000 00:00000000 00000000  1000        0 777 1
   1: 0100007F:D2F0 0100007F:9C40 01 00000000:00000000 00:00000000 00000000  1000        0 888 1
"""


def test_the_holder_of_a_port_is_found_by_its_listening_socket(tmp_path: Path) -> None:
    (tmp_path / "net").mkdir()
    (tmp_path / "net" / "tcp").write_text(TCP)
    process(tmp_path, 7, "client", "socket:[888]")
    process(tmp_path, 42, "urbi", "/dev/null", "socket:[777]")
    assert holder_of_port(54000, tmp_path) == "urbi (process 42)"
    assert holder_of_port(54001, tmp_path) == ""


def test_the_holder_of_a_device_is_found_behind_a_link_and_never_oneself(tmp_path: Path) -> None:
    device = tmp_path / "ttyUSB0"
    device.touch()
    (tmp_path / "robot").symlink_to(device)
    process(tmp_path, os.getpid(), "self", str(device))
    assert holder_of_file(str(tmp_path / "robot"), tmp_path) == ""
    process(tmp_path, 99, "minicom", str(device))
    assert holder_of_file(str(tmp_path / "robot"), tmp_path) == "minicom (process 99)"
