"""Bridges and those who ask, in one process: who is there, values, stops, rights."""

from __future__ import annotations

import asyncio
import json
import threading
import time
from collections.abc import Awaitable, Callable
from functools import partial
from typing import Any, ClassVar

import pytest
from fleet_lab import FleetLab, PlayedRobot, ask, fleet_lab, until

from urbihw.fleets import bridge
from urbihw.fleets.bridge import NameTaken
from urbihw.fleets.line import FleetError, FleetLine, FleetTimedOut
from urbihw.fleets.names import ALL, FleetKeys, FleetOrder
from urbihw.fleets.program import FleetProgram


def played(scene: Callable[[FleetLab], Awaitable[None]]) -> None:
    """Play a scene."""
    async def play() -> None:
        async with fleet_lab() as lab:
            await scene(lab)

    asyncio.run(play())


def test_those_who_are_there_tell_what_they_are() -> None:
    async def scene(lab: FleetLab) -> None:
        await lab.join("bob")
        await lab.join("alice", drive=("teacher",))
        line = await lab.line()
        assert await ask(line.robots) == ["alice", "bob"]
        info = await ask(line.info, "alice")
        assert info["platform"] == "toy" and info["drive"] == ["teacher"]
        assert info["slots"]["wheel.speed"] == {"unit": "rad/s", "min": -1.0, "max": 1.0, "effector": True}
        state = await ask(line.state, "bob")
        assert (state["verdict"], state["drivers"]) == ("ok", [])
        await lab.leave("bob")
        await until(lambda: line.robots() == ["alice"])

    played(scene)


def test_values_have_time_age_and_who_moved_the_device() -> None:
    async def scene(lab: FleetLab) -> None:
        await lab.join("alice")
        line = await lab.line()
        told = await ask(line.value, "alice", "wheel.speed")
        assert told["value"] == 0.0 and told["who"] == "anna"
        assert abs(told["t"] - time.time()) < 5 and 0 <= told["age"] < 5
        name, sample = await ask(next, line.watch(ALL, 5.0))
        assert name == "alice" and sample["v"] == {"wheel.speed": 0.0, "sonar.val": 0.5}
        with pytest.raises(FleetError, match="^alice: there is no value 'motor9.val'$"):
            await ask(line.value, "alice", "motor9.val")
        with pytest.raises(FleetTimedOut, match="^carol is not in the fleet school$"):
            await ask(line.read, "carol", "wheel.speed", 0.3)

    played(scene)


def test_one_stop_reaches_the_workers_of_all_and_names_those_that_do_not_confirm() -> None:
    async def scene(lab: FleetLab) -> None:
        for name in ("alice", "bob", "carol"):
            await lab.join(name)
        lab.robots["carol"].played.dead = True
        line = await lab.line("anna")
        told = await ask(line.stop)
        assert set(told.confirmed) == {"alice", "bob"}
        assert told.failed == {"carol": "there is no bus worker"}
        assert lab.robots["alice"].played.asked == [("estop", "anna (fleet)")] == lab.robots["bob"].played.asked
        # It is held: only the one who has pressed releases it.
        other = await ask((await lab.line("ben")).stop, "release")
        assert other.confirmed == {} and "not that of ben" in other.failed["alice"]
        assert set((await ask(line.stop, "release")).confirmed) == {"alice", "bob"}
        # One alone.
        assert set((await ask(line.stop, "estop", "bob")).confirmed) == {"bob"}

    played(scene)


def test_a_robot_that_is_there_and_silent_is_named() -> None:
    async def scene(lab: FleetLab) -> None:
        await lab.join("alice")
        joined = await lab.join("bob")
        silent = asyncio.Event()
        joined._desk.answer = lambda order, payload: silent.wait()  # type: ignore[method-assign,assignment,return-value]
        told = await ask((await lab.line()).stop)
        assert set(told.confirmed) == {"alice"}
        assert told.failed == {"bob": "has not confirmed it within 1.5 s"}

    played(scene)


def test_a_name_taken_twice_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bridge, "TAKEN_PATIENCE_S", 0.3)

    async def scene(lab: FleetLab) -> None:
        await lab.join("alice")
        with pytest.raises(NameTaken) as raised:
            await lab.join("alice")
        assert str(raised.value) == (
            f"a robot of the fleet school at {lab.endpoint} is called alice already: give this one another name"
        )
        assert await ask((await lab.line()).robots) == ["alice"]

    played(scene)


def test_another_robot_is_the_router_when_the_first_one_goes() -> None:
    async def scene(lab: FleetLab) -> None:
        for name in ("alice", "bob", "carol"):
            await lab.join(name)
        line = await lab.line()
        await lab.leave("alice")
        await until(lambda: line.robots() == ["bob", "carol"])
        assert set((await ask(line.stop)).confirmed) == {"bob", "carol"}

    played(scene)


def test_nobody_moves_a_robot_whose_settings_do_not_name_him() -> None:
    async def scene(lab: FleetLab) -> None:
        await lab.join("alice", drive=("teacher",))
        thief = await lab.line("thief")
        for work in (
            lambda: thief.write("alice", {"wheel.speed": 1.0}), lambda: thief.call("alice", "robot.go", 1.0)
        ):  # fmt: skip
            with pytest.raises(FleetError, match="^alice: thief may not drive: fleet_drive"):
                await ask(work)
        assert lab.robots["alice"].connections == []
        # To stop is everybody's right, and nothing goes before it.
        thief.info = thief.hello = None  # type: ignore[method-assign,assignment]
        await ask(thief.call, "alice", "robot.stop")
        assert lab.robots["alice"].played.asked == [("stop", "thief (fleet)")]

    played(scene)


def test_who_drives_has_a_lease_that_ends_with_him() -> None:
    async def scene(lab: FleetLab) -> None:
        await lab.join("alice", drive=("teacher",), dead_man=1.5)
        line, robot = await lab.line(), lab.robots["alice"]
        assert await ask(line.write, "alice", {"wheel.speed": 5.0}) == {"wheel.speed": 1.0}
        await ask(line.call, "alice", "robot.go", 0.5)
        (connection,) = robot.connections
        assert connection.did[0] == 'lobby.introduce("teacher (fleet)")|' and connection.term.seconds == 1.5
        assert robot.did == [{"wheel.speed": 5.0}, ("robot.go", (0.5,))]
        assert (await ask(line.state, "alice"))["drivers"] == ["teacher"]
        fed = connection.term.fed
        await until(lambda: connection.term.fed > fed + 3)
        line.close()
        await until(lambda: not connection.connected)

    played(scene)


def test_what_was_long_on_its_way_moves_nothing_and_is_no_sign_of_life() -> None:
    async def scene(lab: FleetLab) -> None:
        await lab.join("alice", drive=("teacher",))
        line, robot = await lab.line(), lab.robots["alice"]
        await ask(line.hello, "alice")
        driven = line._driven["alice"]
        driven.took = 0.0
        driven.ahead -= 50.0
        with pytest.raises(FleetError, match=r"^alice: the order was 5\d\.\d s on its way"):
            await ask(line.write, "alice", {"wheel.speed": 1.0})
        assert robot.connections == []
        driven.ahead += 50.0
        await ask(line.write, "alice", {"wheel.speed": 1.0})
        driven.ahead -= 50.0
        await asyncio.sleep(0.5)
        fed = robot.connections[0].term.fed
        await asyncio.sleep(1.0)
        assert robot.connections[0].term.fed == fed

    played(scene)


def dials_again(robot: PlayedRobot, before: int) -> bool:
    return robot.dialling > before


def test_an_order_that_still_connects_ends_with_its_job_its_client_and_its_age() -> None:
    async def scene(lab: FleetLab) -> None:
        joined = await lab.join("alice", drive=("teacher",))
        line, robot = await lab.line(), lab.robots["alice"]
        for end in ("job", "client", "age"):
            robot.dials.clear()
            before, driven = robot.dialling, len(robot.connections)
            call = {"function": "robot.go", "args": [1.0], "number": "7", "session": end, "timeout": 2.0}
            call["made"] = time.monotonic()
            asked = asyncio.create_task(asyncio.to_thread(line._order, "alice", "call", call, 1.0))
            await until(partial(dials_again, robot, before))
            if end == "job":
                await ask(line._order, "alice", "cancel", {"number": "7", "session": end}, 1.0)
            elif end == "client":
                joined._lose_client(f"school/teacher/client/{end}")
            else:
                joined._drivers._clock = lambda: time.monotonic() + 3.0
            robot.dials.set()
            with pytest.raises(FleetError):
                await asked
            assert robot.did == []
            assert (len(robot.connections) > driven) is (end == "age")

    played(scene)


def test_an_end_that_overtakes_its_order_ends_it() -> None:
    async def scene(lab: FleetLab) -> None:
        joined = await lab.join("alice", drive=("teacher",))
        line, robot = await lab.line(), lab.robots["alice"]
        made = time.monotonic()
        call = {"function": "robot.go", "args": [1.0], "number": "7", "session": "a1", "made": made, "timeout": 1.0}
        await ask(line._order, "alice", "cancel", {"number": "7", "session": "a1"}, 1.0)
        joined._lose_client("school/teacher/client/b2")
        for late in (call, call | {"session": "b2"}):
            with pytest.raises(FleetError, match="has ended it"):
                await ask(line._order, "alice", "call", late, 1.0)
        assert robot.did == robot.connections == []
        # Of a client that is back.
        await ask(line._order, "alice", "call", call | {"session": "b2", "made": time.monotonic()}, 1.0)
        assert robot.did == [("robot.go", (1.0,))]

    played(scene)


def test_the_clock_of_a_robot_is_asked_again() -> None:
    async def scene(lab: FleetLab) -> None:
        for name in ("alice", "bob"):
            await lab.join(name, drive=("teacher",))
        line, robot = await lab.line(), lab.robots["alice"]
        await ask(line.hello, "alice")
        driven = line._driven["alice"]
        driven.took = 0.0
        # Its machine was started again.
        driven.ahead -= 50.0
        with pytest.raises(FleetError, match="on its way"):
            await ask(line.write, "alice", {"wheel.speed": 1.0})
        await ask(line.write, "alice", {"wheel.speed": 1.0})
        # The clocks have run apart.
        driven.ahead, driven.until = driven.ahead - 50.0, 0.0
        fed = robot.connections[0].term.fed
        await until(lambda: robot.connections[0].term.fed > fed + 1)
        # A robot that tells nothing of itself holds no other.
        line.close()
        line, told, info = await lab.line(), threading.Event(), FleetLine.info
        line.info = lambda name: (name == "bob" or told.wait(9.0)) and info(line, name)  # type: ignore
        slow = asyncio.create_task(asyncio.to_thread(line.write, "alice", {"wheel.speed": 1.0}))
        await until(lambda: "alice" in line._driven)
        await ask(line.write, "bob", {"wheel.speed": 1.0})
        assert not slow.done()
        told.set()
        await slow

    played(scene)


class PlayedQuery:
    """An order that waits for an answer: `told` has those of all."""

    told: ClassVar[list[str]] = []

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def reply(self, key: str, told: str, express: bool) -> None:
        self.told.append(told)


def test_a_flood_of_stops_has_a_bound_and_keeps_no_other_kind() -> None:
    async def scene(lab: FleetLab) -> None:
        joined = await lab.join("alice")
        joined._desk.answer = lambda order, payload: asyncio.sleep(9.0)  # type: ignore
        query: Any = PlayedQuery()
        for verb, most in (("hello", bridge.MOST_PENDING), ("stop", bridge.MOST_STOPS), ("estop", bridge.MOST_STOPS)):
            before = len(joined._pending)
            for _ in range(most + 10):
                joined._begin(FleetOrder("anna", verb), b"", query)
            assert len(joined._pending) == before + most
        assert query.told == 30 * [bridge.BUSY]

    played(scene)


WRONG: list[tuple[str, Any]] = [
    ("write", {}), ("write", {"slots": {}}), ("write", {"slots": {"wheel.unit": 1.0}}),
    ("write", {"slots": {"wheel.speed": True}}), ("write", {"slots": {"wheel.speed": "1"}}),
    ("write", {"slots": {"wheel.speed": float("nan")}}), ("write", {"slots": {"wheel.speed": float("inf")}}),
    ("write", {"slots": {"wheel.speed = 1; robot.go": 1.0}}), ("write", {"slots": {"System.x": 1.0}}),
    ("write", {"slots": {f"wheel.speed{n}": 1.0 for n in range(101)}}), ("write", {"slots": ["wheel.speed"]}),
    ("write", {"slots": {"wheel.speed": 1.0}, "made": None}), ("write", {"slots": {"wheel.speed": 1.0}, "made": True}),
    ("write", {"slots": {"wheel.speed": 1.0}, "made": float("nan")}),
    ("write", {"slots": {"wheel.speed": 1.0}, "made": 1e300}),
    ("write", {"slots": {"wheel.speed": 1.0}, "session": ""}),
    ("write", {"slots": {"wheel.speed": 1.0}, "session": "a" * 99}),
    ("write", {"slots": {"wheel.speed": 1.0}, "session": "a/*"}),
    ("write", {"slots": {"wheel.speed": 1.0}, "timeout": -1}),
    ("write", {"slots": {"wheel.speed": 1.0}, "timeout": 1e9}),
    ("call", {}), ("call", {"function": "System.shutdown"}), ("call", {"function": "robot.go(1); robot.go"}),
    ("call", {"function": "robot.addPose"}), ("call", {"function": "robot.go", "args": "1"}),
    ("call", {"function": "robot.go", "args": list(range(9))}), ("call", {"function": ["robot.go"]}),
    ("read", {"slot": "System.shutdown"}), ("run", {"text": "robot.go(1)"}), ("estop/x", {}),
    ("write", {"slots": {"wheel.speed": 1.0}, "made": 10**400}), ("write", {"slots": {"wheel.speed": 10**400}}),
    ("call", {"function": "robot.go", "args": [10**400]}), ("call", {"function": "robot.go", "args": ["\ud800"]}),
    ("call", {"function": "robot.go", "args": [json.loads("[" * 30 + "]" * 30)]}),
    ("cancel", {}), ("cancel", {"number": [1]}),
]  # fmt: skip


def test_wrong_orders_of_one_who_may_drive_move_nothing() -> None:
    async def scene(lab: FleetLab) -> None:
        await lab.join("alice", drive=("teacher",))
        line, robot = await lab.line(), lab.robots["alice"]
        for verb, request in WRONG:
            right = {"made": time.monotonic(), "session": "a1", "timeout": 0.2}
            with pytest.raises(FleetError) as raised:
                await ask(line._asked, "alice", line.keys.order("alice", verb), {**right, **request}, 0.2)
            assert "our bug" not in str(raised.value)
        for payload in (b"", b"[", b"\xff", b"[" * 60000, b"9" * 70000, b"null", b'{"slots": {"wheel.speed": 1}}'):
            for reply in await ask(lambda payload=payload: list(
                line._session.get(line.keys.order("alice", "write"), payload=payload, timeout=1.0)
            )):
                assert reply.ok is not None and json.loads(bytes(reply.ok.payload))["ok"] is False
            line._session.put(line.keys.order("alice", "beat"), payload)
        assert robot.did == []
        # It serves those who are right.
        assert await ask(line.write, "alice", {"wheel.speed": 0.5}) == {"wheel.speed": 0.5}

    played(scene)


def test_a_program_uses_the_words_of_urbiscript() -> None:
    async def scene(lab: FleetLab) -> None:
        await lab.join("alice", drive=("teacher",))
        await lab.join("bob")
        school = FleetProgram(await lab.line())

        def program() -> None:
            assert school.robots == ["alice", "bob"]
            alice = school["alice"]
            assert alice.sonar.val == 0.5 and repr(alice.sonar) == "<FleetPart alice.sonar>"
            alice.wheel.speed = 0.25
            with pytest.raises(AttributeError, match="^alice has no hat$"):
                _ = alice.hat
            with pytest.raises(AttributeError, match="^alice has no effector sonar.val$"):
                alice.sonar.val = 1.0
            assert school.each(lambda robot: robot.sonar.val) == {"alice": 0.5, "bob": 0.5}
            school.each(lambda robot: robot.robot.stop())
            with pytest.raises(ExceptionGroup) as raised:
                school.each(lambda robot: setattr(robot.wheel, "speed", 1.0))
            (refused,) = raised.value.exceptions
            assert str(refused).startswith("bob: teacher may not drive")
            assert next(school.watch("bob"))[0] == "bob"
            # One that tells nothing of itself keeps no other.
            lab.robots["alice"].info = None  # type: ignore[method-assign,assignment]
            with pytest.raises(ExceptionGroup) as raised:
                school.each(lambda robot: robot.robot.stop())
            assert [str(each)[:6] for each in raised.value.exceptions] == ["alice:"]

        await ask(program)
        assert lab.robots["alice"].did == [{"wheel.speed": 0.25}, {"wheel.speed": 1.0}]
        assert lab.robots["bob"].played.asked == 2 * [("stop", "teacher (fleet)")]

    played(scene)


def test_a_question_with_wildcards_is_answered_by_none() -> None:
    keys = FleetKeys("school", "alice")
    for key in ("school/alice/**", "school/alice/*/val", "school/alice/from/*/estop", "school/alice", "school/alice/"):
        assert keys.order_in(key) is None, key
