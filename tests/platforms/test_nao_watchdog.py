"""The program on the robot that stops it when urbihw is gone, and when urbihw feeds it."""

from __future__ import annotations

import ast
import logging
import sys
from pathlib import Path

import pytest
from nao_lab import Lab, stand
from nao_rig import TICK, Rig

from urbihw.buses.messages import Found, Refused, Targets
from urbihw_nao import watchdog as w
from urbihw_nao.call_part import BEGUN
from urbihw_nao.watchdog_part import FEED_PERIOD_S, HOLD_S
from urbihw_nao_fakes.behaviours import Behaviours
from urbihw_nao_fakes.device import Nao

PROGRAM = Path(w.__file__)
BRAKE_S = 0.4
"""What the body needs to stand, from 0.1 m/s."""


# ---------------------------------------------------------------- the program by itself


class Motion:
    """ALMotion, as far as the program needs it; ``fails`` is how many calls fail."""

    def __init__(self) -> None:
        self.called: list[str] = []
        self.active = True
        self.fails = 0

    def _call(self, name: str) -> None:
        if self.fails:
            self.fails -= 1
            raise RuntimeError("ALMotion is busy")
        self.called.append(name)

    def stopMove(self) -> None:
        self._call("stopMove")

    def killAll(self) -> None:
        self._call("killAll")

    def moveIsActive(self) -> bool:
        return self.active


def advance(watchdog: w.NaoWatchdog, seconds: float) -> None:
    """Let time pass."""
    for _ in range(round(seconds / TICK)):
        watchdog.advance(TICK)


def test_it_stops_once_when_it_was_fed_and_then_not_in_time(caplog: pytest.LogCaptureFixture) -> None:
    motion = Motion()
    watchdog = w.NaoWatchdog(motion)
    advance(watchdog, 5.0)
    assert (watchdog.state(), motion.called) == ("off", []), "never fed: it does nothing"
    for _ in range(10):
        watchdog.feed(0.5)
        advance(watchdog, 0.4)
    assert (watchdog.state(), motion.called) == ("fed", [])
    with caplog.at_level(logging.WARNING):
        advance(watchdog, 0.2)
    assert (watchdog.state(), motion.called) == ("stopping", ["stopMove"])
    assert "urbihw was not heard in time: the robot is stopped" in caplog.text
    motion.active = False
    advance(watchdog, 5.0)
    assert (watchdog.state(), motion.called) == ("stopped", ["stopMove", "killAll"])


def test_all_is_killed_when_a_walk_does_not_end() -> None:
    motion = Motion()
    watchdog = w.NaoWatchdog(motion)
    watchdog.feed(0.5)
    advance(watchdog, 0.6 + w.STAND_S)
    assert motion.called == ["stopMove", "killAll"]


def test_a_release_ends_it_and_a_feed_begins_it_again() -> None:
    motion = Motion()
    watchdog = w.NaoWatchdog(motion)
    watchdog.feed(0.5)
    watchdog.release()
    advance(watchdog, 2.0)
    assert (watchdog.state(), motion.called) == ("off", [])
    watchdog.feed(0.5)
    advance(watchdog, 0.6)
    watchdog.feed(0.5)
    assert (watchdog.state(), motion.called) == ("fed", ["stopMove"])
    motion.active = False
    advance(watchdog, 1.0)
    assert motion.called == ["stopMove", "stopMove", "killAll"]


def test_a_stop_that_fails_is_tried_again() -> None:
    motion = Motion()
    watchdog = w.NaoWatchdog(motion)
    watchdog.feed(0.1)
    watchdog.advance(0.2)
    assert motion.called == ["stopMove"]
    motion = Motion()
    motion.fails = 2
    watchdog = w.NaoWatchdog(motion)
    watchdog.feed(0.1)
    for _ in range(2):
        with pytest.raises(RuntimeError, match="busy"):
            watchdog.advance(0.2)
    watchdog.advance(0.02)
    assert motion.called == ["stopMove"]


@pytest.mark.parametrize("seconds", [0.0, -1.0, 11.0, float("nan"), float("inf")])
def test_a_time_that_is_none_is_refused(seconds: float) -> None:
    watchdog = w.NaoWatchdog(Motion())
    with pytest.raises(ValueError, match="give more than 0 and up to 10 seconds"):
        watchdog.feed(seconds)
    assert watchdog.state() == "off"


def test_clients_see_four_methods() -> None:
    service = w.WatchdogService(w.NaoWatchdog(Motion()))
    assert sorted(name for name in dir(service) if not name.startswith("_")) == ["feed", "release", "state", "version"]
    service.feed(1.0)
    assert (service.state(), service.version()) == ("fed", w.VERSION)
    service.release()
    assert service.state() == "off"


def test_the_file_is_enough_and_is_python_2_too() -> None:
    tree = ast.parse(PROGRAM.read_text("utf-8"))
    needed = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    assert needed - {"qi"} <= sys.stdlib_module_names
    newer = (ast.JoinedStr, ast.AnnAssign, ast.NamedExpr, ast.AsyncFunctionDef, ast.Nonlocal, ast.YieldFrom, ast.Match)
    for node in ast.walk(tree):
        assert not isinstance(node, newer)
        if isinstance(node, ast.FunctionDef):
            assert node.returns is None and not node.args.kwonlyargs and not node.args.posonlyargs
            assert all(argument.annotation is None for argument in node.args.args)
        if isinstance(node, ast.Raise):
            assert node.cause is None
    assert PROGRAM.read_text("utf-8").isascii() and PROGRAM.stat().st_mode & 0o111


# ---------------------------------------------------------------- the driver


def rig_with_watchdog() -> Rig:
    """A robot that stands, with the program, and a driver."""
    robot = Nao()
    robot.add_watchdog(PROGRAM)
    rig = Rig(robot)
    stand(rig.body)
    return rig.attach()


def calls(rig: Rig, name: str) -> int:
    """How often a method of the service was called."""
    (service,) = [each for each in rig.robot.services.values() if each.name == "UrbihwWatchdog"]
    return service.calls[name]


def lose_link(rig: Rig) -> None:
    """Nothing comes from us any more."""
    rig.driver.detach()
    rig.link.close()
    rig.robot.reconnect()


def live(rig: Rig, seconds: float) -> None:
    """The robot alone."""
    end = rig.clock.now() + seconds
    while rig.clock.now() < end:
        rig.robot.tick(rig.clock.now())
        rig.clock.sleep_until(rig.clock.now() + TICK)


def test_a_robot_that_stands_is_not_fed() -> None:
    rig = rig_with_watchdog()
    rig.run(2.0)
    assert calls(rig, "feed") == 0 and calls(rig, "release") == 0


def test_a_walk_is_fed_and_ends_when_the_link_is_lost() -> None:
    rig = rig_with_watchdog()
    rig.driver.targets(Targets({("walk", "x"): 0.1}))
    rig.run(TICK)
    assert calls(rig, "feed") == 1, "before it walks"
    rig.run(2.0)
    assert calls(rig, "feed") == pytest.approx(2.0 / FEED_PERIOD_S, abs=2)
    assert rig.body.walk[0] == pytest.approx(0.1, abs=0.001)
    lose_link(rig)
    live(rig, HOLD_S - FEED_PERIOD_S - 0.1)
    assert rig.body.walk[0] == pytest.approx(0.1, abs=0.001)
    live(rig, FEED_PERIOD_S + 0.1 + BRAKE_S)
    assert rig.body.walk == [0.0, 0.0, 0.0] and rig.body.standing
    assert rig.robot.motion.calls["stopMove"] == 1
    live(rig, 5.0)
    assert (rig.robot.motion.calls["stopMove"], rig.robot.motion.calls["killAll"]) == (1, 1)
    assert all(joint.stiffness == 1.0 for joint in rig.body.joints.values()), "nothing gets slack"
    assert "setFallManagerEnabled" not in rig.robot.motion.calls and rig.robot.motion.fall_manager


def test_without_the_program_a_walk_goes_on() -> None:
    rig = Rig()
    stand(rig.body)
    rig.attach()
    rig.driver.targets(Targets({("walk", "x"): 0.1}))
    rig.run(1.0)
    lose_link(rig)
    live(rig, 10.0)
    assert rig.body.walk[0] == pytest.approx(0.1, abs=0.001)


def test_a_stop_releases_it() -> None:
    rig = rig_with_watchdog()
    rig.driver.targets(Targets({("walk", "x"): 0.1}))
    rig.run(1.0)
    rig.driver.safe_stop()
    rig.run(TICK)
    assert calls(rig, "release") == 1
    before = calls(rig, "feed")
    rig.run(2.0)
    assert calls(rig, "feed") == before and calls(rig, "release") == 1


def test_an_orderly_end_releases_it() -> None:
    rig = rig_with_watchdog()
    rig.driver.targets(Targets({("walk", "x"): 0.1}))
    rig.run(1.0)
    rig.driver.safe_stop()
    rig.driver.detach()
    live(rig, 3.0)
    assert calls(rig, "release") == 1 and "killAll" not in rig.robot.motion.calls


def test_a_joint_on_its_way_and_what_a_service_does_are_fed() -> None:
    rig = rig_with_watchdog()
    rig.body.joints["HeadYaw"].fastest = 0.5
    rig.order(HeadYaw=1.0)
    rig.run(1.0)
    assert calls(rig, "feed") > 2 and calls(rig, "release") == 0
    rig.run(2.0)
    assert calls(rig, "release") == 1, "it is there"
    rig.request("call", "ALMotion", "moveTo", 5.0, 0.0, 0.0)
    before = calls(rig, "feed")
    rig.run(1.0)
    assert calls(rig, "feed") > before + 2
    lose_link(rig)
    live(rig, HOLD_S + BRAKE_S)
    assert not rig.body.walking


def test_a_behaviour_that_was_begun_here_ends_before_the_motion() -> None:
    rig = rig_with_watchdog()
    (manager,) = [each for each in rig.robot.services.values() if isinstance(each, Behaviours)]
    manager.start("dialog/wait")
    rig.request("call", "ALBehaviorManager", "startBehavior", "animations/wave")
    assert manager.get_running() == ["dialog/wait", "animations/wave"]
    lose_link(rig)
    live(rig, HOLD_S + BRAKE_S)
    assert (manager.stopped, manager.get_running()) == (["animations/wave"], ["dialog/wait"]), "those of others go on"
    place = rig.body.joints["RShoulderPitch"].angle
    live(rig, 3.0)
    assert rig.body.joints["RShoulderPitch"].angle == pytest.approx(place, abs=0.01)


@pytest.mark.parametrize("gone", ["ALBehaviorManager", "ALMemory", ""])
def test_the_walk_is_ended_whatever_becomes_of_the_behaviours(gone: str) -> None:
    class Memory:
        def getData(self, key: str) -> object:
            return 5 if not gone else [True, ["animations/wave"]]

    def find_service(name: str) -> object:
        if name == gone or name != "ALMemory":
            raise RuntimeError(f"no {name}")
        return Memory()

    motion = Motion()
    watchdog = w.NaoWatchdog(motion, find_service)
    watchdog.feed(0.5)
    advance(watchdog, 0.6 + w.STAND_S)
    assert motion.called == ["stopMove", "killAll"]


def test_the_program_and_the_driver_agree_on_the_key() -> None:
    assert w.BEGUN == BEGUN


def test_a_program_that_fails_is_told_of_once() -> None:
    rig = rig_with_watchdog()
    (service,) = [each for each in rig.robot.services.values() if each.name == "UrbihwWatchdog"]
    rig.driver.targets(Targets({("walk", "x"): 0.1}))
    rig.run(0.5)
    del rig.robot.services[service.number]
    told = [each for each in rig.run(3.0) if isinstance(each, Refused)]
    assert [(each.device, each.item) for each in told] == [("watchdog", "feed")]
    assert rig.body.walking, "the walk goes on, unguarded"


def test_a_program_out_of_reach_is_told_of() -> None:
    robot = Nao()
    info = ("UrbihwWatchdog", 0, "machine", 1, ["tcp://192.0.2.1:1"], "")
    number = robot.directory.register_service(info)
    robot.directory.foreign[number].ready = True
    rig = Rig(robot).attach()
    (info,) = next(each.devices for each in rig.news if isinstance(each, Found))
    assert info.unguarded.startswith("UrbihwWatchdog is in another process, out of reach: its end points are tcp://192.0.2.1")
    assert not [each for each in rig.news if isinstance(each, Refused)]


def test_a_link_that_is_back_is_guarded_again() -> None:
    rig = rig_with_watchdog()
    rig.driver.targets(Targets({("walk", "x"): 0.1}))
    rig.run(1.0)
    lose_link(rig)
    live(rig, 3.0)
    rig.attach()
    rig.driver.targets(Targets({("walk", "x"): 0.1}))
    before = calls(rig, "feed")
    rig.run(1.0)
    assert calls(rig, "feed") > before + 2 and rig.body.walking


# ---------------------------------------------------------------- what a user sees


@pytest.mark.parametrize(
    ("has_it", "words"),
    [
        (True, "the robot has UrbihwWatchdog, which stops it when it does not hear us"),
        (False, "the robot has no UrbihwWatchdog: a walk goes on when the connection is lost"),
    ],
)
def test_the_log_says_whether_the_robot_has_it(caplog: pytest.LogCaptureFixture, has_it: bool, words: str) -> None:
    robot = Nao()
    if has_it:
        robot.add_watchdog(PROGRAM)
    with caplog.at_level(logging.INFO):
        Lab.ready(device=robot)
    assert words in caplog.messages
