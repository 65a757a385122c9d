"""Ros of urbiscript beside a real ROS 1: master and commands of Debian's packages, which know nothing of us.

    apt install --no-install-recommends python3-rosmaster python3-rostopic python3-rosservice python3-std-msgs
"""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_serve import until

URBI = (sys.executable, "-m", "urbihw.cli.urbi")
pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif(
        not all(map(shutil.which, ("rosmaster", "rostopic"))), reason="no ROS 1: python3-rosmaster, python3-rostopic"
    ),
]


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[dict[str, str]]:
    """A master; the environment for those who use it."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    environment = {
        **os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{port}", "ROS_HOME": str(tmp_path),
        "ROS_IP": "127.0.0.1", "ROS_HOSTNAME": "127.0.0.1",
    }  # fmt: skip
    master = subprocess.Popen(("rosmaster", "--core", "-p", str(port)), env=environment, stdout=subprocess.DEVNULL)
    yield environment
    master.terminate()
    master.wait(10)


TALK = """
waituntil({ try { Ros.checkMaster } catch { false } });
var talker = Ros.Topic.new("/chatter")|;
talker.advertise("std_msgs/String", true);
var msg = talker.structure.new;
msg["data"] = "Hello ROS world"|;
talker << msg|;
var listener = Ros.Topic.new("/back")|;
listener.advertise("std_msgs/String");
listener.unadvertise;
listener.subscribe;
at (listener.onMessage?(var e)) { echo(e) | shutdown };
echo("ready");
"""


def test_talker_and_listener_of_the_tutorial(ros: dict[str, str], tmp_path: Path) -> None:
    """Both directions, with the type and the sum that ROS itself knows."""
    log = (tmp_path / "urbi").open("w+")
    program = tmp_path / "talk.u"
    program.write_text(TALK)
    urbi = subprocess.Popen((*URBI, "--quiet", "-f", str(program)), env=ros, stdout=log, stdin=subprocess.PIPE)
    said = Path(log.name).read_text
    until(lambda: "ready" in said(), log=said)
    run = {"env": ros, "capture_output": True, "text": True, "timeout": 60}
    heard = subprocess.run(("rostopic", "echo", "-n", "1", "/chatter"), **run)  # type: ignore[call-overload]
    assert 'data: "Hello ROS world"' in heard.stdout
    published = subprocess.run(
        ("rostopic", "pub", "-1", "/back", "std_msgs/String", "data: from ROS"), **run  # type: ignore[call-overload]
    )
    assert published.returncode == 0, published.stderr
    urbi.wait(30)
    assert '["data" => "from ROS"]' in said()
    log.close()
    assert urbi.stdin is not None
    urbi.stdin.close()
