"""Two CAN channels to one base, and the two halves of an RMP 400 as one base."""

from __future__ import annotations

import math
from typing import Any

import pytest
from lab import RobotLab
from segway_lab import CanLab

from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd
from urbihw.kernel.uobject import BadConfig
from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.records import Records
from urbihw_fakes.device import Answer
from urbihw_fakes.segway.frames import TRACTOR
from urbihw_fakes.segway.rmp import SegwayRmp

SECOND = "can://pipe/second"


class PairLab(CanLab):
    """A lab with a second pipe."""

    def __init__(self, base: SegwayRmp | None = None, **options: Any) -> None:
        self.second = PipeEnd(lambda data, at: self.answer_second(self.other.feed(data, at)))
        self.other = self.make_other(base if base is not None else SegwayRmp())
        super().__init__(base, **options)

    def make_other(self, base: SegwayRmp) -> CanDevice:
        """What is behind the second pipe."""
        raise NotImplementedError

    def context(self) -> Context:
        return Context(self.bus_clock, {"robot": self.end, "second": self.second})

    def answer_second(self, answers: list[Answer]) -> None:
        """Frames to the second pipe."""
        if self.second.plugged:
            for answer in answers:
                self.second.send(answer.data, answer.at)


class ChannelLab(PairLab):
    """A base with both of its buses; ``deaf`` is whether the first carries no frames of the base."""

    deaf = False

    def __init__(self, **options: Any) -> None:
        super().__init__(SegwayRmp(mode=TRACTOR), second_channel=SECOND, **options)

    def make_other(self, base: SegwayRmp) -> CanDevice:
        """The same base."""
        return CanDevice(base, Records())

    def step(self) -> None:
        """See ``RobotLab``: what the base says goes to both."""
        answers = self.device.tick(self.bus_clock.now())
        self.answer_second(answers)
        if self.end.plugged and not self.deaf:
            self._answer(answers)
        RobotLab.step(self)


class HalvesLab(PairLab):
    """An RMP 400: two bases."""

    def __init__(self, **options: Any) -> None:
        self.back = SegwayRmp("400", mode=TRACTOR)
        super().__init__(SegwayRmp("400", mode=TRACTOR), second_base=SECOND, model="400", **options)

    def make_other(self, base: SegwayRmp) -> CanDevice:
        """The second half."""
        return CanDevice(self.back, Records())

    def step(self) -> None:
        self.answer_second(self.other.tick(self.bus_clock.now()))
        super().step()


# ---------------------------------------------------------------- two channels


def channels() -> ChannelLab:
    lab = ChannelLab.ready()
    lab.say("rmp.forwardSpeed = 0.5;", 2.0)
    assert lab.base.body.speed == pytest.approx(0.5, abs=0.01)
    return lab


def test_commands_go_to_both_channels() -> None:
    lab = ChannelLab.ready()
    lab.base.heard = 0
    lab.run(1.0)
    assert lab.base.heard == pytest.approx(100, abs=4)


@pytest.mark.parametrize("which", ["first", "second"])
def test_a_pulled_channel_is_one_line_and_the_base_drives_on(which: str, caplog: pytest.LogCaptureFixture) -> None:
    lab = channels()
    end = lab.end if which == "first" else lab.second
    lab.say('at (rmp.state != "ok" || rmp.stale || rmp.forwardSpeed < 0.4) echo("seen");')
    end.unplug()
    lab.run(3.0)
    assert f"the {which} channel does not work" in caplog.text
    assert lab.look("segway.link; segway.state;").split() == ["true", '"ok"']
    assert lab.base.body.speed == pytest.approx(0.5, abs=0.01)
    end.replug()
    lab.until(lambda: f"the {which} channel works again" in caplog.text)
    lab.run(1.0)
    assert len([line for line in caplog.text.splitlines() if "channel" in line]) == 2
    assert lab.heard() == ""
    assert lab.number("rmp.forward") == pytest.approx(lab.base.body.forward, abs=0.05)


def test_a_silent_first_channel_is_replaced_by_the_second(caplog: pytest.LogCaptureFixture) -> None:
    lab = channels()
    lab.deaf = True
    lab.run(1.0)
    assert "the first channel does not work: it is silent" in caplog.text
    assert lab.look("segway.state") == '"ok"'
    assert lab.number("rmp.forward") == pytest.approx(lab.base.body.forward, abs=0.05)
    lab.deaf = False
    lab.run(1.0)
    assert "the first channel works again" in caplog.text


def test_without_both_channels_the_link_is_lost_and_comes_back() -> None:
    lab = channels()
    lab.end.unplug()
    lab.second.unplug()
    lab.run(1.0)
    assert lab.look("segway.link") == "false"
    assert lab.base.body.speed == 0.0
    lab.end.replug()
    lab.second.replug()
    lab.run(3.0)
    assert lab.look("segway.state") == '"ok"'
    assert lab.base.body.speed == 0.0
    lab.say("rmp.forwardSpeed = 0.3;", 1.0)
    assert lab.base.body.speed == pytest.approx(0.3, abs=0.01)


# ---------------------------------------------------------------- two halves


def halves() -> HalvesLab:
    lab = HalvesLab.ready()
    lab.say("rmp.forwardSpeed = 0.5; rmp.yawSpeed = 0.2;", 2.0)
    return lab


def test_both_halves_drive_and_are_read_as_one() -> None:
    lab = halves()
    for base in (lab.base, lab.back):
        assert base.body.speed == pytest.approx(0.5, abs=0.01)
        assert base.body.turn == pytest.approx(0.2, abs=0.02)
    lab.back.body.volts, lab.base.body.volts = 68.0, 74.0
    lab.back.body.slip = 0.0
    lab.run(0.2)
    mean = (lab.base.body.forward + lab.back.body.forward) / 2
    assert lab.number("rmp.forward") == pytest.approx(mean, abs=0.02)
    assert lab.number("rmp.voltage") == pytest.approx(68.0, abs=1.0)
    assert lab.say("rmp.motors; rmp.mode; rmp.fault;") == 'true\n"tractor"\n""'
    lab.say("rmp.forwardSpeed = 0; rmp.yawSpeed = 0;", 1.0)
    before = lab.back.body.yaw
    lab.say("robot.turn(90deg);", 6.0)
    assert lab.number("rmp.yaw") == pytest.approx(lab.back.body.yaw, abs=0.05)
    assert abs(math.degrees(lab.back.body.yaw - before)) == pytest.approx(90, abs=3)


def test_the_emergency_stop_of_one_half_stops_both() -> None:
    lab = halves()
    lab.back.estop = True
    lab.run(1.5)
    assert (lab.base.body.speed, lab.back.body.speed) == (0.0, 0.0)
    assert "emergency stop switch open" in lab.look("rmp.fault")
    assert lab.look("rmp.motors") == "false"


@pytest.mark.parametrize("which", [0, 1])
def test_a_half_that_is_silent_stops_both(which: int, caplog: pytest.LogCaptureFixture) -> None:
    lab = halves()
    device = (lab.device, lab.other)[which]
    device.faults.start("silence")
    lab.run(1.5)
    assert f"the base is lost: its {('first', 'second')[which]} half says nothing" in caplog.text
    assert (lab.base.body.speed, lab.back.body.speed) == (0.0, 0.0)
    device.faults.stop("silence")
    lab.run(1.0)
    assert lab.look("segway.state") == '"ok"'
    assert (lab.base.body.speed, lab.back.body.speed) == (0.0, 0.0)


@pytest.mark.parametrize("which", [0, 1])
def test_a_pulled_cable_of_one_half_stops_both(which: int) -> None:
    lab = halves()
    end = (lab.end, lab.second)[which]
    end.unplug()
    lab.run(1.5)
    assert (lab.base.body.speed, lab.back.body.speed) == (0.0, 0.0)
    # The half that was told so stops at once; the other one by itself, after its 0.4 s.
    other = (lab.back, lab.base)[which]
    assert other.last_command == (0, 0)
    end.replug()
    lab.run(5.0)
    assert lab.look("segway.state") == '"ok"'
    lab.say("rmp.forwardSpeed = 0.3;", 1.0)
    for base in (lab.base, lab.back):
        assert base.body.speed == pytest.approx(0.3, abs=0.01)


def test_the_coders_of_both_halves_begin_anew_together() -> None:
    lab = halves()
    lab.say("robot.stop;", 1.0)
    lab.say("rmp.resetCoders;", 1.0)
    assert lab.number("rmp.forward") == pytest.approx(0.0, abs=0.01)
    lab.say("rmp.forwardSpeed = 0.5;", 2.0)
    assert lab.number("rmp.forward") == pytest.approx(1.0, abs=0.2)


def test_a_channel_and_a_half_exclude_each_other() -> None:
    with pytest.raises(BadConfig, match="second_base is set too"):
        HalvesLab(second_channel="can://pipe/third")
