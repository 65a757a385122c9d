"""What a device hands to the wire within one round, and what of it still goes out when the round is over."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from urbihw.buses import messages as m
from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import Motion, Origin
from urbihw.kernel.uobject.motion import no_stack
from urbihw.platforms.channel import DeviceChannel


class Bench:
    """A wire whose messages stay in ``sent``, and the motion of its robot."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.motion = Motion(self.kernel.host, "robot", lambda devices, reason: None)
        self.sent: list[m.ToWorker] = []
        self.channel = DeviceChannel(self.sent.append, self.motion)

    def targets(self) -> list[Any]:
        """The values of the targets that the round sends."""
        self.channel.flush()
        sent = [dict(message.values) for message in self.sent if isinstance(message, m.Targets)]
        self.sent.clear()
        return sent

    def origin_of(self, client: Lobby) -> Origin:
        """Where something comes from that this client writes now."""
        return Origin(self.motion.epoch, "client", "", no_stack, 0.0, client)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_a_stop_drops_the_targets_of_its_round_and_keeps_the_settings(bench: Bench) -> None:
    bench.channel.set_target(6, "goal_position", 900, bench.motion.own())
    bench.channel.set_target(6, "led", 1)
    bench.motion.advance("stopped")
    assert bench.targets() == [{(6, "led"): 1}]


def test_a_round_of_dead_targets_sends_nothing_at_all(bench: Bench) -> None:
    bench.channel.set_target(6, "goal_position", 900, bench.motion.own())
    bench.motion.advance("stopped")
    assert bench.targets() == []
    # Nor does the next round: they are gone, not put off.
    assert bench.targets() == []


def test_a_target_behind_the_stop_goes_out_with_the_new_epoch(bench: Bench) -> None:
    bench.channel.set_target(6, "goal_position", 900, bench.motion.own())
    bench.channel.set_target(7, "goal_position", 900, bench.motion.own())
    bench.motion.advance("stopped")
    bench.channel.set_target(7, "goal_position", 100, bench.motion.own())
    bench.channel.flush()
    (sent,) = [message for message in bench.sent if isinstance(message, m.Targets)]
    assert (dict(sent.values), sent.epoch) == ({(7, "goal_position"): 100}, bench.motion.epoch)


def test_the_worker_is_told_who_moves_a_device_when_that_changes_and_after_a_stop(bench: Bench) -> None:
    one, two = bench.kernel.open_lobby(), bench.kernel.open_lobby()

    def told(client: Lobby) -> list[m.ToWorker]:
        bench.sent.clear()
        bench.channel.set_target(6, "goal_position", 900, replace(bench.origin_of(client), client=str(id(client))))
        bench.channel.set_target(6, "led", 1)
        bench.channel.flush()
        return [message for message in bench.sent if isinstance(message, m.Writers)]

    assert told(one) == [m.Writers({6: str(id(one))})]
    assert told(one) == []
    assert told(two) == [m.Writers({6: str(id(two))})]
    bench.motion.advance("stopped")
    assert told(two) == [m.Writers({6: str(id(two))})]


def test_an_emergency_stop_drops_them_too(bench: Bench) -> None:
    bench.channel.set_target(6, "goal_position", 900, bench.motion.own())
    bench.motion.latched = "red button"
    assert bench.targets() == []


def test_the_end_of_a_connection_drops_what_it_asked_for_and_nothing_else(bench: Bench) -> None:
    gone, here = bench.kernel.open_lobby(), bench.kernel.open_lobby()
    bench.channel.set_target(6, "goal_position", 900, bench.origin_of(gone))
    bench.channel.set_target(7, "goal_position", 900, bench.origin_of(here))
    gone.close()
    assert bench.targets() == [{(7, "goal_position"): 900}]


def resumed(bench: Bench, pauses: list[float], *, same: bool = True) -> list[bool]:
    """Whether each of some targets counts as that of a movement that was held up, with these pauses before them."""
    clock = bench.kernel.scheduler.clock
    assert isinstance(clock, SimClock)
    origin = bench.motion.own()
    found = []
    for pause in pauses:
        clock.idle(clock.now() + pause)
        bench.kernel.scheduler.run()
        bench.channel.set_target(6, "goal_position", 500, origin if same else bench.motion.own())
        bench.channel.flush()
        (message,) = (one for one in bench.sent if isinstance(one, m.Targets))
        found.append(bool(message.resumed))
        bench.sent.clear()
    return found


def test_a_movement_that_was_held_up_says_so_once(bench: Bench) -> None:
    assert resumed(bench, [0.02, 0.02, 0.5, 0.02]) == [False, False, True, False]


def test_a_loop_that_writes_now_and_then_and_other_statements_are_not_held_up(bench: Bench) -> None:
    assert resumed(bench, [0.02, 1.0, 1.0, 1.2]) == [False] * 4
    assert resumed(bench, [0.02, 0.02, 0.5], same=False) == [False] * 3


def test_what_is_written_without_an_origin_is_told_to_be_a_setting(bench: Bench) -> None:
    bench.channel.set_target(6, "goal_position", 900, bench.motion.own())
    bench.channel.set_target(6, "led", 1)
    bench.channel.write(6, "led", 0, lambda reply: None)
    bench.channel.write(6, "goal_position", 100, lambda reply: None, bench.motion.own())
    bench.channel.flush()
    (targets,) = [message for message in bench.sent if isinstance(message, m.Targets)]
    assert targets.settings == {(6, "led")}
    assert [message.setting for message in bench.sent if isinstance(message, m.Request)] == [True, False]
