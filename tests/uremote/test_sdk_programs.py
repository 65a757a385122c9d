"""What programs of the C++ SDK meet at this server, beside the recordings: numbers, properties, names, a second
program."""

from __future__ import annotations

import re

import pytest
from places import Remote

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject, UVar, variable

CLASS = (
    "class K{}|\nexternal object K|\nexternal function (0) K.update from K|\nif (!isdef(K.load)) var K.load|\n"
    "external var K.load from K|\nK.getSlot(\"load\").update_timed(1, 2)|external function (1) K.init from K|\n"
    "external function (1) K.twice from K|\nif (!isdef(K.v)) var K.v|\nexternal var K.v from K|\n;;\n"
)
"""A class, as text (remote UObject protocol, section 3)."""


class Programs:
    """A server, two programs, and a user."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.first, self.second, self.user = (self.kernel.open_lobby(f"10.0.0.{number}") for number in (1, 2, 3))

    def say(self, lobby: object, text: str) -> list[str]:
        """What a connection is told, without times."""
        lobby.feed(text.encode("latin-1"))  # type: ignore[attr-defined]
        self.kernel.scheduler.run_simulated(self.kernel.clock.now() + 0.1)
        lines = lobby.output.take_bytes().decode("latin-1").splitlines()  # type: ignore[attr-defined]
        return [re.sub(r"^\[\d+", "[", line) for line in lines]


@pytest.fixture
def programs() -> Programs:
    made = Programs()
    assert made.say(made.first, CLASS) == []
    return made


def test_a_number_arrives_with_all_digits_in_calls_changes_and_gets(programs: Programs) -> None:
    programs.say(programs.user, "K.twice(123456789.123456789),")
    assert programs.say(programs.first, "")[0].endswith(", 123456789.12345679]")
    programs.say(programs.user, "K.v = 1/3|;")
    (said,) = programs.say(programs.first, "")
    assert said.startswith('[:__ExternalMessage__] [1, "K.v", 0.3333333333333333, ')
    got = programs.say(programs.first, 'UObject.syncGet("K.v.uvalueSerialize", "t"),')
    assert got == ["[:t] 0.3333333333333333"]


def test_the_version_has_three_numbers(programs: Programs) -> None:
    """The SDK reads what stands before the first and before the second dot."""
    assert programs.say(programs.first, "System.version;") == ['[] "2.3.0"']


@pytest.mark.parametrize(("number", "mode", "value"), [
    (0, "mix", "2"), (1, "add", "6"), (5, "normal", "3"), (7, "normal", "3"), (1.5, "normal", "3"),
])
def test_a_number_chooses_the_blend_mode(programs: Programs, number: float, mode: str, value: str) -> None:
    """``val.blend = urbi::UMIX`` of the manual sends 0, and gets it back."""
    assert programs.say(programs.first, f"K.v->blend = {number}|;") == []
    programs.say(programs.user, "{ K.v = 1 & K.v = 2 & K.v = 3 };")
    assert programs.say(programs.user, "K.v; K.v->blend;") == [f"[] {value}", f"[] {number}"], mode


@pytest.mark.parametrize(("name", "value"), [
    ("rangemin", "-inf"), ("rangemax", "inf"), ("speedmin", "0"), ("speedmax", "inf"), ("delta", "0"),
    ("blend", '"normal"'), ("constant", "false"),
])
def test_an_unset_property_has_the_value_by_which_it_acts(programs: Programs, name: str, value: str) -> None:
    assert programs.say(programs.first, f'UObject.syncGet("K.v->{name}","remotecontext_1"),') == [
        f"[:remotecontext_1] {value}"]


def test_another_unset_property_is_an_error_as_any_void(programs: Programs) -> None:
    for text in ("K.v->colour", "K.v->unset", "void", "K.rangemin"):
        (said,) = programs.say(programs.first, f'UObject.syncGet("{text}","t"),')
        assert said.startswith("[:t] !!! ")


def test_a_second_program_of_many_classes_is_told_once_for_each(programs: Programs) -> None:
    names = ["K", "L", "M", "N"]
    for name in names[1:]:
        programs.say(programs.first, CLASS.replace("K", name))
    said = [line for name in names for line in programs.say(programs.second, CLASS.replace("K", name))]
    assert [line for line in said if "belongs to" in line] == [
        f"[:error] !!! object: {name} belongs to Lobby_1 (10.0.0.1), nothing is declared" for name in names]
    assert len([line for line in said if "slot redefinition: update" in line]) == 1
    assert len(said) == len(names) + 1


def test_a_second_program_declares_nothing_although_it_is_told_once(programs: Programs) -> None:
    for _ in range(2):
        programs.say(programs.second, CLASS.replace("(1) K.twice", "(2) K.twice"))
    assert programs.say(programs.user, "K.twice(1, 2);") == [
        "[:error] !!! 1.1-13: twice: expected 1 argument, given 2"]


def test_echo_takes_a_prefix(programs: Programs) -> None:
    """Server protocol, section 1."""
    said = programs.say(programs.user, 'echo("m", "t", "p"); lobby.echo(1, "", "-"); echo("", "", ">"); echo("m");')
    assert said == ["[:t] p m", "[] - 1", "[] >", "[] *** m"]


class Lamp(UObject):
    """A device of the server."""

    colour = variable(0.0)


class Ear(UObject):
    """Hears of another device's variable."""

    def init(self, source: UVar) -> None:
        self.seen: list[float] = []
        self.notify_change(source, self.hear)

    def hear(self, value: float) -> None:
        self.seen.append(value)


def test_a_process_hears_every_write_with_its_own_value() -> None:
    place = Remote()
    place.server.host.register(Lamp)
    place.register(Ear)
    place.say('var Global.lamp = Lamp.new|; var Global.ear = Ear.new(lamp.getSlot("colour"))|;')
    place.say("for|(var i : 1000) lamp.colour = i;")
    (ear,) = (device for device in place.bridge._devices.values() if isinstance(device, Ear))
    assert ear.seen == [float(number) for number in range(1000)]


class Learned:
    """A variable of another owner, with a callback that sees its value."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.var = UVar(self.kernel.world, self.kernel.world.global_, "learned")
        self.seen: list[tuple[float, float]] = []
        self.callback = self.var.notify_change(lambda var: self.seen.append((var.sensed, var.stamp)))

    def run(self) -> None:
        """Run what is ready."""
        self.kernel.scheduler.run_simulated(self.kernel.clock.now() + 0.1)


def test_a_learned_value_is_there_at_once_and_each_callback_has_its_own() -> None:
    learned = Learned()
    for number in (1.0, 2.0, 3.0):
        learned.var.learn(number, number * 10)
        assert (learned.var.sensed, learned.var.target, learned.var.stamp) == (number, number, number * 10)
    learned.run()
    assert learned.seen == [(1.0, 10.0), (2.0, 20.0), (3.0, 30.0)]
    assert (learned.var.sensed, learned.var.stamp) == (3.0, 30.0)


def test_a_queued_notification_does_not_bring_an_old_value_back() -> None:
    learned = Learned()
    learned.var.learn(1.0, 1.0)
    learned.var.unnotify(learned.callback)
    learned.var.learn(2.0, 2.0)
    learned.run()
    assert (learned.var.sensed, learned.var.target, learned.var.stamp) == (2.0, 2.0, 2.0)


def test_a_callback_that_sleeps_keeps_no_value_of_its_packet_back() -> None:
    learned = Learned()
    lobby = learned.kernel.open_lobby()
    learned.kernel.run_text(lobby, 'UVar.new(Global, "slow")|; Global.getSlot("slow").notifyChange(uobjects_handle, '
                                   "closure() { sleep(5s) })|;", 0.1)
    slow = learned.kernel.world.global_.slots["slow"]
    slow.learn(1.0, 1.0)
    learned.var.learn(2.0, 2.0)
    learned.run()
    assert learned.seen == []
    assert (slow.sensed, learned.var.sensed) == (1.0, 2.0)
    slow.learn(3.0, 3.0)
    assert slow.sensed == 3.0
    learned.kernel.scheduler.run_simulated(learned.kernel.clock.now() + 20)
    assert (slow.sensed, learned.seen) == (3.0, [(2.0, 2.0)])
