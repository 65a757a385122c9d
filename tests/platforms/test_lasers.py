"""The lasers of ``navigation.lasers`` on simulated bases: found, scanning, lost, disturbed, used by the planner."""

from __future__ import annotations

import logging
import math
import random
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import nxt_lab
import pytest
import segway_lab
from driver_rig import DriverRig
from lab import HandWorker, RobotLab
from p3dx_lab import Lab, Line, PatientWorker

from urbihw.buses import messages as m
from urbihw.buses.driver import driver_of
from urbihw.buses.engine import Engine
from urbihw.buses.link import Context
from urbihw.navigation.lasers.device import MODELS as MODELS_OF
from urbihw.platforms.p3dx.robot import P3dx
from urbihw_fakes.p3dx.kit import LASERS
from urbihw_fakes.p3dx.kit import P3dx as Kit
from urbihw_fakes.p3dx.world import World

COUNTS = {"lms200": 181, "rplidar": 360, "urg": 681, "lms1xx": 541}
MODELS = sorted(COUNTS)
NEW = [model for model in MODELS if model != "lms200"]


def scanning(model: str, kit: Kit | None = None, **options: Any) -> Lab:
    """A robot whose laser is on."""
    lab = Lab.ready(kit if kit is not None else Kit(slip=0.0, laser=model), laser_model=model, **options)
    lab.say("P3dx.body.laser.load = 1;", 2.5)
    return lab


def at_driver(model: str) -> tuple[DriverRig, Any]:
    """The driver of a model, attached to a simulated laser."""
    device = Kit(laser=model).laser
    bench = type("Bench", (DriverRig,), {"driver_class": type(driver_of(MODELS_OF[model]))})(device)
    return bench.attach(), device


def distance_at(lab: Lab, angle: float) -> float:
    """The shown distance in a direction, rad to the left."""
    most, step = lab.number("P3dx.body.laser.angleMax"), lab.number("P3dx.body.laser.resolution")
    return lab.number(f"P3dx.body.laser.val[{round((most - angle) / step)}]")


@pytest.mark.parametrize("model", MODELS)
def test_it_sees_the_room_of_the_base(model: str) -> None:
    lab = scanning(model)
    assert lab.number("P3dx.body.laser.val.size") == COUNTS[model]
    x, y, heading = 0.5, 1.0, 0.4
    lab.kit.body.set_pose(x, y, heading)
    lab.run(1)
    lx, ly = x + 0.021 * math.cos(heading), y + 0.021 * math.sin(heading)
    for degrees in (-80, -30, 0, 45, 85):
        true = lab.kit.world.ray(lx, ly, heading + math.radians(degrees), 50)
        if true < 5:
            assert distance_at(lab, math.radians(degrees)) == pytest.approx(true, abs=0.08), degrees


@pytest.mark.parametrize("model", MODELS)
def test_all_readings_come_within_a_second(model: str) -> None:
    lab = Lab.ready(Kit(laser=model), laser_model=model)
    lab.say("P3dx.body.laser.load = 1;", 0.6)
    assert lab.number("P3dx.body.laser.val.size") == COUNTS[model]


@pytest.mark.parametrize("model", MODELS)
def test_switched_off_it_ends_its_scans(model: str) -> None:
    bench, device = at_driver(model)
    bench.run(1)
    assert device.scanning
    bench.driver.safe_stop()
    assert not device.scanning
    lab = scanning(model)
    lab.say("P3dx.body.laser.load = 0;", 0.5)
    assert lab.look("P3dx.body.laser.state") == '"off"'
    lab.say("P3dx.body.laser.load = 1;", 2)
    assert lab.look("P3dx.body.laser.state") == '"on"'


@pytest.mark.parametrize("model", MODELS)
def test_a_pulled_cable_and_a_lost_power_are_told_and_it_comes_back(
    model: str, caplog: pytest.LogCaptureFixture
) -> None:
    lab = scanning(model)
    lab.laser_line.end.unplug()
    lab.run(2)
    assert lab.look("P3dx.body.laser.state") == '"lost"'
    lab.laser_line.end.replug()
    lab.until(lambda: lab.look("P3dx.body.laser.state") == '"on"')
    lab.kit.laser.power_off(lab.bus_clock.now())
    lab.run(7)
    assert lab.look("P3dx.body.laser.state") == '"lost"'
    lab.kit.laser.power_on(lab.bus_clock.now())
    lab.until(lambda: lab.look("P3dx.body.laser.state") == '"on"', 20)
    lines = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert len(lines) == 4 and "sent no scan" in lines[2] and lines[3] == "laser: it is back"


@pytest.mark.parametrize("model", NEW)
def test_nobody_there_is_said_once(model: str, caplog: pytest.LogCaptureFixture) -> None:
    kit = Kit(laser=model)
    kit.laser.power_off(0)
    lab = scanning(model, kit)
    lab.run(10)
    (line,) = [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]
    assert "no laser answers on pipe://laser" in line


@pytest.mark.parametrize("model", MODELS)
def test_hostile_bytes_neither_end_the_worker_nor_show_nonsense(model: str) -> None:
    lab = scanning(model)
    noise = random.Random(model)
    heads = [b"\2\2\2\2\0\0\xff\0", b"\xa5\x5a\xff\xff\xff\xff\x81", b"\2\x80\xff\2", b"MD0044072501000\n99b\n"]
    for _ in range(150):
        data = noise.choice([b"", *heads]) + noise.randbytes(noise.randrange(400))
        lab.laser_line.end.send(data, lab.bus_clock.now())
        lab.run(0.02)
    lab.until(lambda: lab.look("P3dx.body.laser.state") == '"on"', 20)
    lab.run(1)
    assert lab.number("P3dx.body.laser.val.size") == COUNTS[model]


@pytest.mark.parametrize("model", NEW)
def test_the_planner_avoids_what_it_sees(model: str, tmp_path: Path) -> None:
    """A crate that is not on the map stands in the way."""
    lab = scanning(model)
    path = lab.write_map(tmp_path)
    lab.say("P3dx.body.load = 1; P3dx.body.sonar.load = 0;", 1)
    lab.say(f'P3dx.planner.mapFileName = "{path}"; at (P3dx.planner.pathPlanningEvent?(var how)) echo(how);')
    for _ in range(3):
        lab.thought()
        lab.run(0.1)
    lab.console().line("box 1.6 0 0.4")
    lab.say("P3dx.moveTo([2.4, 0, 0]);")
    heard = ""
    for _ in range(600):
        lab.thought()
        lab.run(0.1)
        heard += lab.heard()
        assert lab.kit.world.nearest(*lab.where()[:2])[0] > 0.2
        if heard:
            break
    assert heard == "*** 1"
    assert lab.where()[:2] == pytest.approx((2.4, 0), abs=0.12)


def test_a_laser_that_is_turned_is_shown_in_the_frame_of_the_base() -> None:
    lab = scanning("urg", laser_turn=90)
    lab.kit.body.set_pose(0, 0, 0)
    lab.run(1)
    # The simulated laser looks ahead; the settings say that its front is at the left.
    true = lab.kit.world.ray(0.021, 0, 0, 10)
    assert distance_at(lab, math.pi / 2) == pytest.approx(true, abs=0.05)


def test_what_is_behind_does_not_count_as_ahead() -> None:
    world = World([(-1, -1, -1, 1)])
    lab = scanning("rplidar", Kit(world, slip=0.0, laser="rplidar"))
    laser = cast(P3dx, lab.robot).laser
    assert laser.nearest() == math.inf
    world.walls.append((2, -1, 2, 1))
    lab.run(1)
    assert laser.nearest() == pytest.approx(1.979, abs=0.02)


# --- what only one of them has ----------------------------------------------------------------------------------------


def test_an_rplidar_tells_what_it_is_and_drives_its_motor() -> None:
    bench, device = at_driver("rplidar")
    assert device.duty == 660
    bench.driver.safe_stop()
    assert device.duty == 0
    lab = scanning("rplidar")
    assert lab.look("P3dx.body.laser.model") == '"RPLIDAR model 0x18, firmware 1.29, hardware 7"'
    assert lab.look("P3dx.body.laser.serial") == '"000102030405060708090A0B0C0D0E0F"'


def test_an_rplidar_that_is_broken_says_so(caplog: pytest.LogCaptureFixture) -> None:
    kit = Kit(laser="rplidar")
    kit.laser.broken = True
    scanning("rplidar", kit)
    assert "reports that it is broken (error 0x10)" in caplog.text


def test_a_hokuyo_in_its_old_mode_is_switched() -> None:
    kit = Kit(laser="urg")
    kit.laser.old = True
    lab = scanning("urg", kit)
    assert lab.look("P3dx.body.laser.model") == '"SOKUIKI Sensor URG-04LX"'
    assert lab.number("P3dx.body.laser.distanceMax") == 5.6


@pytest.mark.parametrize("speaks", ["A", "B"])
def test_cola_a_and_b(speaks: str) -> None:
    kit = Kit(laser="lms1xx")
    kit.laser.speaks = speaks
    lab = scanning("lms1xx", kit)
    assert lab.number("P3dx.body.laser.val.size") == 541
    assert lab.look("P3dx.body.laser.model") == '"LMS10x_FieldEval"'
    assert lab.number("P3dx.body.laser.angleMax") == pytest.approx(math.radians(135), abs=1e-4)


@pytest.mark.parametrize("speaks", ["A", "B"])
def test_a_sick_laser_that_stands_by_is_started(speaks: str) -> None:
    kit = Kit(laser="lms1xx")
    kit.laser.speaks, kit.laser.standby = speaks, True
    lab = scanning("lms1xx", kit)
    lab.run(2)
    assert lab.look("P3dx.body.laser.state") == '"on"'


def test_a_dirty_window_is_told() -> None:
    kit = Kit(laser="lms1xx")
    kit.laser.dirty = True
    assert scanning("lms1xx", kit).look("P3dx.body.laser.dirty") == "true"


# --- on other bases ---------------------------------------------------------------------------------------------------


class Carried:
    """A base of another kind as the body of a laser."""

    def __init__(self, pose: Callable[[], tuple[float, float, float]]) -> None:
        self._pose = pose
        self.world = World.room()

    @property
    def pose(self) -> tuple[float, float, float]:
        """Where the base truly is."""
        return self._pose()

    def advance(self, now: float) -> None:
        """Do nothing: the lab moves the base."""


class LaserOnABase(RobotLab):
    """Adds a laser on a pipe of its own to the lab of another platform."""

    def _pose(self) -> tuple[float, float, float]:
        raise NotImplementedError

    def __init__(self, model: str, **options: Any) -> None:
        self.laser_line = Line(LASERS[model](Carried(self._pose), threading.RLock()))  # type: ignore[arg-type]
        self.laser_workers: list[PatientWorker] = []
        super().__init__(laser="pipe://laser", laser_model=model, **options)

    def context(self) -> Context:
        context = super().context()
        return Context(context.clock, {**context.pipes, "laser": self.laser_line.end})

    def step(self) -> None:
        self.laser_line.tick(self.bus_clock.now())
        for worker in self.laser_workers:
            worker.step()
        super().step()

    def _start(self, url: str, **rest: Any) -> HandWorker:
        if ".lasers." not in rest["family"]:
            return super()._start(url, **rest)
        driver, begin = driver_of(rest["family"]), m.Begin(rest["settings"])
        worker = PatientWorker(lambda mailbox: Engine(url, driver, mailbox, begin, self.context()), rest["post"])
        self.laser_workers.append(worker)
        return worker


class Segway(LaserOnABase, segway_lab.Lab):
    """A Segway with a laser."""

    def _pose(self) -> tuple[float, float, float]:
        body = self.base.body
        return body.x, body.y, body.heading


class Nxt(LaserOnABase, nxt_lab.Lab):
    """A TriBot with a laser; it stands."""

    def _pose(self) -> tuple[float, float, float]:
        return 0.0, 0.0, 0.0


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("base", [Segway, Nxt])
def test_any_base_carries_one(base: type[LaserOnABase], model: str) -> None:
    lab = base.ready(model)
    assert lab.look("robot.body.laser.load") == "0"
    lab.say("robot.body.laser.load = 1;", 2)
    assert lab.number("robot.body.laser.val.size") == COUNTS[model]
    most, step = lab.number("robot.body.laser.angleMax"), lab.number("robot.body.laser.resolution")
    ahead = lab.number(f"robot.body.laser.val[{round(most / step)}]")
    assert ahead == pytest.approx(3.0 - 0.021, abs=0.05)
    lab.laser_line.end.unplug()
    lab.run(2)
    assert lab.look("robot.body.laser.state") == '"lost"'
    lab.robot.close()


def test_a_segway_corrects_its_odometry_by_scans(tmp_path: Path) -> None:
    lab = Segway.ready("lms1xx", localization="scan")
    path = tmp_path / "room.map"
    path.write_text(World.room().as_map(), "ascii")
    assert "the laser" in lab.say(f'robot.planner.mapFileName = "{path}";')
    lab.say("robot.body.laser.load = 1;", 2)
    lab.say(f'robot.planner.mapFileName = "{path}";')
    for _ in range(5):
        lab.thought()
        lab.run(0.2)
    assert lab.look("robot.planner.ready") == "true"


def test_a_base_without_a_laser_has_none() -> None:
    assert segway_lab.Lab.ready().look('robot.body.hasSlot("laser")') == "false"
