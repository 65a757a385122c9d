"""Two witnesses that are not ours: our session calls services of a real libqi, and libqi's client calls our Nao.

libqi (PyPI ``qi``) is there on x86-64 only.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from urbihw import buses
from urbihw.buses.errors import Unavailable
from urbihw.buses.qi.session import Session
from urbihw_fakes.nao.device import Nao
from urbihw_fakes.nao.endpoint import NaoEndpoint

if importlib.util.find_spec("qi") is None:
    pytest.skip("libqi is not there", allow_module_level=True)
pytestmark = pytest.mark.e2e

HERE = Path(__file__).parent


@pytest.fixture
def session() -> Iterator[Session]:
    """Ours, with a libqi in a process of its own."""
    command = [sys.executable, str(HERE / "libqi_server.py")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None and server.stdin is not None
        # libqi logs to the standard output, too.
        url = next(line for line in server.stdout if line.startswith("tcp://")).strip()
        with buses.open_link(url.replace("tcp://", "qi://")) as link:
            made = Session(link)
            made.authenticate()
            yield made
        server.stdin.close()
        server.wait(10)


def ask(session: Session, name: str, *arguments: object) -> object:
    """Call a method of its service and wait."""
    return session.wait(session.call(session.look_up("ALMotion"), name, *arguments))


def test_our_session_speaks_to_libqi(session: Session) -> None:
    assert {"ServiceDirectory", "ALMotion"} <= set(session.names())
    assert "getAngles" in session.look_up("ALMotion").meta.names()
    assert ask(session, "getAngles", ["HeadYaw", "HeadPitch"], True) == [0.5, 0.5]
    for value in (1, 2.5, True, "x", [1, 2.5, "a"], [1.0, 2.0], {"a": 1}, None, 1 << 40, [], ["ä"]):
        assert ask(session, "echo", value) == value


def test_overloads_of_libqi(session: Session) -> None:
    ask(session, "moveTo", 1, 2.0, 3.0)
    assert ask(session, "which") == ["three", 1.0, 2.0, 3.0]
    ask(session, "moveTo", 1.0, 2.0, 3.0, 4.0)
    assert ask(session, "which") == ["four", 1.0, 2.0, 3.0, 4.0]


def test_errors_and_bytes_of_libqi(session: Session) -> None:
    with pytest.raises(Unavailable) as error:
        ask(session, "boom")
    assert str(error.value) == "ValueError: no such joint"
    image = ask(session, "image")
    assert isinstance(image, tuple) and image[6] == bytes([255, 0, 128, 1, 2, 3])
    with pytest.raises(Unavailable, match="Cannot find service 'ALNothing' in index"):
        session.look_up("ALNothing")


def test_signals_and_properties_of_libqi(session: Session) -> None:
    heard: list[object] = []
    motion = session.look_up("ALMotion")
    link = session.listen(motion, "moved", heard.append)
    ask(session, "fire")
    # The event comes on the same connection; the answer to the next call is behind it.
    ask(session, "echo", 1)
    assert heard == [("HeadYaw", 0.25)]
    session.stop_listening(link)
    ask(session, "fire")
    ask(session, "echo", 1)
    assert len(heard) == 1
    session.wait(session.set_property(motion, "level", 7))
    assert session.wait(session.get_property(motion, "level")) == 7


def test_libqi_speaks_to_our_nao() -> None:
    with NaoEndpoint(Nao()) as robot:
        robot.start()
        url = robot.url.replace("qi://", "tcp://")
        command = [sys.executable, str(HERE / "libqi_client.py"), url]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        told = [line for line in done.stdout.splitlines() if line.startswith("told ")]
        assert told == [
            "told ALMotion True",
            "told angles [0.0, 0.5]",
            "told awake True",
            "told head 0.5",
            "told walked 0.1",
            "told event 1.0",
            "told error ALMotion: Nose is not a recognized joint name",
        ], done.stdout + done.stderr
