"""A robot of ours among nodes that are not ours: ``urbihw serve --ros``, judged at the body of the simulated robot."""

from __future__ import annotations

import contextlib
import struct
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_p3dx import motors_on
from test_serve import Daemon, until

from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.start import TwoPtys
from urbihw_fakes.rosgraph import RosConnection, RosMasterFake, RosNodeFake

pytestmark = pytest.mark.e2e

TWIST_MD5 = "9f195f881246fdfa2798d1d3eebca84a"
BOOL_MD5 = "8b94c1b53db61fb6aed406028ad6332a"
ODOMETRY_MD5 = "cd5e73d190d741a2f92e81eda573aca7"
DIAGNOSTICS_MD5 = "60810da900de1dd6ddd437c3503511da"


@pytest.fixture
def master(monkeypatch: pytest.MonkeyPatch) -> Iterator[RosMasterFake]:
    made = RosMasterFake()
    monkeypatch.setenv("ROS_MASTER_URI", made.uri)
    for name in ("ROS_IP", "ROS_HOSTNAME"):
        monkeypatch.delenv(name, raising=False)
    yield made
    made.close()


@pytest.fixture
def serve(tmp_path: Path, master: RosMasterFake) -> Iterator[Callable[..., Daemon]]:
    with contextlib.ExitStack() as stack:
        yield lambda *arguments: stack.enter_context(
            contextlib.closing(Daemon(tmp_path, "--platform", "p3dx", "--quiet", "--ros", *arguments))
        )


@pytest.fixture
def node(master: RosMasterFake) -> Iterator[Callable[[str], RosNodeFake]]:
    with contextlib.ExitStack() as stack:
        yield lambda name: stack.enter_context(contextlib.closing(RosNodeFake(master, name)))


class Teleop:
    """A node that publishes a speed ten times in a second, until it is silent or dead."""

    def __init__(self, node: RosNodeFake, x: float, yaw: float) -> None:
        self.node = node
        node.publish("/cmd_vel", "geometry_msgs/Twist", TWIST_MD5)
        self._link: RosConnection = node.subscriber()
        self._data = struct.pack("<6d", x, 0, 0, 0, 0, yaw)
        self._silent = threading.Event()
        self._thread = threading.Thread(target=self._talk, daemon=True)
        self._thread.start()

    def _talk(self) -> None:
        with contextlib.suppress(OSError):
            while not self._silent.wait(0.1):
                self._link.send_message(self._data)

    def fall_silent(self) -> None:
        """Send nothing more, with an open connection."""
        self._silent.set()
        self._thread.join()

    def die(self) -> None:
        """Close all connections without a word."""
        self.fall_silent()
        self._link.close()


def test_publisher_drives_the_body(
    serve: Callable[..., Daemon], node: Callable[[str], RosNodeFake], master: RosMasterFake
) -> None:
    kit = Kit()
    with TwoPtys(kit.robot, kit.laser) as end:
        end.start()
        daemon = serve("--url", end.url)
        client = daemon.client()
        motors_on(client)
        until(lambda: "node /urbihw_" in daemon.log(), log=daemon.log)
        _look_at_topics(node("/viewer"), master)
        teleop = Teleop(node("/teleop"), 0.2, 0.3)
        until(lambda: kit.body.moving)
        until(lambda: float(client.ask("robot.position[\"theta\"];")) > 0.1)
        # Silence, with a connection that stays.
        teleop.fall_silent()
        until(lambda: not kit.body.moving)
        # Another one, killed while a window holds the interpreter.
        second = Teleop(node("/second"), 0.2, 0.0)
        until(lambda: kit.body.moving)
        daemon.client().say("loop|{};")
        second.die()
        until(lambda: not kit.body.moving)
        # The emergency stop, and the reason why an order is not carried out.
        stop = node("/red")
        stop.publish("/emergency_stop", "std_msgs/Bool", BOOL_MD5)
        stop.subscriber().send_message(b"\x01")
        until(lambda: client.ask("P3dx.estop;") == "true")
        third = Teleop(node("/third"), 0.2, 0.0)
        viewer, _ = node("/health").follow("/diagnostics", "diagnostic_msgs/DiagnosticArray", DIAGNOSTICS_MD5)
        until(lambda: b"/third: " in (told := viewer.receive_message()) and b"held by an emergency stop" in told)
        assert not kit.body.moving
        third.die()
        stop.subscriber().send_message(b"\x00")
        until(lambda: client.ask("P3dx.estop;") == "false")


def _look_at_topics(viewer: RosNodeFake, master: RosMasterFake) -> None:
    """Place and names of the topics, as another node sees them."""
    until(lambda: {"/odom", "/tf", "/scan", "/battery_state", "/diagnostics"} <= master.topics_of("/urbihw_fake"))
    link, answer = viewer.follow("/odom", "nav_msgs/Odometry", ODOMETRY_MD5)
    assert answer["callerid"] == "/urbihw_fake"
    data = link.receive_message()
    seconds, _, size = struct.unpack_from("<III", data, 4)
    assert abs(seconds - time.time()) < 10
    assert data[16 : 16 + size] == b"odom"
    assert data[20 + size : 29 + size] == b"base_link"
    first = link.receive_message()
    assert struct.unpack_from("<II", first, 4) > struct.unpack_from("<II", data, 4)
    link.close()
