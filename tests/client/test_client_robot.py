"""The client library against a server, over real sockets: what a program reads, writes, runs, watches and hears."""

from __future__ import annotations

import asyncio
import math
import select
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from lan_server import Lan

import urbihw
from urbihw.client import aio
from urbihw.client.dialect import PlainDialect
from urbihw.client.errors import AccessDenied, CannotConnect, ConnectionLost, SlotMissing, TimedOut, UrbiError
from urbihw.client.media import Picture
from urbihw.client.objects import UrbiFunction, UrbiObject
from urbihw.client.robot import Robot
from urbihw.client.values import Written

pytestmark = pytest.mark.e2e

SETUP = """
class Global.Motor { var val = 0; var age = 0.5; function turn(by) { val += by; "turned" }; var moved = Event.new; };
var Global.motor6 = Motor.new;
var Global.run = "a slot";
var Global.photo = Binary.new("rgb 2 1", "abcdef");
"""


@pytest.fixture
def lan(tmp_path: Path) -> Iterator[Lan]:
    made = Lan(tmp_path)
    yield made
    made.close()


@pytest.fixture
def robot(lan: Lan) -> Iterator[Robot]:
    with urbihw.connect("127.0.0.1", lan.plain_port, timeout=20) as made:
        made.run(SETUP)
        yield made


@pytest.mark.parametrize("value", [
    0.5, -1e-300, 0.1 + 0.2, math.inf, True, False, None, "", 'a "quoted" \\ word\n\té \x00', [], {},
    [1.0, ["b", None]], {"k": [1.0], 'q"': {}},
])  # fmt: skip
def test_values_come_back_as_they_were_written(robot: Robot, value: object) -> None:
    robot.motor6.val = value
    assert robot.motor6.val == value
    assert robot["motor6.val"] == value


def test_nan_and_bytes(robot: Robot) -> None:
    robot.motor6.val = math.nan
    assert math.isnan(robot.motor6.val)
    robot.motor6.val = b"a\xff\n"
    assert robot.run("motor6.val.size") == 3


def test_a_group_has_a_length_and_members(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    robot.run("var Global.motor7 = Motor.new; var Global.motors = [motor6, motor7]; var Global.pair = Group.new;"
              "pair.add(motor6);")
    assert len(robot.pair) == 1
    assert [type(member) for member in robot.pair] == [UrbiObject]
    assert robot.pair
    group, asked = robot.pair, list[object]()
    ask = group._connection.ask

    def count(*arguments: object, **options: object) -> object:
        asked.append(arguments)
        return ask(*arguments, **options)

    monkeypatch.setattr(group._connection, "ask", count)
    for use in (list, len, tuple, iter):
        asked.clear()
        use(group)
        assert len(asked) == 1, use
    for _ in group:
        assert len(group) == 1 and len(asked) == 3, "a length within a loop is that of the moment"
    with pytest.raises(TypeError, match="cannot be iterated"):
        list(robot.motor6)
    with pytest.raises(TypeError, match="no length"):
        len(robot.motor6)
    assert bool(robot.motor6)


def test_a_slot_tells_its_unit_range_and_meaning(robot: Robot) -> None:
    robot.run('motor6.val->unit = "rad"; motor6.val->rangemin = -1; motor6.val->rangemax = 2.5;')
    slot = robot.motor6.slot("val")
    assert (slot.unit, slot.min, slot.max) == ("rad", -1.0, 2.5)
    plain = robot.motor6.slot("age")
    assert (plain.unit, plain.min, plain.max) == ("", -math.inf, math.inf)
    assert plain.get_property("blend") is None
    assert robot.slot("System.time").meaning.startswith("Seconds")
    assert robot.System.time.__doc__ == "Seconds since the start of the server."


def test_a_misspelt_slot_has_a_hint(robot: Robot) -> None:
    with pytest.raises(SlotMissing, match=r"motr6 \(possible misspelling of motor6\)") as caught:
        _ = robot.motr6
    assert caught.value.name == "motr6"
    assert caught.value.obj is robot
    with pytest.raises(SlotMissing, match="possible misspelling of moved"):
        _ = robot.motor6.movde


def test_completion_shows_what_is_the_users(robot: Robot) -> None:
    robot.run("var mine = 1; function Global.help6() {}")
    methods = {name for name in vars(type(robot)) if not name.startswith("_")} - {"urbiscript_path"}
    assert set(dir(robot)) - methods - {"slot", "messages"} == {"motor6", "photo", "mine", "help6"}


def test_pictures_of_a_slot_without_pictures_fail_at_once(robot: Robot) -> None:
    with robot.pictures("camera.val") as pictures, pytest.raises(SlotMissing, match="camera"):
        next(pictures)
    with robot.pictures("motor6.val") as pictures, pytest.raises(UrbiError, match="no Binary"):
        next(pictures)
    with robot.pictures("photo", timeout=2) as pictures:
        next(pictures)
        robot.photo = 3
        with pytest.raises(TimedOut, match="sent nothing for 2 s; photo: this slot has no Binary"):
            next(pictures)
    with pytest.raises(ValueError, match="^hz: pictures in a second, more than 0$"):
        robot.pictures("motor6.val", hz=0)


def test_asyncio_has_members_properties_and_hints_too(lan: Lan) -> None:
    async def use() -> None:
        async with await aio.connect("127.0.0.1", lan.plain_port, timeout=20) as robot:
            await robot.run(SETUP + 'motor6.val->unit = "rad"; var Global.pair = Group.new; pair.add(motor6);')
            assert [type(member) async for member in robot.pair] == [aio.AsyncSlot]
            assert await robot.motor6.val.get_property("unit") == "rad"
            assert (await robot.slot("System.time").get_meaning()).startswith("Seconds")
            with pytest.raises(SlotMissing, match="misspelling of motor6"):
                await robot.motr6
            with pytest.raises(TypeError):
                _ = [member async for member in robot.motor6]
            with pytest.raises(SlotMissing):
                await anext(robot.pictures("camera.val"))

    asyncio.run(use())


def test_objects_have_slots_and_functions_are_only_called_by_a_call(robot: Robot) -> None:
    motor = robot.motor6
    assert isinstance(motor, UrbiObject)
    assert isinstance(motor.turn, UrbiFunction)
    assert motor.val == 0
    assert motor.turn(2) == "turned"
    assert motor.val == 2
    assert not hasattr(robot, "motor99")
    assert robot.run("[motor6]")[0] == UrbiObject(motor._connection, motor._printed)
    robot.run("motor6.addProto(Interface.Battery); var motor6.load = 3|;")
    assert {"turn", "load"} <= set(dir(motor))
    assert "Laser" not in dir(motor)


def test_slots_named_like_methods(robot: Robot) -> None:
    assert robot["run"] == robot.slot("run").get() == "a slot"
    robot["run"] = "another"
    assert robot.slot("run").get() == "another"
    with pytest.raises(AttributeError, match="no slot"):
        robot.run = "x"  # type: ignore[method-assign, assignment]


def test_a_path_carries_no_statement(robot: Robot) -> None:
    for path in ("motor6.val; shutdown", 'x")', "", "a..b"):
        with pytest.raises(ValueError, match="no path"):
            robot.slot(path)
    with pytest.raises(ValueError, match="no name"):
        robot.run("1", tag="a: b")


def test_a_keyword_is_no_tag_and_a_quoted_name(robot: Robot) -> None:
    for tag in ("if", "loop", "nil"):
        with pytest.raises(ValueError, match="is a word of urbiscript"):
            robot.run("1", tag=tag, timeout=20)
    robot.run("var motor6.'if' = 4; function motor6.'loop'(x) { x + 1 }|;")
    assert robot.motor6["if"] == 4
    assert robot.motor6["loop"](1) == 2
    robot.motor6.slot("if").set(5, timeout=20)
    with robot.watch("motor6.if", hz=50, timeout=20) as samples:
        assert next(samples).values == (5.0,)


def test_what_is_no_text_is_told_so(robot: Robot) -> None:
    for value in (5, None, b"1"):
        with pytest.raises(TypeError, match=r"^a program is a str of urbiscript, not a Python \w+$"):
            robot.run(value)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="^the path of a slot is a str such as 'motor6.val', not a Python list$"):
        robot.watch(["motor6.val"])  # type: ignore[arg-type]
    for rate in (-1, math.nan, math.inf):
        with pytest.raises(ValueError, match="is no rate"):
            robot.watch("motor6.val", hz=rate)
        with pytest.raises(ValueError, match="is no rate"):
            robot.pictures("photo", hz=rate)


def test_constants_are_not_written(robot: Robot) -> None:
    with pytest.raises(ValueError, match="^nil is a constant of urbiscript$"):
        robot.nil = 3


def test_the_location_of_an_error_is_in_the_text_or_there_is_none(robot: Robot) -> None:
    with pytest.raises(UrbiError, match="^unexpected .*, expected a Tag$") as caught:
        robot.run("1", tag="motor6")
    assert caught.value.location == ""
    with pytest.raises(SlotMissing) as missing:
        robot.run("1;\n nowhere", tag="fine")
    assert missing.value.location == "2.2-8"


@pytest.mark.long
def test_the_timeout_holds_for_a_server_that_reads_nothing() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=greet_only, args=(server,))
        thread.start()
        with urbihw.connect("127.0.0.1", server.getsockname()[1], timeout=20, reconnect=False) as robot:
            began = time.monotonic()
            with pytest.raises((TimedOut, ConnectionLost), match="does not read what it is sent"):
                robot.run(f'"{"x" * 20_000_000}"', timeout=0.2)
            assert time.monotonic() - began < 9
        thread.join(20)


def greet_only(server: socket.socket) -> None:
    """Answer the two first questions, read nothing more, and stay until the client has gone."""
    made, _ = server.accept()
    with made:
        for number, answer in ((1, "[1.0, true, true]"), (1, '["", 1.0]')):
            made.recv(4096)
            made.sendall(f"[00001000:_client{number}] {answer}\n".encode())
        hung_up = select.poll()
        hung_up.register(made, select.POLLHUP | select.POLLRDHUP)
        hung_up.poll(20000)


def test_errors_have_text_and_location(robot: Robot) -> None:
    with pytest.raises(SlotMissing) as caught:
        robot.run("1;\n  nowhere")
    with pytest.raises(SlotMissing) as inner:
        robot.run("function f() { nowhere }; f")
    assert [call.rpartition(": ")[2] for call in inner.value.calls] == ["f"]
    error = caught.value
    assert (error.location, error.text, error.kind) == ("2.3-9", "lookup failed: nowhere", "Lookup")
    with pytest.raises(UrbiError, match="syntax error"):
        robot.run("1 +")
    with pytest.raises(UrbiError, match="syntax error"):
        robot.run("1 +,")
    with pytest.raises(UrbiError, match="^oops$"):
        robot.run('throw "oops"')
    with pytest.raises(SlotMissing, match="^lookup failed: nowhere"):
        robot.nowhere = 1


def test_a_program_runs_under_a_tag_until_it_is_stopped(robot: Robot) -> None:
    assert robot.run("var x = 1; x + 1") == 2
    robot.run("loop { motor6.val++; sleep(1ms) },", tag="swing")
    before = robot.motor6.val
    while robot.motor6.val == before:
        pass
    robot.stop("swing")
    stood = robot.motor6.val
    robot.run("sleep(20ms)")
    assert robot.motor6.val == stood
    with pytest.raises(SlotMissing):
        robot.stop("nothing")


def test_a_stopped_program_ends_its_run(robot: Robot) -> None:
    done: list[object] = []
    thread = threading.Thread(target=lambda: done.append(robot.run("sleep(inf)", tag="nap")))
    thread.start()
    while not robot.run("hasSlot(\"nap\")"):
        pass
    robot.stop("nap")
    thread.join(20)
    assert done == [None]


def test_no_answer_in_time_leaves_the_connection_usable(robot: Robot) -> None:
    with pytest.raises(TimedOut):
        robot.run("sleep(0.2); 1", timeout=0.05)
    assert [robot.run("2"), robot.run("sleep(0.3); 3")] == [2, 3]


@pytest.mark.parametrize("text", [
    "loop { motor6.val++; sleep(1ms) }", "{ loop { motor6.val++; sleep(1ms) } , sleep(1h) }",
])  # fmt: skip
def test_a_call_that_is_given_up_ends_on_the_server_unless_it_is_kept(lan: Lan, robot: Robot, text: str) -> None:
    async def cancelled() -> None:
        async with await aio.connect("127.0.0.1", lan.plain_port) as other:
            task = asyncio.create_task(other.run(text))
            while not robot.motor6.val:
                await asyncio.sleep(0.001)
            task.cancel()
            await asyncio.wait([task])
            assert await other.run("1") == 1
            assert_stands(robot, stands=True)

    asyncio.run(cancelled())
    with pytest.raises(TimedOut):
        robot.run(text, timeout=0.05)
    assert_stands(robot, stands=True)
    with pytest.raises(TimedOut):
        robot.run(text, tag="kept", timeout=0.05, keep=True)
    assert_stands(robot, stands=False)


def assert_stands(robot: Robot, stands: bool) -> None:
    """Whether motor6 is changed no more."""
    seen = robot.motor6.val
    robot.run("sleep(20ms)")
    assert (robot.motor6.val == seen) is stands


def test_stop_and_estop_without_a_tag_are_those_of_the_robot(lan: Lan, robot: Robot) -> None:
    robot.run("class Global.Base { var stops = 0; var estop = false; function stop() { stops++ } };"
              "var Global.robot = Base.new|;")  # fmt: skip
    robot.stop()
    robot.estop()

    async def asked() -> None:
        async with await aio.connect("127.0.0.1", lan.plain_port) as other:
            await other.stop()
            await other.estop()

    asyncio.run(asked())
    assert robot.run("[robot.stops, robot.estop]") == [2, True]


def test_samples_come_with_local_time_units_and_errors(robot: Robot) -> None:
    with robot.watch("motor6.val", "motor6.nothing", hz=100) as samples:
        robot.motor6.val = 7
        t, values = next(sample for sample in samples if sample.values[0] == 7)
        assert values == (7.0, None)
        assert abs(t - time.time()) < 1
        assert "lookup failed: nothing" in samples.errors["motor6.nothing"]
    assert list(samples) == []
    assert robot.run("lobby.subscriptions.size") == 0


def test_a_slow_program_gets_the_newest_and_hears_how_many_it_missed(robot: Robot) -> None:
    with robot.watch("motor6.val", hz=200) as samples:
        samples._stream.size = 5
        robot.run("sleep(0.3)")
        next(samples)
        assert samples.lost > 20


def test_events_come_with_what_they_carry(robot: Robot) -> None:
    with robot.events("motor6.moved", timeout=20) as moved:
        robot.run('motor6.moved!(1, ["a"])')
        assert next(moved).args == (1.0, ["a"])
    with pytest.raises(SlotMissing):
        robot.events("motor6.nothing")
    with pytest.raises(UrbiError, match="^motor6.val is no event$"):
        robot.events("motor6.val")


def test_pictures_are_arrays_where_numpy_is(robot: Robot) -> None:
    numpy = pytest.importorskip("numpy")
    assert numpy.asarray(robot.photo).tolist() == [[[97, 98, 99], [100, 101, 102]]]
    with robot.pictures("photo", hz=50, timeout=20) as photos:
        t, photo = next(photos)
        assert isinstance(photo, Picture)
        assert (photo.data, photo.width) == (b"abcdef", 2)
        robot.run('photo = Binary.new("rgb 1 1", "xyz")|;')
        assert next(photos).value.data == b"xyz"


def test_what_is_said_by_itself_is_kept(robot: Robot) -> None:
    robot.run('echo("hello")')
    robot.run("nowhere2,")
    robot.run("sleep(10ms)")
    assert [message.text for message in robot.messages if not message.is_error] == ["*** hello"]
    assert any("nowhere2" in message.text for message in robot.messages if message.is_error)


def test_several_threads_share_a_connection(robot: Robot) -> None:
    wrong: list[object] = []

    def work(number: int) -> None:
        for count in range(50):
            if robot.run(f"{number} * 1000 + {count}") != number * 1000 + count:
                wrong.append((number, count))

    with robot.watch("motor6.val", hz=200) as samples:
        threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
        for thread in threads:
            thread.start()
        for _ in range(10):
            next(samples)
        for thread in threads:
            thread.join(60)
    assert wrong == []


def test_a_closed_iterator_ends_in_another_thread(robot: Robot) -> None:
    events = robot.events("motor6.moved")
    got: list[object] = []
    thread = threading.Thread(target=lambda: got.append(list(events)))
    thread.start()
    robot.run("sleep(20ms)")
    events.close()
    thread.join(20)
    assert got == [[]]


def cut(lan: Lan) -> None:
    """The server closes all connections."""
    def close_all() -> None:
        for lobby in list(lan.kernel.programs.lobbies):
            if lobby.connected:
                lobby.quit()

    lan.call(close_all)


def test_a_lost_connection_is_made_again_with_what_was_watched(lan: Lan, robot: Robot) -> None:
    samples = robot.watch("motor6.val", hz=100, timeout=20)
    next(samples)
    cut(lan)
    for _ in range(200):  # those that had come before, then those of the new connection
        next(samples)
        if robot._connection.core.connects == 2:
            break
    assert robot._connection.core.connects == 2
    next(samples)
    assert robot.motor6.age == 0.5


def test_an_event_that_a_new_connection_has_not_is_told_at_once(lan: Lan, robot: Robot) -> None:
    robot.run("var done = Event.new|;")  # of the lobby, so it goes with the connection
    events = robot.events("done", timeout=20)
    cut(lan)
    began = time.monotonic()
    with pytest.raises(SlotMissing, match="done"):
        next(events)
    assert time.monotonic() - began < 10


def test_a_command_is_never_carried_out_twice(lan: Lan, robot: Robot) -> None:
    with pytest.raises(ConnectionLost):
        robot.run("motor6.val += 1; lobby.quit; sleep(1)")
    assert robot.motor6.val == 1


def test_reasons_why_there_is_no_connection(lan: Lan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    with pytest.raises(CannotConnect, match="cannot connect to 127.0.0.1:1"):
        urbihw.connect("127.0.0.1:1")
    with pytest.raises(CannotConnect, match="^no server listens at .*none.socket; start the server: urbihw serve$"):
        urbihw.connect(str(tmp_path / "none.socket"))
    with pytest.raises(AccessDenied, match=r"not known yet;.*: trust=True trusts it"):
        urbihw.connect("127.0.0.1", lan.port, tls=True)
    with pytest.raises(AccessDenied, match="give token_file=FILE, URBIHW_TOKEN"):
        urbihw.connect("127.0.0.1", lan.port, tls=True, trust=True)
    with pytest.raises(AccessDenied, match=r"does not speak TLS; .*: tls=False$"):
        urbihw.connect("127.0.0.1", lan.plain_port, tls=True)
    with pytest.raises(AccessDenied, match="refused"):
        urbihw.connect("127.0.0.1", lan.port, tls=True, trust=True, token="wrong")
    with urbihw.connect("127.0.0.1", lan.port, tls=True, token=lan.tokens.add("anna"), timeout=20) as robot:
        assert robot.run("1 + 1") == 2
        assert len(robot.run('"x" * 300000')) == 300000
    with pytest.raises(ConnectionLost, match="closed"):
        robot.run("1")


def test_a_server_without_our_extensions(robot: Robot) -> None:
    """The other dialect, on our server: all of it is urbiscript 2."""
    robot._connection.core.session.dialect = PlainDialect()
    robot.motor6.val = 3
    assert robot.motor6.val == 3
    assert robot.motor6.turn(1) == "turned"
    assert robot.run("var y = 1; y + 1") == 2
    assert not hasattr(robot, "motor99")
    with robot.watch("motor6.val", "motor6.nothing", hz=50, timeout=20) as samples:
        assert next(samples).values == (4.0, None)
    with robot.events("motor6.moved", timeout=20) as moved:
        robot.run("motor6.moved!(1)")
        assert next(moved).args == ()


def test_objects_show_themselves_in_a_notebook(robot: Robot) -> None:
    assert "127.0.0.1" in robot._repr_html_()
    robot.run("class Global.Device : UObject { function init() {} }; var Global.arm = Device.new|;")
    assert "<code>arm</code>" in robot._repr_html_()
    assert "<code>UObject</code>" not in robot._repr_html_()
    assert "motor6" in robot.motor6._repr_html_()


def test_completion_of_a_robot_offers_devices_and_variables(robot: Robot) -> None:
    robot.run("var mine = 1; function Global.helper() { 1 }|;")
    found = set(dir(robot))
    assert {"motor6", "photo", "mine", "helper", "run", "watch", "messages"} <= found
    assert not {"String", "acceptVoid", "answerValue", "nil"} & found


# ---------------------------------------------------------------- asyncio


def test_asyncio(lan: Lan, robot: Robot) -> None:
    async def program() -> None:
        async with await aio.connect("127.0.0.1", lan.plain_port, timeout=20) as other:
            assert repr(other) == f"<AsyncRobot at 127.0.0.1:{lan.plain_port}>"
            assert {"run", "slot", "watch"} <= set(dir(other))
            for here in (other, other.motor6):
                with pytest.raises(AttributeError, match=r"await robot\..*val\.set\(value\) writes the slot"):
                    here.val = 0.9  # type: ignore[assignment]
            with pytest.raises(ValueError, match="is a word of urbiscript"):
                await other.run("1", tag="if")
            with pytest.raises(ValueError, match="which slots"):
                other.watch()
            with pytest.raises(ValueError, match="more than 0"):
                other.pictures("photo", hz=0)
            assert other.connected
            await other.motor6.val.set(0.25)
            assert await other.motor6.val == 0.25
            assert await other.motor6.turn(1) == "turned"
            with pytest.raises(SlotMissing):
                await other.nothing
            assert await other.run("1 + 1") == 2
            assert [*await asyncio.gather(other.run("sleep(10ms); 1"), other.run("2"))] == [1, 2]
            async with other.watch("motor6.val", "nothing", hz=100, timeout=20) as samples:
                async for _, values in samples:
                    assert values == (1.25, None)
                    break
                assert (samples.slots, samples.units) == (("motor6.val", "nothing"), ("", ""))
                assert "lookup failed: nothing" in samples.errors["nothing"]
            async with other.events("motor6.moved", timeout=20) as moved:
                await other.run("motor6.moved!(5)")
                assert (await anext(moved)).args == (5.0,)
            with pytest.raises(ConnectionLost):
                await other.run("lobby.quit; sleep(1)")
            assert await other.motor6.val == 1.25
        with pytest.raises(CannotConnect):
            await aio.connect("127.0.0.1", 1)

    asyncio.run(program())


# ---------------------------------------------------------------- weight


def test_the_library_loads_no_kernel_and_no_asyncio() -> None:
    program = ("import sys, urbihw; urbihw.connect; "
               "print([m for m in sys.modules if m.startswith(('urbihw.kernel', 'asyncio', 'ssl', 'lark', 'numpy'))])")
    out = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert out.stdout.strip() == "[]"


def test_nothing_is_left_behind(robot: Robot) -> None:
    before = threading.active_count()
    with robot.watch("motor6.val", hz=100) as samples:
        next(samples)
    assert threading.active_count() == before


def test_a_connection_keeps_its_lease_by_itself(lan: Lan) -> None:
    with urbihw.connect("127.0.0.1", lan.plain_port, timeout=20, lease=0.4) as robot:
        assert robot.run("lobby.lease") == 0.4
        robot.run("var Global.leaser = lobby|")
        with urbihw.connect("127.0.0.1", lan.plain_port, timeout=20) as other:
            heard = other.run("Global.leaser.bytesReceived")
            until = time.monotonic() + 60
            while other.run("Global.leaser.bytesReceived") == heard and time.monotonic() < until:
                time.sleep(0.01)
            assert other.run("Global.leaser.bytesReceived") > heard


def test_a_connection_of_asyncio_keeps_its_lease_too(lan: Lan) -> None:
    async def play() -> None:
        async with await aio.connect("127.0.0.1", lan.plain_port, timeout=20, lease=0.4) as robot:
            assert await robot.run("lobby.lease") == 0.4
            await robot.run("var Global.leaser = lobby|")
            async with await aio.connect("127.0.0.1", lan.plain_port, timeout=20) as other:
                heard = await other.run("Global.leaser.bytesReceived")
                while await other.run("Global.leaser.bytesReceived") == heard:
                    await asyncio.sleep(0.01)

    asyncio.run(asyncio.wait_for(play(), 60))


ARM = """
class Global.Joint { var val = 0; var applied = 0; var limitedBy = ""; };
var Global.j1 = Joint.new; var Global.j2 = Joint.new; j2.limitedBy = "a limit"; j2.applied = 0.7;
"""


def leaser(lan: Lan) -> Any:
    """The lobby of the server for the program that has said so in ``leaser``."""
    return lan.kernel.world.global_.slots["leaser"]


def heard_of(lan: Lan) -> Callable[[], int]:
    """The number of bytes that the server has received from this program."""
    return lambda: int(leaser(lan).received)


def wait_until(done: Callable[[], bool]) -> None:
    until = time.monotonic() + 60
    while not done():
        assert time.monotonic() < until
        time.sleep(0.01)


def test_a_block_has_a_lease_that_the_library_keeps(robot: Robot, lan: Lan) -> None:
    before = threading.active_count()
    with robot.lease(seconds=0.4):
        assert robot["lease"] == 0.4
        with robot.lease(5):
            assert robot["lease"] == 5
        assert robot["lease"] == 0.4
        robot.run("var Global.leaser = lobby|")
        received = heard_of(lan)
        heard = received()
        wait_until(lambda: received() >= heard + 2)
        released = leaser(lan).released_at
    assert robot["lease"] == 0
    assert leaser(lan).released_at > released, "what the block has moved goes on"
    wait_until(lambda: threading.active_count() == before)
    with pytest.raises(UrbiError, match="a lease lasts for"), robot.lease(seconds=0.01):
        pass
    assert robot["lease"] == 0


@pytest.mark.parametrize("seconds", [0, -1.0, float("nan")])
def test_a_lease_without_a_time_is_refused(seconds: float, robot: Robot, lan: Lan) -> None:
    # Signs of life without a pause would flood the server.
    with pytest.raises(ValueError, match="a lease lasts for"):
        robot.lease(seconds=seconds)

    async def use() -> None:
        async with await aio.connect("127.0.0.1", lan.plain_port, timeout=20) as other:
            with pytest.raises(ValueError, match="a lease lasts for"):
                other.lease(seconds=seconds)

    asyncio.run(use())


def test_a_lease_that_the_program_feeds_gets_no_sign_of_life_from_the_library(lan: Lan) -> None:
    with urbihw.connect("127.0.0.1", lan.plain_port, timeout=20, lease=0.4) as robot:
        with robot.lease(3, fed=False) as lease:
            robot.run("var Global.leaser = lobby|")
            received = heard_of(lan)
            heard = received()
            time.sleep(1.0)
            assert received() == heard
            lease.feed()
            wait_until(lambda: received() == heard + 1)
        assert robot["lease"] == 0.4


def test_a_lease_of_asyncio_too(lan: Lan) -> None:
    async def use() -> None:
        async with await aio.connect("127.0.0.1", lan.plain_port, timeout=20) as robot:
            with pytest.raises(ZeroDivisionError):
                async with robot.lease(seconds=0.4):
                    assert await robot["lease"] == 0.4
                    await robot.run("var Global.leaser = lobby|")
                    released = leaser(lan).released_at
                    raise ZeroDivisionError
            assert await robot["lease"] == 0
            assert leaser(lan).released_at > released
            with pytest.raises(UrbiError, match="a lease lasts for"):
                async with robot.lease(seconds=9999):
                    pass

    asyncio.run(use())


def test_leases_that_overlap_on_one_connection_of_asyncio(lan: Lan) -> None:
    async def use() -> None:
        async with await aio.connect("127.0.0.1", lan.plain_port, timeout=20) as robot:
            async def block(seconds: float, pause: float) -> None:
                async with robot.lease(seconds=seconds):
                    await asyncio.sleep(pause)

            async def begins_in_vain() -> None:
                with pytest.raises(UrbiError, match="a lease lasts for"):
                    await block(9999, 0)

            await asyncio.gather(block(0.5, 0.05), begins_in_vain(), block(1, 0))
            assert await robot["lease"] == 0
            async with robot.lease(seconds=3):
                ended = asyncio.ensure_future(block(5, 1))
                await asyncio.sleep(0)
                ended.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await ended
                assert await robot["lease"] == 3, "of the lease that did not begin nothing stays"
            assert await robot["lease"] == 0

    asyncio.run(use())


def test_several_slots_are_written_at_once_and_tell_what_is_applied(robot: Robot) -> None:
    robot.run(ARM)
    assert robot.write({"j1.val": 0.5, "j2.val": 2}) == {
        "j1.val": Written(0, ""), "j2.val": Written(0.7, "a limit"),
    }  # fmt: skip
    assert (robot.j1.val, robot.j2.val) == (0.5, 2)
    assert robot.write({"motor6.val": 3}) == {"motor6.val": Written(None, "")}
    with pytest.raises(SlotMissing, match="nobody"):
        robot.write({"j1.val": 9, "nobody.val": 1})
    assert robot.j1.val == 0.5
    for wrong in ({}, {"j1.val; shutdown": 1}, {"nil": 1}):
        with pytest.raises(ValueError):
            robot.write(wrong)


def test_asyncio_writes_several_slots_too(lan: Lan) -> None:
    async def use() -> None:
        async with await aio.connect("127.0.0.1", lan.plain_port, timeout=20) as robot:
            await robot.run(ARM)
            told = await robot.write({"j1.val": 0.5, "j2.val": 2})
            assert told == {"j1.val": Written(0, ""), "j2.val": Written(0.7, "a limit")}

    asyncio.run(use())


def test_other_servers_take_several_slots_too(robot: Robot) -> None:
    robot._connection.core.session.dialect = PlainDialect()
    assert robot.write({"motor6.val": 4, "motor6.age": 2}) == dict.fromkeys(
        ("motor6.val", "motor6.age"), Written(None, "")
    )
    assert (robot.motor6.val, robot.motor6.age) == (4, 2)


def test_joints_and_the_overview_are_those_of_the_robot(robot: Robot) -> None:
    robot.run("""
        var Global.robot = Component.new("robot"); robot.addComponent("arm");
        class Global.Elbow { var val = 0.25; }; Elbow.addProto(Interface.RotationalMotor);
        class Global.Eye { var val = 3; }; Eye.addProto(Interface.DistanceSensor);
        robot.arm.addDevice("elbow", Elbow.new); robot.arm.addDevice("eye", Eye.new); robot.makeCompactNames;
    """)
    assert robot.joints == ["elbow"]
    assert robot[f"{robot.joints[0]}.val"] == 0.25
    told = robot.overview()
    assert told["effectors"] == [{"slot": "elbow.val", "role": "joint", "unit": "rad"}]
    assert told["sensors"] == [{"slot": "eye.val", "role": "distance", "unit": "m"}]


def test_a_trajectory_has_ended_when_the_device_has_followed(robot: Robot) -> None:
    robot.run("""
        class Global.Late
        {
          var now = 0;
          get val() { now };
          set val(wanted) { detach({ sleep(80ms) | now = wanted }) | wanted };
          get drift() { System.time };
          set drift(wanted) { wanted };
        };
        var Global.late = Late.new;
    """)
    robot.slot("late.val").set(1, time=0.2)
    assert robot.late.now == 1
    begun = time.monotonic()
    robot.slot("late.drift").set(0, time=0.1)
    assert 0.5 < time.monotonic() - begun < 10


def test_a_slot_of_a_group_is_a_list(robot: Robot) -> None:
    robot.run(ARM + "var Global.both = Group.new; both.add(j2); both.add(j1); j2.val = 3;")
    assert robot.both.val == [3, 0]
    robot.run("var j1.load = 1; var j2.load = 0.5;")
    assert robot.both.load == [0.5, 1], "a function of the group has this name, too"
    assert isinstance(robot.both.add, UrbiFunction)
    with pytest.raises(SlotMissing, match="vel"):
        _ = robot.both.vel
