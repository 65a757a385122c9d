"""Lasers that change while they scan, send what cannot be read, or flood the line."""

from __future__ import annotations

import math
import time

import pytest
from p3dx_lab import Lab

from urbihw.buses.errors import BadFrame
from urbihw.navigation.lasers import cola, lms200, scip
from urbihw_fakes.device import Answer
from urbihw_fakes.p3dx.kit import P3dx as Kit


def scanning(model: str) -> Lab:
    """A robot whose laser is on."""
    lab = Lab.ready(Kit(slip=0.0, laser=model), laser_model=model)
    lab.say("P3dx.body.laser.load = 1;", 2.5)
    assert lab.look("P3dx.body.laser.state") == '"on"'
    return lab


def test_a_sick_laser_whose_sector_changes_is_shown_at_its_new_angles() -> None:
    lab = scanning("lms1xx")
    laser = lab.kit.laser
    laser.first, laser.step, laser.count = 22.5, 0.25, 541
    lab.run(0.5)
    assert lab.number("P3dx.body.laser.angleMin") == pytest.approx(math.radians(-67.5), abs=1e-4)
    assert lab.number("P3dx.body.laser.angleMax") == pytest.approx(math.radians(67.5), abs=1e-4)
    assert lab.number("P3dx.body.laser.resolution") == pytest.approx(math.radians(0.25), abs=1e-6)
    laser.first, laser.count = 0.0, 181
    lab.run(0.5)
    assert lab.number("P3dx.body.laser.val.size") == 181
    assert lab.number("P3dx.body.laser.angleMin") == pytest.approx(math.radians(-90), abs=1e-4)
    assert lab.number("P3dx.body.laser.angleMax") == pytest.approx(math.radians(-45), abs=1e-4)


@pytest.mark.parametrize("model", ["lms1xx", "urg", "lms200"])
def test_a_laser_whose_scans_cannot_be_read_is_lost(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    lab = scanning(model)
    laser = lab.kit.laser
    if model == "lms1xx":
        laser.count = 1
    elif model == "urg":
        monkeypatch.setattr(laser, "_scan", lambda now: [b"000"])
    else:
        # Valid telegrams of a kind that is no scan.
        reply = b"\x02\x80\x03\x00\xa0\x00\x10"
        telegram = reply + lms200.crc16(reply).to_bytes(2, "little")
        monkeypatch.setattr(laser, "tick", lambda now: [Answer(now, telegram)])
    lab.run(4.5)
    assert lab.look("P3dx.body.laser.state") == '"lost"'


@pytest.mark.parametrize(
    "rows",
    [{"DMAX": b"9" * 400}, {"DMAX": b"9" * 26}, {"DMAX": b"262144"}, {"AMAX": b"8192"}, {"ARES": b"1e3"}],
)
def test_parameters_of_a_hokuyo_that_make_no_sense_are_refused(rows: dict[str, bytes]) -> None:
    usual = {"DMIN": b"20", "DMAX": b"5600", "ARES": b"1024", "AMIN": b"44", "AMAX": b"725", "AFRT": b"384"}
    lines = tuple(name.encode() + b":" + value + b";" for name, value in (usual | rows).items())
    with pytest.raises(BadFrame):
        scip.parse_parameters(scip.ScipMessage("PP", "00", lines))


def test_a_status_with_control_characters_is_damage() -> None:
    framer = scip.ScipFramer()
    status = b"\x1bc"
    assert framer.feed(b"PP\n" + status + b"%c" % scip.check_sum(status) + b"\n\n") == []
    assert framer.damaged == 1


def test_a_hokuyo_that_says_nothing_readable_of_itself_scans_all_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    kit = Kit(laser="urg")
    execute = kit.laser._execute

    def answer(line: str, now: float) -> bytes:
        return b"VV\n00P\n" + b"x" * 50000 + b"\n\n" if line == "VV" else execute(line, now)

    monkeypatch.setattr(kit.laser, "_execute", answer)
    lab = Lab.ready(kit, laser_model="urg")
    lab.say("P3dx.body.laser.load = 1;", 4)
    assert lab.look("P3dx.body.laser.state") == '"on"'


@pytest.mark.parametrize(
    "flood",
    [b"\x02\x02\x02\x02\x00\x00\xe6\x78", b"\x02A", b"\x02\x02\x02\x02\x00\x00\x00\x04", b"\x02"],
    ids=["long headers", "text without end", "short telegrams", "starts"],
)
def test_a_flood_of_headers_keeps_the_worker_busy_for_moments_only(flood: bytes) -> None:
    framer = cola.ColaFramer()
    data = (flood * 65536)[:65536]
    begun = time.process_time()
    for _ in range(4):
        framer.feed(data)
    assert time.process_time() - begun < 1.0
    good = cola.telegram("sRA", "DeviceIdent", binary=False)
    framer.feed(b"\x03" * 60009)
    assert [message.name for message in framer.feed(good)] == ["DeviceIdent"]


def test_the_health_and_the_problems_of_the_robot_tell_of_a_lost_laser() -> None:
    lab = scanning("lms200")
    assert lab.findings() == []
    lab.laser_line.end.unplug()
    lab.run(1.0)
    (found,) = lab.findings()
    assert found.startswith("laser: lost: ")
    assert lab.look("P3dx.problems").startswith('["laser: ')
    assert lab.look("P3dx.body.laser.rate") == "0"
    lab.robot_line.end.unplug()  # another loss, and perhaps another worker, of the robot itself
    lab.run(1.0)
    lab.robot_line.end.replug()
    lab.run(8.0)
    assert lab.findings() == [found]
    lab.laser_line.end.replug()
    lab.run(8.0)
    assert lab.look("P3dx.body.laser.state") == '"on"'
    assert lab.findings() == []
    assert lab.look("P3dx.problems") == "[]"


def test_a_laser_that_is_switched_off_is_no_problem() -> None:
    lab = scanning("lms200")
    lab.laser_line.end.unplug()
    lab.run(1.0)
    assert lab.findings() != []
    lab.say("P3dx.body.laser.load = 0;", 0.5)
    assert lab.findings() == []
    assert lab.look("P3dx.problems") == "[]"
