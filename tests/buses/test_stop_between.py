"""A stop is sent between two transactions, however many servos are asked, and long writes are split."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from urbihw.buses import messages as m
from urbihw.buses.servos import plan
from urbihw.buses.servos.tables import table_for
from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.device import Answer

from .conftest import Rig
from .test_worker import Bench


class Stopping(Bioloid):
    """A kit that calls `on_read` when servo 3 is asked, and notes when a sync write comes after that."""

    def __init__(self) -> None:
        super().__init__(baud=1_000_000)
        self.on_read: Callable[[], None] | None = None
        self.asked_at = self.stopped_at = 0.0

    def feed(self, data: bytes, now: float) -> list[Answer]:
        """Take bytes of the host."""
        if self.on_read is not None and data.startswith(b"\xff\xff\x03\x04\x02"):
            call, self.on_read = self.on_read, None
            self.asked_at = now
            call()
        if self.asked_at and not self.stopped_at and b"\xff\xff\xfe" in data:
            self.stopped_at = now
        return super().feed(data, now)


@pytest.mark.parametrize("silent", [(), (3,), (3, 4, 5, 7, 8)])
def test_a_stop_comes_between_two_transactions(
    make_rig: Callable[[Bioloid], Rig], silent: tuple[int, ...]
) -> None:
    kit = Stopping()
    rig = make_rig(kit)
    bench = Bench(rig, m.Configure(dead_man=0))
    bench.run(0.6)
    bench.tell(*(m.Watch(number, ("present_position", "present_speed")) for number in range(1, 19)))
    bench.run(0.3)
    bench.tell(m.Targets({(6, "goal_position"): 1000, (6, "moving_speed"): 100}))
    bench.run(0.3)
    for number in silent:
        kit.faults.start("silence", number)
    kit.on_read = lambda: bench.tell(m.Stop(epoch=1, reason="test"))
    bench.run(0.2)
    place = kit.servo(6).position
    # One transaction at the most: its wire time, and where the servo is silent, the learnt time-out and its repetition.
    assert 0 < kit.stopped_at - kit.asked_at < (0.010 if silent else 0.002)
    bench.run(1.0)
    kit.tick(rig.clock.now())
    assert kit.servo(6).position == pytest.approx(place, abs=2)
    assert 520 < place < 900
    bench.close()


def test_goals_of_more_servos_than_a_packet_holds_are_sent_in_several() -> None:
    runs = plan.write_runs(table_for(1060, 2), ("goal_position",))
    packets = plan.sync_writes(2, [(runs, [(number, {"goal_position": 0xFDFFFF}) for number in range(253)])])
    assert len(packets) == 2 and all(len(each) <= 1024 for each in packets)
