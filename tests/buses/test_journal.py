"""The verb "record" of the control socket: all that happens in a worker, and no cost otherwise."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from urbihw.buses import messages as m
from urbihw.buses.control import REST_S
from urbihw.buses.control_client import MAX_QUEUED_LINES
from urbihw.buses.events import message_event
from urbihw.buses.servos.driver import ServoDriver

from .conftest import Rig
from .test_control import ControlBench, bench

__all__ = ["bench"]

Said = dict[str, Any]


def events(said: list[Said], *kinds: str) -> list[Said]:
    """The events of some kinds, without their times."""
    return [{key: each[key] for key in each if key != "at"} for each in said if each.get("event") in kinds]


def test_a_recorder_hears_what_was_asked_by_whom_and_what_became_of_it(bench: ControlBench) -> None:
    caller = bench.call()
    caller.say("record")
    bench.tell(m.Limits({(6, "goal_position"): m.Limit(400, 600, name="limits.motor6.position")}))
    bench.run(0.05)
    caller.hear()
    bench.tell(m.Writers({6: "Lobby_1 (127.0.0.1)"}), m.Targets({(6, "goal_position"): 900}))
    before = bench.rig.clock.now()
    bench.run(0.05)
    said = caller.hear()
    heard = events(said, "Writers", "Targets", "Applied", "Limited")
    assert [each["event"] for each in heard] == ["Writers", "Targets", "Limited", "Applied"]
    assert heard[0]["names"] == {"6": "Lobby_1 (127.0.0.1)"}
    assert heard[1]["values"] == [[6, "goal_position", 900]] and heard[3]["values"] == [[6, "goal_position", 600]]
    assert (heard[2]["requested"], heard[2]["applied"], heard[2]["limit"]) == (900, 600, "limits.motor6.position")
    assert all(before <= each["at"] <= bench.rig.clock.now() for each in said if each["event"] == "Targets")


def test_a_recorder_is_told_who_has_moved_what_before(bench: ControlBench) -> None:
    bench.tell(m.Writers({6: "Lobby_1 (127.0.0.1)"}))
    bench.run(0.05)
    caller = bench.call()
    caller.say("record")
    bench.run(0.05)
    (answer,) = [each for each in caller.hear() if each.get("do") == "record"]
    assert answer["writers"] == {"6": "Lobby_1 (127.0.0.1)"}


def test_a_recorder_hears_requests_replies_samples_bytes_and_stops(bench: ControlBench) -> None:
    caller = bench.call()
    caller.say("record")
    bench.run(0.02)
    bench.tell(m.Watch(6, ("present_position",)), m.Request(7, "read", 6, "torque_limit"))
    bench.run(0.05)
    bench.order("estop", "the red button")
    said = caller.hear()
    assert [each["verb"] for each in events(said, "Request")] == ["read"]
    (reply,) = events(said, "Reply")
    assert (reply["reply_id"], reply["ok"], reply["value"]) == (7, True, 1023)
    assert all("present_position" in each["values"]["6"] for each in events(said, "Samples"))
    assert len(events(said, "Samples")) >= 4 and events(said, "Traffic") and events(said, "Stopped")
    assert [each["reason"] for each in events(said, "Latched")] == ["the red button"]


def test_without_a_recorder_nothing_is_made_of_a_message(
    bench: ControlBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[object] = []

    def spy(message: object) -> Said:
        made.append(message)
        return message_event(message)

    monkeypatch.setattr("urbihw.buses.journal.message_event", spy)
    bench.tell(m.Watch(6, ("present_position",)))
    bench.move(600)
    assert not made
    caller = bench.call()
    caller.say("record")
    bench.move(500)
    assert made
    caller.close()
    bench.run(0.05)
    made.clear()
    bench.move(600)
    assert not made


def test_a_recorder_that_does_not_read_loses_the_oldest_and_is_told_how_many(bench: ControlBench) -> None:
    caller = bench.call()
    caller.say("record")
    bench.tell(*(m.Watch(number, ("present_position", "present_load")) for number in range(1, 19)))
    late: list[m.FromWorker] = []
    for _ in range(6):
        late += [each for each in bench.run(1.0) if isinstance(each, m.Statistics) and each.late]
    assert not late
    client = bench.engine._control._clients[0]  # type: ignore[union-attr]
    assert not client.closed and len(client._waiting) <= MAX_QUEUED_LINES + 1
    heard, lost = 0, 0
    for _ in range(200):
        bench.run(0.02)
        said = caller.hear()
        heard += len(said)
        lost += sum(each.get("dropped", 0) for each in said)
    assert lost > 500 and heard > 200


def test_options_that_may_be_passwords_are_not_told(bench: ControlBench) -> None:
    caller = bench.call()
    caller.say("record")
    bench.run(0.02)
    bench.tell(m.Configure(dead_man=2.5, options={"protocol": 1}))
    bench.run(0.02)
    assert not events(caller.hear(), "Configure")
    answer = bench.call()
    answer.say("record")
    bench.run(0.02)
    settings = answer.hear()[0]["settings"]
    assert settings == {"rate": 100.0, "dead_man": 2.5, "torque_off_on_stop": False, "resume": True}


def test_whatever_a_message_contains_the_worker_goes_on(bench: ControlBench) -> None:
    circle: list[object] = []
    circle.append(circle)
    odd = [{(1, "a"): b"xyz"}, circle, {frozenset((1,)): object()}, float("nan"), "\udc80", {b"key": {2: (3,)}}]
    caller = bench.call()
    caller.say("record")
    caller.say("subscribe")
    bench.run(2 * REST_S)
    caller.hear()
    bench.engine._reports.post([m.Reply(number, True, value) for number, value in enumerate(odd)])
    bench.engine._reports.post([m.DeviceReport(6, "odd", value) for value in odd])
    bench.engine._reports.post([m.Samples(1.0, {6: {"odd": value}}, {6: 1.0}) for value in odd])
    bench.run(0.05)
    said = caller.hear()
    assert len(events(said, "Reply")) == len(odd) and len(events(said, "DeviceReport")) == 2 * len(odd)
    assert events(said, "Reply")[0]["value"] == [[1, "a", "3 bytes"]]
    assert events(said, "Samples")[0]["values"] == {"6": {"odd": {"(1, 'a')": "3 bytes"}}}


def test_the_wire_of_a_robot_with_a_login_is_neither_kept_nor_recorded(rig: Rig, tmp_path: Path) -> None:
    class DriverWithLogin(ServoDriver):
        logs_in = True

    made = ControlBench(rig, tmp_path / "robot.sock")
    made.engine._driver.__class__ = DriverWithLogin
    made.run(0.5)
    caller = made.call()
    caller.say("record")
    made.tell(m.Watch(6, ("present_position",)))
    made.run(0.1)
    said = caller.hear()
    assert said[0]["wire"] is False and events(said, "Samples")
    assert not [each for each in events(said, "Traffic") if each["chunks"]] and not made.engine._traffic._opening
    tracer = made.call()
    tracer.say("trace")  # who asks for it still sees it
    made.run(0.1)
    assert events(tracer.hear(), "Traffic")
    made.end()
