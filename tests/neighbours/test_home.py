"""A robot at a broker (mosquitto, with its own tools), in real time; and what the broker is told, without one."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import aiomqtt
import pytest
from lan_server import Lan, wait_for

import urbihw
from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.neighbours.home.bridge import HomeBridge
from urbihw.neighbours.home.orders_in import PAUSE_S, HomeOrder, JointQueue, goal_of, inbox_for
from urbihw.neighbours.home.settings import BridgeSettings
from urbihw.neighbours.home.things import MAX_THINGS, HomeTopics, discovery_text, state_text, things_of
from urbihw.neighbours.orders import OrderSettings

OVERVIEW: dict[str, list[Any]] = {
    "effectors": [
        {"slot": "elbow.val", "role": "joint", "unit": "rad", "min": -1, "max": 1},
        {"slot": "wrist.val", "role": "joint", "unit": "rad"},
        {"slot": "robot.xSpeed", "role": "base", "unit": "m/s"},
    ],
    "sensors": [
        {"slot": "robot.battery.remain", "role": "battery", "unit": "1"},
        {"slot": "eye.val", "role": "distance", "unit": "m"},
        {"slot": "camera.val", "role": "camera"},
    ],
}
TOPICS = HomeTopics("arm")


def test_the_home_sees_and_moves_what_it_may() -> None:
    things = things_of(OVERVIEW, ["elbow"])
    told = json.loads(discovery_text(TOPICS, "The arm", "X", things))
    parts = told["cmps"]
    assert [*parts] == ["elbow", "wrist", "robot_battery_remain", "eye", "stop", "estop", "problem"]
    assert (parts["elbow"]["p"], parts["elbow"]["command_topic"]) == ("number", "urbihw/arm/set/elbow")
    assert parts["elbow"]["retain"] is parts["elbow"]["optimistic"] is False
    assert parts["wrist"]["p"] == "sensor" and "command_topic" not in parts["wrist"]
    assert parts["robot_battery_remain"]["device_class"] == "battery"
    assert told["availability_topic"] == "urbihw/arm/availability"
    assert json.loads(state_text(things, [0.123456, None, 0.5, 3, False, ["hot"]])) == {
        "elbow": 0.12, "wrist": None, "robot_battery_remain": 50, "eye": 3, "estop": False, "problem": ["hot"],
    }  # fmt: skip
    for joints, reason in ((["wrist"], "wrist has no range"), (["camera"], "there is no joint camera")):
        with pytest.raises(ValueError, match=reason):
            things_of(OVERVIEW, joints)


@pytest.mark.parametrize(("topic", "payload"), [
    ("urbihw/arm/set/elbow", b"1.5"), ("urbihw/arm/set/elbow", b"nan"), ("urbihw/arm/set/elbow", b""),
    ("urbihw/arm/set/elbow", b"0;shutdown"), ("urbihw/arm/set/elbow", b"0" * 99), ("urbihw/arm/set/elbow", b"\xff"),
    ("urbihw/arm/set/wrist", b"0"), ("urbihw/arm/set/nobody", b"0"), ("elsewhere", b"0"), ("elbow", b"0"),
])  # fmt: skip
def test_what_is_no_order(topic: str, payload: bytes) -> None:
    things = {thing.name: thing for thing in things_of(OVERVIEW, ["elbow"])}
    with pytest.raises(HomeOrder):
        goal_of(TOPICS, things, topic, payload)
    assert goal_of(TOPICS, things, "urbihw/arm/set/elbow", b" 0.5 ")[1] == 0.5


def test_a_flood_moves_a_joint_to_its_newest_goal() -> None:
    begun, ended = list[float](), list[float]()

    async def move(goal: float) -> None:
        begun.append(goal)
        try:
            await asyncio.sleep(9)
        finally:
            ended.append(goal)

    async def flood() -> None:
        joint = JointQueue(move)
        task = asyncio.create_task(joint.run())
        for goal in range(1000):
            joint.put(goal)
            await asyncio.sleep(0)
        await asyncio.sleep(0.3)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(flood())
    assert begun[-1] == 999 and len(begun) == 2 and ended == begun


def test_a_stop_ends_the_goals_that_came_before_it() -> None:
    begun, ended = list[float](), list[float]()

    async def move(goal: float) -> None:
        begun.append(goal)
        try:
            await asyncio.sleep(9)
        finally:
            ended.append(goal)

    async def use() -> None:
        joint = JointQueue(move)
        task = asyncio.create_task(joint.run())
        joint.put(1)
        while not begun:
            await asyncio.sleep(0)
        joint.put(2)
        joint.clear()
        await asyncio.sleep(2 * PAUSE_S)
        assert begun == ended == [1]
        joint.put(3)
        while begun[-1] != 3:
            await asyncio.sleep(0.01)
        joint.put(4)
        joint.clear()
        joint.put(5)
        while begun[-1] != 5:
            await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(use())
    assert begun == ended == [1, 3, 5]


def message(topic: str, number: int = 0, retain: bool = False) -> aiomqtt.Message:
    return aiomqtt.Message(topic, b"0.5", 0, retain, number, None)


def test_a_stop_is_taken_from_a_full_inbox_before_all_that_came_earlier() -> None:
    async def use() -> None:
        inbox = inbox_for(TOPICS)(maxsize=3)
        for number in range(3):
            inbox.put_nowait(message(TOPICS.goal("elbow"), number))
        with pytest.raises(asyncio.QueueFull):
            inbox.put_nowait(message(TOPICS.stop, retain=True))
        inbox.put_nowait(message(TOPICS.stop, 7))
        inbox.put_nowait(message(TOPICS.goal("elbow"), 8))
        assert [(await inbox.get()).mid for _ in range(inbox.qsize())] == [7, 8]

    asyncio.run(use())


def test_the_home_sees_its_joints_and_sensors_behind_many_lights() -> None:
    lights = [{"slot": f"light{number}.val", "role": "light"} for number in range(MAX_THINGS)]
    eyes = [{"slot": f"eye{number}.val", "role": "distance", "unit": "m"} for number in range(MAX_THINGS)]
    joint = {"slot": "last.val", "role": "joint", "unit": "rad", "min": -1, "max": 1}
    overview = {"effectors": [*lights, *OVERVIEW["effectors"]], "sensors": [*eyes, *OVERVIEW["sensors"], joint]}
    things = things_of(overview, ["elbow", "last"])
    names = [thing.name for thing in things]
    assert len(names) == MAX_THINGS and {"elbow", "wrist", "last", "eye0"} <= {*names}


# ---------------------------------------------------------------- a real broker

SETUP = """
class Global.Elbow { var val = 0; var limitedBy = ""; var load = 1; }; Elbow.addProto(Interface.RotationalMotor);
class Global.Eye { var val = 3; }; Eye.addProto(Interface.DistanceSensor);
var Global.robot = Component.new("robot"); robot.addComponent("arm");
robot.arm.addDevice("elbow", Elbow.new); robot.arm.addDevice("eye", Eye.new); robot.makeCompactNames;
elbow.val->rangemin = -1; elbow.val->rangemax = 1;
var robot.problems = []; var robot.stops = 0; var robot.estop = false; var robot.model = "X";
function robot.stop() { stops += 1 };
"""


@pytest.fixture
def lan(tmp_path: Path) -> Iterator[Lan]:
    made = Lan(tmp_path)
    try:
        with urbihw.connect("127.0.0.1", made.plain_port, timeout=20) as robot:
            robot.run(SETUP)
        yield made
    finally:
        made.close()


class Broker:
    """mosquitto, and what its own tool hears there."""

    def __init__(self, folder: Path) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        config = folder / "mosquitto.conf"
        config.write_text(f"listener {self.port} 127.0.0.1\nallow_anonymous true\n")
        self._broker = subprocess.Popen(("mosquitto", "-c", str(config)), stderr=subprocess.DEVNULL)
        wait_for(self._answers, "the broker")
        self.told: dict[str, str] = {}
        command = ("mosquitto_sub", "-p", str(self.port), "-t", "#", "-v")
        self._ear = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        self._thread = threading.Thread(target=self._listen)
        self._thread.start()

    def _answers(self) -> bool:
        assert self._broker.poll() is None
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port)):
            return True
        return False

    def _listen(self) -> None:
        assert self._ear.stdout is not None
        for line in self._ear.stdout:
            topic, _, text = line.rstrip("\n").partition(" ")
            self.told[topic] = text

    def say(self, topic: str, text: str, *options: str) -> None:
        command = ("mosquitto_pub", "-p", str(self.port), "-t", topic, "-m", text, *options)
        subprocess.run(command, check=True)

    def wait(self, topic: str, holds: Callable[[str], Any]) -> None:
        wait_for(lambda: holds(self.told.get(topic, "")), topic)

    def close(self) -> None:
        for process in (self._ear, self._broker):
            process.terminate()
            process.wait()
        self._thread.join()
        assert self._ear.stdout is not None
        self._ear.stdout.close()


@pytest.mark.e2e
@pytest.mark.skipif(shutil.which("mosquitto") is None or shutil.which("mosquitto_pub") is None, reason="no mosquitto")
def test_a_robot_comes_to_a_broker_works_and_goes(lan: Lan, tmp_path: Path) -> None:
    orders = OrderSettings(Where("127.0.0.1", lan.plain_port, False), Credentials(), "home")
    with contextlib.ExitStack() as stack:
        broker = Broker(tmp_path)
        stack.callback(broker.close)
        broker.say("urbihw/arm/set/elbow", "0.9", "-r")
        broker.say("urbihw/arm/stop", "1", "-r")
        settings = BridgeSettings(orders, port=broker.port, name="arm", joints=("elbow",), rate=20)
        bridge = threading.Thread(target=serve, args=(HomeBridge(settings), ended := threading.Event()))
        bridge.start()
        stack.callback(bridge.join)
        stack.callback(ended.set)
        robot = stack.enter_context(urbihw.connect("127.0.0.1", lan.plain_port, timeout=20))
        broker.wait("urbihw/arm/availability", lambda text: text == "online")
        assert json.loads(broker.told["homeassistant/device/urbihw_arm/config"])["cmps"]["elbow"]["max"] == 1
        broker.wait("urbihw/arm/state", lambda text: text and json.loads(text)["eye"] == 3)
        robot.run("eye.val = 2|;")
        broker.wait("urbihw/arm/state", lambda text: json.loads(text)["eye"] == 2)
        assert robot.elbow.val == 0 and robot.robot.stops == 0, "retained orders are not obeyed"
        broker.say("urbihw/arm/set/elbow", "0.25")
        broker.wait("urbihw/arm/state", lambda text: json.loads(text)["elbow"] == 0.25)
        broker.say("urbihw/arm/set/elbow", "9")
        broker.wait("urbihw/arm/error", lambda text: "elbow: give a number from -1 to 1" in text)
        broker.say("urbihw/arm/set/eye", "1")
        broker.wait("urbihw/arm/error", lambda text: "not a joint that may be moved" in text)
        broker.say("urbihw/arm/stop", "")
        wait_for(lambda: robot.robot.stops == 1, "the stop")
        ended.set()
        broker.wait("urbihw/arm/availability", lambda text: text == "offline")


def serve(bridge: HomeBridge, ended: threading.Event) -> None:
    """Serve until an event."""

    async def until_ended() -> None:
        task = asyncio.create_task(bridge.run())
        while not ended.is_set() and not task.done():
            await asyncio.sleep(0.02)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(until_ended())
