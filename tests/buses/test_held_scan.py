"""The search of a bus on a busy computer: answers are late, cut in two by a time-out, or come all at once."""

from __future__ import annotations

import random

import pytest

from urbihw.buses.servos.scan import scan
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.dynamixel.ax12 import Ax12

from .conftest import BAUD, Rig

IDS = [*range(1, 19), 100]


class HeldRig(Rig):
    """A kit whose process is held now and then: what it hears and says meanwhile comes when it goes on, in order.

    ``mean`` s are between two holds, ``most`` s is one; with ``cuts`` an answer may come in two pieces.
    """

    def __init__(self, seed: int, mean: float, most: float, cuts: bool, *units: Ax12) -> None:
        self._dice, self._cuts, self._said_at = random.Random(seed), cuts, 0.0
        self._holds: list[tuple[float, float]] = []
        time = 100.0
        while time < 115:
            time += self._dice.expovariate(1 / mean)
            self._holds.append((time, time + self._dice.uniform(0.02, most)))
            time = self._holds[-1][1]
        kit = Bioloid(baud=BAUD)
        for unit in units:
            unit.set_baud(BAUD)
            kit.add(unit)
        super().__init__(kit)

    def _goes_on(self, at: float) -> float:
        return next((end for begin, end in self._holds if begin <= at < end), at)

    def _receive(self, data: bytes, at: float) -> None:
        heard_at = self._goes_on(at)
        self.kit.tick(heard_at)
        for answer in self.kit.feed(data, heard_at):
            at = max(answer.at, self._said_at)
            self._said_at = self._goes_on(at)
            if self._cuts and (self._said_at > at or self._dice.random() < 0.05):
                self._said_at = max(self._said_at, at + self._dice.uniform(0, 0.05))
                self.end.send(answer.data[:4], at)
                self.end.send(answer.data[4:], self._said_at)
            else:
                self.end.send(answer.data, self._said_at)


@pytest.mark.parametrize("seed", [0, 3, 4, 6, 7])
@pytest.mark.parametrize(("mean", "most", "cuts"), [(0.3, 0.4, False), (0.3, 0.4, True), (0.05, 0.02, True)])
@pytest.mark.parametrize("ids", [None, IDS])
def test_late_answers_are_those_of_one_device_each(
    seed: int, mean: float, most: float, cuts: bool, ids: list[int] | None
) -> None:
    found = scan(HeldRig(seed, mean, most, cuts).bus("auto"), ids)
    assert found.conflicts == ()
    assert [device.id for device in found.devices] == IDS


class NoisyRig(Rig):
    """A wire with a stray byte behind some of the writes of the host."""

    def __init__(self, seed: int, kit: Bioloid) -> None:
        self._dice = random.Random(seed)
        super().__init__(kit)

    def _receive(self, data: bytes, at: float) -> None:
        super()._receive(data, at)
        if self._dice.random() < 0.02:
            self.end.send(bytes([self._dice.randrange(256)]), at + 0.0003)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noise_alone_is_no_device(seed: int) -> None:
    found = scan(NoisyRig(seed, Bioloid(units=[Ax12(1), Ax12(2)], baud=BAUD)).bus(1), echo=False)
    assert [(device.id, device.model) for device in found.devices] == [(1, 12), (2, 12)]


def test_an_echo_of_protocol_2_is_not_told_for_noise() -> None:
    seconds = []
    for has_echo in (False, True):
        rig = Rig(Bioloid.x_series(3, baud=BAUD))
        if has_echo:
            rig.kit.faults.start("echo")
        begun = rig.clock.now()
        assert [device.id for device in scan(rig.bus(2)).devices] == [1, 2, 3]
        seconds.append(rig.clock.now() - begun)
    assert seconds[1] == pytest.approx(seconds[0], rel=0.2)


@pytest.mark.parametrize("seed", [0, 3, 4])
def test_two_devices_with_one_id_are_told_among_late_answers(seed: int) -> None:
    found = scan(HeldRig(seed, 0.3, 0.1, False, Ax12(6)).bus("auto"))
    assert found.conflicts == (6,)
    assert [device.id for device in found.devices] == [number for number in IDS if number != 6]
