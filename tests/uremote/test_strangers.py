"""Remotes among strangers: no remote takes over what belongs to another connection or to the server."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.facade import HostProcess
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject, event, function, owned, reading, variable
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uremote.connection import MAX_CALLS, MAX_DECLARED, RemoteConnection
from urbihw.kernel.uremote.external import MAX_NAME_LENGTH

DECLARED = (
    "class K{}|external object K|external function (1) K.f from K|"
    "if (!isdef(K.v)) var K.v|external var K.v from K|"
    'if (!isdef(K.w)) var K.w|external var K.w from K|K.getSlot("w").own|'
    "try{var K.e = Event.new()} catch(var e) {}|external event (1) K.e from K|"
    'K.getSlot("v").update_timed(5, 1000000)|external function (0) K.init from K|;'
)
"""What the remote that owns K says."""


class Motor(UObject):
    """A device of the server."""

    val = owned(0.0)
    pos = reading(7.0)
    mode = variable("free")
    lost = event()

    def init(self) -> None:
        self.seen: list[Any] = []
        self.notify_change(self.val, lambda: self.seen.append(self.val.value))
        self.notify_change(self.mode, self.choose)

    def choose(self, mode: str) -> None:
        if mode == "black":
            raise ValueError("there is no such mode")

    @function
    def stop(self) -> str:
        return "stopped"


class Company:
    """A server with a motor, a remote that owns K, a thief, and an innocent user."""

    def __init__(self) -> None:
        self.shutdowns = 0
        self.kernel = Kernel(SimClock(), process=HostProcess(shutdown=self._count_shutdown))
        self.motor = self.kernel.host.create(Motor, "motor6")
        self.remote = self.kernel.open_lobby("10.0.0.1")
        self.thief = self.kernel.open_lobby("10.0.0.2")
        self.user = self.kernel.open_lobby("10.0.0.3")
        assert self.say(self.remote, DECLARED) == []

    def say(self, lobby: Any, text: str | bytes, seconds: float = 0.01) -> list[str]:
        """The output of a lobby within some time after its client sent this, without the time stamps."""
        lobby.feed(text if isinstance(text, bytes) else text.encode())
        self.kernel.scheduler.run_simulated(self.kernel.clock.now() + seconds)
        return self.heard(lobby)

    @staticmethod
    def heard(lobby: Any) -> list[str]:
        """What it was told."""
        return [line.partition("] ")[2] for line in lobby.output.take_bytes().decode("latin-1").splitlines()]

    def connection(self, lobby: Any) -> RemoteConnection:
        """The remote behind a lobby."""
        found = registry_of(self.kernel.world).connections[lobby]
        assert isinstance(found, RemoteConnection)
        return found

    def unharmed(self) -> None:
        """K and the motor are whose they were, and do what they did."""
        self.heard(self.remote)
        assert self.say(self.user, "K.f(1);") == []
        (call,) = self.heard(self.remote)
        assert call.startswith('[0, "K.f__1", "_') and call.endswith(", 1]")
        assert self.say(self.remote, f'Global.UObject.funCall("{call.split(chr(34))[3]}", 42),') == []
        assert self.heard(self.user) == ["42"]
        said = self.say(self.user, "K.w = 2|; K.v; K.v = 6|; K.v; K.v = 5|; K.e!(1)|; K.f(1, 2);")
        assert said[:2] == ["5", "6"] and said[2].endswith("f: expected 1 argument, given 2")
        told = [line.rpartition(", ")[0] for line in self.heard(self.remote)]
        assert told == ['[1, "K.w", 2', '[1, "K.v", 6', '[1, "K.v", 5', '[2, "K.e__1"', '[3, "K.e__1"']
        self.motor.seen.clear()
        said = self.say(self.user, "motor6.val = 0.5; motor6.stop; motor6.pos; motor6.mode; motor6.__uobjectName;")
        assert said == ["0.5", '"stopped"', "7", '"free"', f'"{self.motor.unique_name}"']
        assert self.motor.seen == [0.5]
        assert self.say(self.user, "motor6.pos = 1;")[0].endswith("pos: this slot can only be read")
        assert self.say(self.user, 'uobjects.hasSlot("Motor"); motor6.protos == [Motor];') == ["true", "true"]
        before = self.shutdowns
        self.say(self.user, "System.shutdown;")
        assert self.shutdowns == before + 1

    def _count_shutdown(self) -> None:
        self.shutdowns += 1


@pytest.fixture
def company() -> Company:
    return Company()


ATTACKS = [
    # names
    ("class K{}|external object K;", "object: K belongs to Lobby_1 (10.0.0.1), nothing is declared"),
    ("class motor6{}|external object motor6;", "object: motor6 belongs to this server, nothing is declared"),
    ("class Motor{}|external object Motor;", "object: Motor belongs to this server, nothing is declared"),
    ("class System{}|external object System;", "object: System belongs to this server, nothing is declared"),
    ("class getStats{}|external object getStats;", "object: getStats belongs to this server, nothing is declared"),
    ("class asString{}|external object asString;", "object: asString belongs to this server, nothing is declared"),
    ("var lobby.z = 3|external object z;", "object: z was not made by class"),
    ("var lobby.z = motor6|external object z;", "object: z was not made by class"),
    ("var lobby.z = K|external object z|external var z.v from z;", ""),
    ("var lobby.z = System|external object z|external event (0) z.e from z;", ""),
    # functions
    ("external function (1) K.f from K;", "function: slot redefinition: f"),
    ("external function (0) K.g from K;", "function: K.g belongs to Lobby_1 (10.0.0.1), not to this connection"),
    ("external function (0) motor6.go from motor6;", "function: motor6.go belongs to this server, not to this "),
    ("external function (0) System.go from System;", "function: System.go belongs to this server, not to this "),
    ('UObject.arity("K.f", 0, 9);', "arity: K.f belongs to Lobby_1 (10.0.0.1), not to this connection"),
    ('UObject.arity("K.f", nan, inf);', "arity: expected integer, got nan"),
    ("external function (1e999) K.g from K;", "function: takes 0 to 64 arguments, not inf"),
    ("external function (0) K." + "g" * 300 + " from K;", "function: a name has at most 255 characters, not 302"),
    ('UObject.funCall("_1", 3);', "funCall: missing key: _1"),
    # variables
    ('K.getSlot("v").own;', "own: K.v belongs to Lobby_1 (10.0.0.1), not to this connection"),
    ('K.getSlot("v").protect;', "protect: K.v belongs to Lobby_1 (10.0.0.1), not to this connection"),
    ('motor6.getSlot("mode").own;', "own: object_1.mode belongs to this server, not to this connection"),
    ('motor6.getSlot("val").protect;', "protect: object_1.val belongs to this server, not to this connection"),
    ('motor6.getSlot("pos").update_timed(1, 1);', "pos: this slot can only be read"),
    ('motor6.getSlot("mode").update_timed("black", 1);', "mode: there is no such mode"),
    ('K.getSlot("w").update_timed(9, 1);', ""),
    ('UObject.unnotify("K", "v", 9);', ""),
    ('UObject.unnotify("K", "v", inf);', "unnotify: expected integer, got inf"),
    ('motor6.getSlot("val").unnotify| motor6.getSlot("pos").unnotify;', ""),
    ('K.getSlot("v").copy(motor6, "val");', "slot redefinition: val"),
    ('K.getSlot("v").copy(motor6, "stop");', "copy: stop is a function, not a variable"),
    ("external var motor6.stop from motor6;", "var: stop is a function, not a variable"),
    ("external var System.shutdown from System;", "var: System.shutdown belongs to the library and is no variable of"),
    ("external var System.asString from System;", "var: System.asString belongs to the library and is no variable of"),
    ('UVar.new(motor6, "stop");', "new: stop is a function, not a variable"),
    ("UVar.own;", "own: unexpected UVar, expected an UVar"),
    # events
    ("external event (0) System.shutdown from System;", "event: System.shutdown is no event"),
    ("external event (0) K.f from K;", "event: K.f is no event"),
    ("external event (0) motor6.stop from motor6;", "event: motor6.stop belongs to this server"),
    # ends
    ("motor6.destroy;", "destroy: object_1 belongs to this server, which needs it"),
    ("Motor.destroy;", "destroy: Motor belongs to this server, which needs it"),
    ('UObject.rejoin("");', "rejoin: a token has at least 16 characters"),
    ('UObject.rejoin("0123456789abcdef");', ""),
    ('K.lobby.binaryMode(1, "x"),', "binaryMode: only a connection itself may change its mode"),
]


@pytest.mark.parametrize(("attack", "answer"), ATTACKS)
def test_nothing_of_others_is_to_be_had(company: Company, attack: str, answer: str) -> None:
    said = company.say(company.thief, attack)
    errors = [line for line in said if line.startswith("!!!")]
    assert any(answer in line for line in errors) if answer else not errors, said
    assert "internal error" not in "".join(said)
    company.unharmed()
    company.thief.close()
    company.unharmed()


def test_what_everybody_may_do_is_not_touched(company: Company) -> None:
    thief = company.thief
    watched = "external var K.v from K|external var motor6.pos from motor6|external event (1) K.e from K;"
    assert company.say(thief, watched) == []
    company.motor.pos.sense(8.0)
    said = company.say(thief, 'K.v = 7|; K.e!(3)|; motor6.getSlot("val").update_timed(0.3, 1)|; motor6.stop;')
    assert [line.rpartition(", ")[0] for line in said] == [
        '[1, "motor6.pos", 8', '[1, "K.v", 7', '[2, "K.e__1"', '[3, "K.e__1"', ""
    ]
    assert company.motor.seen == [0.3]
    assert company.say(thief, 'K.getSlot("w").update_timed(4, 1)|;') == []
    assert '[1, "K.w", 4' in company.heard(company.remote)[-1]
    assert company.say(thief, 'UObject.unnotify("K", "v", 1)| UObject.unnotify("motor6", "pos", 1)| K.v = 5|;') == []
    assert company.say(thief, "var f = Motor.new| f.destroy;") == []
    assert company.say(thief, 'UObject.syncGet("K.v", "t");') == ["5"]


def test_functions_set_by_notify_are_forgotten_by_who_set_them(company: Company) -> None:
    notify = 'motor6.getSlot("val").notifyChange(closure () { echo("told") })|;'
    assert company.say(company.user, notify) == [] == company.say(company.thief, notify)
    assert company.say(company.thief, 'motor6.getSlot("val").unnotify; motor6.val = 1|;') == []
    company.motor.val.sense(1.0)
    assert company.say(company.user, "1;") == ["*** told", "1"]
    assert company.heard(company.thief) == []


def test_a_name_stays_with_its_connection_when_the_object_is_destroyed(company: Company) -> None:
    """Everybody may destroy what a remote has: so says the protocol.  Its name is not to be had by that."""
    said = company.say(company.thief, "K.destroy|class K{}|external object K;")
    assert said == ["!!! object: K belongs to Lobby_1 (10.0.0.1), nothing is declared"]
    assert company.heard(company.remote) == ['[5, "K"]']
    assert company.say(company.remote, DECLARED) == []
    company.unharmed()


def test_a_name_that_somebody_removed_is_not_free(company: Company) -> None:
    said = company.say(company.thief, 'uobjects.removeSlot("K")|class K{}|external object K;')
    assert said[0] == "!!! object: K belongs to Lobby_1 (10.0.0.1), nothing is declared"


def test_a_name_is_free_when_its_connection_is_gone(company: Company) -> None:
    company.say(company.user, "var Global.k = K;")
    company.remote.close()
    assert company.say(company.thief, "class K{}|external object K|external function (1) K.f from K;") == []
    assert company.say(company.user, "K.f(1);") == []
    assert company.heard(company.thief)[0].startswith('[0, "K.f__1"')


def test_what_somebody_still_holds_comes_back_by_its_token_only(company: Company) -> None:
    token = 'UObject.rejoin("0123456789abcdef")|;'
    company.say(company.remote, token)
    company.say(company.user, "var Global.k = K;")
    company.remote.close()
    mine = "class K{}|external object K|external function (1) K.f from K;"
    assert company.say(company.thief, mine) == []
    assert company.say(company.user, "k === K;")[-1:] == ["false"]
    company.thief.close()
    company.remote = company.kernel.open_lobby("10.0.0.1")
    assert company.say(company.remote, token + mine) == []
    assert company.say(company.user, "k === K;") == ["true"]


def test_a_connection_that_is_held_is_replaced_by_its_token_only(company: Company) -> None:
    company.say(company.remote, 'UObject.rejoin("0123456789abcdef")|;')
    company.say(company.thief, 'UObject.rejoin("0123456789abcdeF")|;')
    assert company.remote.connected
    again = company.kernel.open_lobby("10.0.0.1")
    company.say(again, 'UObject.rejoin("0123456789abcdef")|;')
    assert not company.remote.connected
    company.remote = again
    assert company.say(again, DECLARED) == []
    company.unharmed()


def test_an_instance_on_its_way_is_not_to_be_had(company: Company) -> None:
    company.say(company.user, "var Global.k = K.new|;")
    made = '[4, "object_2", "K"]'
    assert company.heard(company.remote) == [made]
    declared = "class object_2{}|external object object_2|external function (0) object_2.init from object_2;"
    said = company.say(company.thief, declared)
    assert said[0] == "!!! object: object_2 belongs to Lobby_1 (10.0.0.1), nothing is declared"
    assert company.say(company.remote, declared)[0].startswith('[0, "object_2.init__0"')


def test_numbers_that_are_taken_are_not_given_out_again(company: Company) -> None:
    for number in ("99999999999", "100000000000"):
        name = f"object_{number}"
        assert company.say(company.thief, f"class {name}{{}}|external object {name}|;") == []
    assert company.say(company.user, "Motor.new.__uobjectName;") == ['"object_100000000001"']


def test_what_runs_after_the_end_of_a_connection_declares_nothing(company: Company) -> None:
    company.say(company.thief, "try { sleep(10h) } finally { class Z{}|external object Z },")
    company.thief.close()
    company.kernel.scheduler.run_simulated(company.kernel.clock.now() + 1)
    assert list(registry_of(company.kernel.world).connections) == [company.remote]
    assert company.say(company.user, "class Z{}|external object Z;") == []


def test_a_lobby_without_a_client_has_no_names(company: Company) -> None:
    said = company.say(company.thief, 'Lobby.create.receive("class Z{}|external object Z;");')
    assert said[-1].endswith("object: only a connection may have objects in another process")
    assert company.say(company.user, "class Z{}|external object Z;") == []


def test_whoever_spoils_the_event_of_ends_keeps_nobody_waiting(company: Company) -> None:
    company.say(company.thief, "Lobby.onDisconnect = 3|;")
    company.user.feed(b"K.f(1);")
    company.kernel.scheduler.run_simulated(company.kernel.clock.now() + 0.1)
    company.remote.close()
    assert company.say(company.user, 'uobjects.hasSlot("K");') == ["!!! 1.1-6: f: Remote disconnected", "false"]


# ---------------------------------------------------------------- what a remote may leave undone


def test_calls_that_are_never_answered_are_bounded_stoppable_and_end_with_the_connection(company: Company) -> None:
    calls = f"var Global.t = Tag.new|; for (var i : {MAX_CALLS}) detach({{ t: K.f(1) }})|;"
    company.say(company.user, calls, 1)
    connection = company.connection(company.remote)
    assert len(connection._pending) == MAX_CALLS
    wanted = f"f: {MAX_CALLS} calls wait for an answer of Lobby_1 (10.0.0.1) already"
    assert company.say(company.user, "K.f(1);")[0].endswith(wanted)
    company.say(company.user, "t.stop;")
    assert connection._pending == {}
    assert company.say(company.user, "timeout (1s) K.f(1)| 7;", 2) == ["7"]
    company.user.feed(b"K.f(1);")
    company.kernel.scheduler.run_simulated(company.kernel.clock.now() + 3600)
    company.remote.close()
    said = company.say(company.user, "8;")
    assert said[0].endswith(": f: Remote disconnected") and said[1:] == ["8"]


def test_instances_that_are_never_made_are_bounded_and_those_made_too_late_are_ended(company: Company) -> None:
    company.say(company.user, "timeout (1s) K.new| 7;", 2)
    (asked,) = company.heard(company.remote)
    name = asked.split('"')[1]
    declared = f"class {name}{{}}|external object {name}|external function (0) {name}.init from {name}|;"
    assert company.say(company.remote, declared) == [f'[5, "{name}"]']
    assert company.say(company.user, f'uobjects.hasSlot("{name}");')[-1] == "false"
    company.say(company.user, f"for (var i : {MAX_CALLS}) detach({{ K.new }})|;", 1)
    wanted = f"{MAX_CALLS} instances wait to be made by Lobby_1 (10.0.0.1) already"
    assert company.say(company.user, "K.new;")[0].endswith(wanted)
    company.remote.close()
    assert company.say(company.user, "8;")[-1] == "8"
    assert registry_of(company.kernel.world).connections == {}


def test_what_a_remote_declares_is_bounded(company: Company, monkeypatch: pytest.MonkeyPatch) -> None:
    assert MAX_DECLARED >= 10_000 and MAX_NAME_LENGTH < 1000
    monkeypatch.setattr("urbihw.kernel.uremote.connection.MAX_DECLARED", 3)
    for number in range(3):
        company.say(company.thief, f"class X{number}{{}}|external object X{number}|;")
        company.say(company.thief, f"external event (0) X0.e{number} from X0|external var X0.v{number} from X0|;")
    for words, answer in (
        ("class X3{}|external object X3;", "object: this connection has 3 objects already"),
        ("external event (0) X0.e3 from X0;", "event: this connection hears of 3 events already"),
        ("external var X0.v3 from X0;", "var: this connection watches 3 variables already"),
    ):
        assert company.say(company.thief, words)[0].endswith(answer)
    company.unharmed()


def test_a_remote_that_does_not_read_is_given_up_and_nobody_waits_for_it(company: Company) -> None:
    output = company.remote.output
    output.give_up = lambda unread: company.remote.close()
    company.say(company.user, 'var Global.box = UObject.new|; UVar.new(box, "v")|; box.v = 0;')
    company.say(company.remote, "external var box.v from K|external event (1) K.e from K|;")
    company.user.feed(f"for| (var i : 20000) box.v = \"{'x' * 1000}\"; 7;".encode())
    company.kernel.scheduler.run_simulated(company.kernel.clock.now() + 0.01)
    assert company.heard(company.user) == ["7"]
    assert not company.remote.connected and output.sent <= output.limit
    assert company.say(company.user, 'uobjects.hasSlot("K");') == ["false"]


def test_a_message_is_never_cut_by_another_when_its_writer_waits(company: Company) -> None:
    """A job of the remote itself waits when too much is unread, with a whole message to say."""
    output = company.remote.output
    output.give_up = lambda unread: company.remote.close()
    image = 'K.v = Binary.new("k", "y" * 3000000)|'
    company.remote.feed(f"{image};{image}; echo(\"a\"), echo(\"b\"),".encode())
    heard = b""
    for _ in range(20):
        company.kernel.scheduler.run_simulated(company.kernel.clock.now() + 0.01)
        heard += output.take_bytes()
        output.update_unread()
    whole = b'[1, "K.v", BIN 3000000 k\n' + b"y" * 3000000 + b", "
    assert heard.count(whole) == 2 and heard.count(b"*** ") == 2


# ---------------------------------------------------------------- binary mode


SIZES = b"\x02\x04\x08\x08"


@pytest.fixture
def binary(company: Company) -> Iterator[Company]:
    """The thief speaks in frames."""
    assert company.say(company.thief, b'binaryMode(1, "t");') == ["true"]
    company.thief.feed(SIZES)
    yield company


@pytest.mark.parametrize(("frame", "answer"), [
    (b"\x01\x00\x0amotor6.pos\x02" + bytes(16), "pos: this slot can only be read"),
    (b"\x01\x00\x0bmotor6.stop\x02" + bytes(16), "motor6.stop: lookup"),
    (b"\x01\x00\x0fSystem.shutdown\x02" + bytes(16), "System.shutdown is no variable of a device"),
    (b"\x0a\x00\x02_1\x07", "missing key: _1"),
    (b"\x02\x00\x0fSystem.shutdown" + bytes(4), "expected an Event"),
])
def test_frames_have_no_other_rights(binary: Company, frame: bytes, answer: str) -> None:
    said = binary.say(binary.thief, frame)
    assert answer.replace("motor6.stop: lookup", "lookup failed: stop") in said[0]
    binary.unharmed()


def test_whoever_stops_a_remote_in_binary_mode_ends_one_frame_and_no_more(binary: Company) -> None:
    remote = binary.thief
    binary.say(remote, b"\x0b\x00\x0bsleep(10h);")
    others = "Lobby.instances.each(closure (l) { if (l !== Lobby && l !== lobby) l"
    binary.say(binary.user, others + ".connectionTag.stop });")
    assert remote.connected
    assert binary.say(remote, b"\x0b\x00\x021;") == ["1"]
    binary.say(remote, b"\x0b\x00\x0bsleep(10h);")
    binary.say(binary.user, others + ".interrupt });")
    assert binary.say(remote, b"\x0b\x00\x022;")[-1] == "2"
    remote.close()
    binary.kernel.scheduler.run_simulated(binary.kernel.clock.now() + 1)
    assert remote not in registry_of(binary.kernel.world).connections


def test_many_frames_give_way_to_others(binary: Company) -> None:
    """Frames that wait are handled in turns with what others do, as the statements of a client are."""
    binary.say(binary.user, "var Global.n = 0|;")
    frame = b"Global.n += 1|;"
    binary.thief.feed((b"\x0b\x00" + bytes([len(frame)]) + frame) * 1000)
    seen = [float(line) for line in binary.say(binary.user, "n;" * 5)]
    assert seen[0] < seen[-1] < 100
    assert binary.say(binary.user, "n;") == ["1000"]


def test_a_large_value_is_made_in_turns_with_others(binary: Company) -> None:
    strings = b"".join(b"\x05\x00\x01x" for _ in range(30_000))
    text = b"class X{}|external object X|external var X.v from X|;"
    binary.say(binary.thief, b"\x0b\x00" + bytes([len(text)]) + text)
    binary.thief.feed(b"\x01\x00\x03X.v\x03" + (30_000).to_bytes(4, "big") + strings + bytes(8))
    assert binary.say(binary.user, "X.v.isVoid; 1; X.v.isVoid;") == ["true", "1", "true"]
    assert binary.say(binary.user, "X.v.size;") == ["30000"]


def test_bytes_that_wait_take_no_more_than_their_number(binary: Company, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        binary.say(binary.thief, b"\x0b\x00\x0bsleep(10h);")
        decoder: Any = binary.thief.input_handler.__self__._decoder  # type: ignore[attr-defined]
        binary.say(binary.thief, b"\x0b\x00\x01;" * 500_000)
        assert decoder.waiting == 2_000_000
        binary.say(binary.thief, b"\x63" * 100_000)
        for _ in range(150):
            binary.thief.feed(bytes(1 << 20))
    assert not binary.thief.connected
    assert [record.getMessage().partition("closed: ")[2] for record in caplog.records] == [
        "134217728 bytes wait for a statement of it to end"
    ] or len(caplog.records) == 1
    binary.unharmed()


def test_unknown_codes_are_logged_once(binary: Company, caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(20):
        binary.say(binary.thief, b"\x63" * 10_000)
    assert binary.say(binary.thief, b"\x0b\x00\x021;") == ["1"]
    assert [record.getMessage() for record in caplog.records] == ["remote Lobby_2 (10.0.0.2): unknown code 99 skipped"]
