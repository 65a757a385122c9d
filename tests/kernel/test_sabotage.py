"""A program may spoil the library that all share.  The others are still answered, can stop and end the server, and the
next connection finds the library whole: for each slot of each built-in object in turn."""

from __future__ import annotations

import itertools
import logging
import re
import traceback
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.facade import HostProcess
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.runtime.code import make_primitive
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.errors import HeldTooLong

STAMP = re.compile(r"^\[\d+")
WHOLE = (
    '1 + 1; "a"; [1, "x"]; ["k" => 1.5]; nil; true; echo("said"); [3, 1, 2].sort; "ab".size; 1 / 0; nowhere;\n'
    'try { throw Exception.new("no") } catch (var e) { e.message }; function f (x) { x + 1 }; f(2);\n'
    'for (var i : [1, 2]) echo(i); var t = Tag.new("t")|; t: 5; "%s" % 3; Lobby.lobby === lobby; System.version;\n'
    "{ sleep(10ms); 7 }; at (true) echo(8); 1, 2 & 3; wall(9); Global; Object; System.isA(Object); Math.pi.round;\n"
)
"""What a connection types to find out whether the library is whole."""


class Stage:
    """One kernel with a saboteur, an innocent that was there before, and whatever connections come later."""

    def __init__(self) -> None:
        self.kernel = Kernel(fast=True, process=HostProcess(shutdown=self._shut_down))
        self.world = self.kernel.world
        self.ended = 0
        self.saboteur = self.kernel.open_lobby("127.0.0.1")
        self.innocent = self.kernel.open_lobby("127.0.0.1")
        self.told, self.wanted = self.newcomer()
        assert self.told == []
        assert self.wanted[0] == "[] 2"
        assert "internal error" not in "".join(self.wanted)

    def _shut_down(self) -> None:
        self.ended += 1

    def say(self, lobby: Lobby, text: str) -> list[str]:
        """The output of a lobby within ten seconds, without time stamps."""
        said = self.kernel.run_text(lobby, text, self.kernel.clock.now() + 10)
        return [STAMP.sub("[", line) for line in said.splitlines()]

    def newcomer(self) -> tuple[list[str], list[str]]:
        """The greeting of a new connection, and its answers."""
        lobby = self.kernel.open_lobby("127.0.0.1")
        told = [STAMP.sub("[", line) for line in lobby.output.take_bytes().decode("latin-1").splitlines()]
        answers = self.say(lobby, WHOLE)
        lobby.close()
        self.kernel.scheduler.run_simulated(self.kernel.clock.now() + 1)
        self.innocent.output.take_bytes()
        self.saboteur.output.take_bytes()
        return told, answers

    def spoil(self, action: Callable[[], Any]) -> bool:
        """Let the saboteur do something; whether it was done."""
        done: list[bool] = []

        def run() -> None:
            action()
            done.append(True)

        self.kernel.scheduler.spawn(run, "sabotage", context=self.saboteur)
        self.kernel.scheduler.run_simulated(self.kernel.clock.now() + 1)
        return bool(done)

    def harm(self) -> list[str]:
        """What is wrong for the others just now, in words."""
        wrong = []
        answer = self.say(self.innocent, "1 + 1;")
        if len(answer) != 1 or "internal error" in answer[0]:
            wrong.append(f"1 + 1; is answered {answer}")
        before = self.ended
        said = self.say(self.innocent, "System.shutdown; shutdown;")
        if self.ended != before + 2:
            wrong.append(f"shutdown: {said}")
        told, answers = self.newcomer()
        if answers != self.wanted and not any("System.resetLibrary" in line for line in told):
            changed = [pair for pair in itertools.zip_longest(self.wanted, answers) if pair[0] != pair[1]]
            wrong.append(f"a new connection, told {told}: {changed}")
        if len(told) > 2 or not all(line.startswith("[] *** urbihw: ") for line in told):
            wrong.append(f"a new connection is told {told}")
        self.world.record.reset()
        left = self.world.record.check()
        if left:
            wrong.append(f"after System.resetLibrary: {left}")
        return wrong


@pytest.fixture(scope="module")
def stage() -> Iterator[Stage]:
    made = Stage()
    yield made
    made.kernel.close()


def shared(stage: Stage) -> dict[str, Obj]:
    """The built-in objects by their names."""
    found: dict[str, Obj] = {}
    todo: list[tuple[str, Any]] = [("Global", stage.world.global_)]
    for name, obj in todo:
        if stage.world.record.is_shared(obj) and obj not in found.values():
            found[name] = obj
            todo += [(slot if name == "Global" else f"{name}.{slot}", value) for slot, value in obj.slots.items()]
    return found


def replaced(stage: Stage, value: Any) -> Callable[[Obj, str], Any]:
    """Assigns a slot."""
    return lambda obj, slot: stage.world.update_slot(obj, slot, value)


WAYS: dict[str, Callable[[Stage], Callable[[Obj, str], Any]]] = {
    "removed": lambda stage: stage.world.ops.remove_slot,
    "replaced by 3": lambda stage: replaced(stage, 3.0),
    "replaced by nil": lambda stage: replaced(stage, stage.world.nil),
}


@pytest.mark.parametrize("way", WAYS)
def test_no_built_in_slot_is_needed_by_the_others(stage: Stage, way: str, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.ERROR)
    act = WAYS[way](stage)
    wrong, tried = [], 0
    for name, obj in shared(stage).items():
        for slot in list(obj.slots):
            stage.spoil(lambda obj=obj, slot=slot: act(obj, slot))  # type: ignore[misc]
            tried += 1
            wrong += [f"{name}.{slot} {way}: {harm}" for harm in stage.harm()]
    assert wrong == []
    assert tried > 1000
    assert [record.getMessage() for record in caplog.records if record.name.startswith("urbihw")] == []


def test_no_built_in_object_needs_its_prototypes(stage: Stage) -> None:
    wrong = []
    for name, obj in shared(stage).items():
        stage.spoil(lambda obj=obj: obj.set_protos([]))  # type: ignore[misc]
        wrong += [f"{name}.protos emptied: {harm}" for harm in stage.harm()]
    assert wrong == []


# ---------------------------------------------------------------- jobs, tags, printing

OTHERS = "Lobby.instances.each(closure (l) { if (l !== Lobby && l !== lobby) { %s } });"

STATEMENTS = (
    "System.jobs.each(closure (j) { j.terminate });",
    "loop { System.jobs.each(closure (j) { try { j.terminate } catch {} }); sleep(10ms) },",
    "System.jobs.each(closure (j) { j.tags.each(closure (t) { try { t.freeze } catch {} }) });",
    "System.jobs.each(closure (j) { j.tags.each(closure (t) { try { t.block } catch {} }) });",
    OTHERS % "l.connectionTag.block",
    OTHERS % "l.connectionTag.freeze",
    OTHERS % "l.connectionTag.stop",
    OTHERS % "l.connectionTag.protos = [l.connectionTag]",
    OTHERS % "l.connectionTag = 3",
    OTHERS % 'l.removeSlot("connectionTag")',
    OTHERS % "at (l.connectionTag.enter? if { sleep(inf); true }) 1",
    OTHERS % "at (l.connectionTag.leave? if { sleep(inf); true }) 1",
    OTHERS % 'l.receive("connectionTag.block; connectionTag.freeze; ")',
    "at (Tag.enter? if { sleep(inf); true }) 1; at (Tag.leave? if { sleep(inf); true }) 1;",
    "Tag.freeze; Tag.block;",
    "at (Lobby.onDisconnect?(var l) if { sleep(inf); true }) 1;",
    "var o = Object.new|; o.addProto(lobby)|; Object.addProto(o); Object.addProto(lobby);",
    "Float.'+' = function (x) { 2 };",
    "throw Object; throw Global; throw Exception; throw Traceable;",
)
"""What a program may try to keep the others from being answered."""


@pytest.fixture
def fresh() -> Stage:
    return Stage()


@pytest.mark.parametrize("text", STATEMENTS)
def test_no_program_silences_the_others(fresh: Stage, text: str) -> None:
    fresh.say(fresh.innocent, "every (1s) { 1 }, at (lobby.hasLocalSlot(\"late\")) 1; var t = Tag.new; t: sleep(1h),")
    fresh.say(fresh.saboteur, text)
    fresh.say(fresh.innocent, "")
    assert fresh.say(fresh.innocent, "1 + 1;") == ["[] 2"]
    assert fresh.harm() == []
    jobs = fresh.kernel.scheduler.jobs
    fresh.innocent.close()
    fresh.kernel.scheduler.run_simulated(fresh.kernel.clock.now() + 3)
    assert [job.name for job in jobs if job.context is fresh.innocent] == []


def test_a_main_job_that_is_terminated_goes_on_with_the_next_statement(fresh: Stage) -> None:
    fresh.innocent.feed(b"sleep(1h);\n")
    fresh.say(fresh.saboteur, "System.jobs.reverse.each(closure (j) { j.terminate });")
    told = "[:error] !!! received interruption, killing foreground job."
    assert fresh.say(fresh.innocent, "") == [told]
    assert fresh.say(fresh.innocent, "1 + 1;") == ["[] 2"]


def test_a_main_job_that_has_not_begun_is_not_ended() -> None:
    kernel = Kernel(fast=True)
    saboteur, young = kernel.open_lobby(), kernel.open_lobby()
    kernel.run_text(saboteur, "System.jobs.reverse.each(closure (j) { j.terminate });")
    assert kernel.run_text(young, "1 + 1;").endswith("] 2\n")


def test_the_jobs_of_the_server_are_not_among_those_of_programs(fresh: Stage) -> None:
    fresh.kernel.open_lobby().close()
    fresh.world.call_soon(lambda: fresh.kernel.scheduler.sleep(5))
    fresh.say(fresh.innocent, "var names = function () { System.jobs.map(closure (j) { j.name }) }|;")
    fresh.world.call_soon(lambda: fresh.kernel.scheduler.sleep(20))
    fresh.kernel.scheduler.run()
    assert fresh.say(fresh.innocent, 'names.any(closure (n) { n == "notify" || n == "disconnect" });') == ["[] false"]
    assert fresh.say(fresh.innocent, "System.aliveJobs == System.jobs.size;") == ["[] true"]


def test_the_tag_of_a_connection_and_Tag_itself_can_only_be_stopped(fresh: Stage) -> None:
    for verb in ("block", "freeze"):
        (error,) = fresh.say(fresh.saboteur, f"connectionTag.{verb};")
        assert error.endswith(f": {verb}: the tag of a connection can only be stopped")
        (error,) = fresh.say(fresh.saboteur, f"Tag.{verb};")
        assert error.endswith(f": {verb}: all tags derive from Tag: use one made by Tag.new")
    fresh.say(fresh.saboteur, "var t = Tag.new|; t.freeze; t.unfreeze; t: connectionTag.stop; 3;")
    assert fresh.say(fresh.saboteur, "3;") == ["[] 3"]


def test_those_who_hear_of_a_tag_do_not_hold_it_up(fresh: Stage) -> None:
    fresh.say(fresh.saboteur, OTHERS % 'at (l.connectionTag.enter? if { sleep(1s); true }) echo("in")')
    assert fresh.say(fresh.innocent, "1;") == ["[] 1"]
    assert fresh.say(fresh.saboteur, "").count("[] *** in") >= 1


def test_a_notification_that_is_held_up_does_not_hold_up_the_next(fresh: Stage) -> None:
    scheduler, world, heard = fresh.kernel.scheduler, fresh.world, []
    world.call_soon(lambda: scheduler.suspend(None))
    world.call_soon(lambda: heard.append(1))
    scheduler.run()
    world.call_soon(lambda: heard.append(2))
    scheduler.run()
    assert heard == [1, 2]


# ---------------------------------------------------------------- what is owed, the messages, and the way back

REFUSED = (
    'Global.removeSlot("System");', "Object.protos = [];", "Global.protos = [];", "Lobby.protos = [];",
    "var Lobby.System = 3;", "var Object.System = 3;", "{ System.redefinitionMode; var Global.System = 3 };",
    'System.removeSlot("shutdown");', "Global.System->constant = false;",
    'Lobby.setSlot("shutdown", 3);', 'Lobby.removeSlot("quit");',
    "{ var x = Object.new | var x.System = 3 | Object.addProto(x) };",
    "var y = Object.new | Object.addProto(y) | var y.System = 3;",
)  # fmt: skip


@pytest.mark.parametrize("text", REFUSED)
def test_what_is_owed_to_all_stays(fresh: Stage, text: str) -> None:
    *_, error = fresh.say(fresh.saboteur, text)
    assert re.search(r"!!! \S+: \w+ is for everybody: it cannot be removed, replaced or hidden$", error)
    assert fresh.harm() == []


@pytest.mark.parametrize("text", [
    "System = 3;", "Global.System = 3;", "System.shutdown = 3;", "shutdown = 3;", 'UVar.new(Global, "System");',
])  # fmt: skip
def test_what_is_owed_to_all_cannot_be_assigned(fresh: Stage, text: str) -> None:
    (error,) = fresh.say(fresh.saboteur, text)
    assert error.endswith(": cannot modify const slot")
    assert fresh.harm() == []


def test_the_next_connection_is_told_and_the_log_too(fresh: Stage, caplog: pytest.LogCaptureFixture) -> None:
    fresh.say(fresh.saboteur, 'Global.removeSlot("Path"); List.size = 3; String.asPrintable = function () { "s" };')
    told, _ = fresh.newcomer()
    assert told == [
        "[] *** urbihw: put back in the library: Global.Path, List.size",
        "[] *** urbihw: changed in the library: String.asPrintable; System.resetLibrary brings it back",
    ]
    told, _ = fresh.newcomer()
    assert told == ["[] *** urbihw: changed in the library: String.asPrintable; System.resetLibrary brings it back"]
    assert [record.getMessage() for record in caplog.records if record.name == "urbihw.kernel"] == [
        "library: put back what a program spoilt: Global.Path, List.size",
        "library: a program changed: String.asPrintable",
    ]
    assert fresh.say(fresh.innocent, '"x";') == ['[] s']
    assert fresh.say(fresh.innocent, "System.resetLibrary;") == ['[] ["String.asPrintable"]']
    assert fresh.say(fresh.innocent, '"x"; System.resetLibrary;') == ['[] "x"', "[] []"]
    assert fresh.newcomer()[0] == []


def test_resetting_takes_one_object_or_one_slot(fresh: Stage) -> None:
    spoil = "List.size = 3|; List.head = 3|; String.size = 3|; List.protos = []|; System.period = 1|;"
    fresh.say(fresh.saboteur, spoil)
    assert fresh.say(fresh.innocent, 'System.resetLibrary("List.head");') == ['[] ["List.head"]']
    assert fresh.say(fresh.innocent, "System.resetLibrary(List);") == ['[] ["List.protos", "List.size"]']
    assert fresh.say(fresh.innocent, 'System.resetLibrary("String");') == ['[] ["String.size"]']
    assert fresh.say(fresh.innocent, "System.period;") == ["[] 1"]
    for text, problem in (
        ('System.resetLibrary("List.nothing");', "there is no List.nothing in the library"),
        ('System.resetLibrary("Nothing");', "there is no Nothing in the library"),
        ("System.resetLibrary(Object.new);", "Object is no object of the library"),
    ):
        (error,) = fresh.say(fresh.innocent, text)
        assert error.endswith(f": resetLibrary: {problem}")


def test_what_a_program_adds_is_its_own_affair(fresh: Stage) -> None:
    added = "var Global.x = 3|; function String.twice() { this + this }|; class Global.C { var v }|; "
    fresh.say(fresh.saboteur, added + "List.addProto(C)|; var Global.t = Tag.new|; System.period = 10ms|;")
    told, _ = fresh.newcomer()
    assert told == ["[] *** urbihw: changed in the library: List.protos; System.resetLibrary brings it back"]
    fresh.say(fresh.saboteur, "List.removeProto(C)|;")
    assert fresh.newcomer()[0] == []
    assert fresh.say(fresh.innocent, 'Global.x; "a".twice;') == ["[] 3", '[] "aa"']


def test_only_a_class_may_stand_for_a_class(fresh: Stage) -> None:
    fresh.say(fresh.saboteur, "Global.Float = 3|; Global.Comparable = Object.new|;")
    fresh.say(fresh.saboteur, "class L: List {}|; Global.List = L|;")
    told, _ = fresh.newcomer()
    assert told == [
        "[] *** urbihw: put back in the library: Global.Float, Global.Comparable",
        "[] *** urbihw: changed in the library: Global.List; System.resetLibrary brings it back",
    ]


def test_a_slot_that_hides_one_of_the_library_is_told_of(fresh: Stage) -> None:
    fresh.say(fresh.saboteur, "var Global.time = 3|;")
    told, _ = fresh.newcomer()
    assert told == ["[] *** urbihw: changed in the library: Global.time; System.resetLibrary brings it back"]
    assert fresh.say(fresh.innocent, "System.resetLibrary;") == ['[] ["Global.time"]']


def test_operators_are_quick_again_after_a_reset(fresh: Stage) -> None:
    world = fresh.world
    fresh.say(fresh.saboteur, "{ System.redefinitionMode; function Float.'+'(x) { 42 }; function List.'<<'(x) { 1 } };")
    assert world.generic_floats and world.quick_lists is None
    fresh.say(fresh.saboteur, "System.resetLibrary|;")
    assert not world.generic_floats and world.quick_lists is world.list_protos


def test_errors_are_told_plainly_when_nothing_prints_any_more(fresh: Stage) -> None:
    fresh.say(
        fresh.saboteur,
        'for (var c : [Object, String, Location, Exception, Lobby, StackFrame]) '
        'for (var n : ["asString", "asPrintable", "asToplevelPrintable", "message"]) c.removeSlot(n);',
    )
    said = fresh.say(fresh.innocent, 'nowhere; 1 / 0; throw [1, "x"]; function f() { 1.foo }|; f();')
    assert [re.sub(r"\d+\.\d+-\d+", "PLACE", line) for line in said] == [
        "[:error] !!! PLACE: lookup failed: nowhere",
        "[:error] !!! PLACE: /: division by 0",
        '[:error] !!! [1, "x"]',
        "[:error] !!! PLACE: lookup failed: foo",
        "[:error] !!!    called from: PLACE: f",
    ]


VALUES = '1 + 1; "a" + "b"; [1, "x"]; 1 < 2; ["k" => 3s]; (1, nil); Object.new; 3s; Float; lobby === this;'
"""Values whose printing goes through most of the slots that print."""


def shown(stage: Stage, lobby: Lobby, text: str = VALUES) -> list[str]:
    """The values that a lobby shows, without its other output."""
    said = stage.say(lobby, text)
    return [re.sub("_0x[0-9a-f]+", "_0x", line[3:]) for line in said if not line.startswith(("[:error]", "[] ***"))]


def test_native_values_are_shown_though_no_slot_of_their_class_is_left(fresh: Stage) -> None:
    wanted = shown(fresh, fresh.innocent)
    wrong = []
    for name, obj in shared(fresh).items():
        for slot in list(obj.slots):
            fresh.spoil(lambda obj=obj, slot=slot: fresh.world.ops.remove_slot(obj, slot))  # type: ignore[misc]
        if obj not in (fresh.world.object, fresh.world.global_):
            # Who was there already asks before the next connection puts the rest back.
            seen = shown(fresh, fresh.innocent, "2; true; ")
            wrong += [f"{name}: {seen}"] if seen != ["2", "true"] else []
        newcomer = fresh.kernel.open_lobby("127.0.0.1")
        seen = shown(fresh, newcomer)
        wrong += [f"{name}: a new connection: {seen}"] if seen != wanted else []
        newcomer.close()
        fresh.world.record.reset()
    assert wrong == []


PRINTERS = tuple(
    f"{name}.{slot}" for name in ("Object", "Float", "String", "List", "Dictionary", "Tuple", "true", "Duration",
                                  "Exception", "Location", "nil")
    for slot in ("asToplevelPrintable", "asPrintable", "asString")
)  # fmt: skip


def redefined(body: str) -> str:
    """A program that gives all slots that print another function."""
    return "".join(f"{slot} = function () {{ {body} }}|;" for slot in PRINTERS)


def test_a_value_whose_printing_fails_is_shown_plainly_and_the_change_is_told(fresh: Stage) -> None:
    wanted = shown(fresh, fresh.innocent)
    fresh.say(fresh.saboteur, redefined('throw "no"'))
    newcomer = fresh.kernel.open_lobby("127.0.0.1")
    (line,) = newcomer.output.take_bytes().decode("latin-1").splitlines()
    assert "*** urbihw: changed in the library: " in line
    assert line.endswith("; System.resetLibrary brings it back")
    for lobby in (newcomer, fresh.innocent):
        seen = shown(fresh, lobby)
        assert [seen[at] for at in (0, 1, 2, 3, 5, 7, 9)] == [wanted[at] for at in (0, 1, 2, 3, 5, 7, 9)]
        assert len(seen) == len(wanted)
        assert fresh.say(lobby, "1 / 0;")[0].endswith(": /: division by 0")
    fresh.say(newcomer, "System.resetLibrary;")
    assert shown(fresh, newcomer) == wanted


@pytest.mark.parametrize("body", ["sleep(1h)", "try { sleep(1h) } finally { sleep(3s) }", "Tag.new.freeze; sleep(inf)"])
def test_a_printing_that_takes_too_long_is_given_up_once(fresh: Stage, body: str) -> None:
    wanted = shown(fresh, fresh.innocent)
    fresh.say(fresh.saboteur, redefined(body))
    began = fresh.kernel.clock.now()
    told = fresh.say(fresh.innocent, "1 / 0; 2;")
    assert told[0].endswith(": /: division by 0")
    assert told[1].startswith("[] *** urbihw: put back in the library, since printing took too long: ")
    assert told[2:] == ["[] 2"]
    assert shown(fresh, fresh.innocent) == wanted
    assert fresh.newcomer()[0] == []
    assert fresh.kernel.clock.now() - began < 60


def test_an_error_that_cannot_be_printed_in_time_is_told_plainly(fresh: Stage) -> None:
    fresh.say(fresh.saboteur, redefined("sleep(1h)"))
    *_, error = fresh.say(fresh.innocent, "throw [1];")
    assert error == "[:error] !!! 1.1-9: [1]"


def test_a_program_that_prints_its_own_objects_slowly_may(fresh: Stage) -> None:
    fresh.say(fresh.innocent, 'class C { function asString() { sleep(5s); "slow" } }|;')
    assert fresh.say(fresh.innocent, "C.new;") == ["[] slow"]


def test_a_changed_printing_that_works_is_left_alone(fresh: Stage) -> None:
    fresh.say(fresh.saboteur, 'Float.asString = function () { "f" }|; Float.asToplevelPrintable = Float.asString|;')
    fresh.say(fresh.saboteur, 'List.asToplevelPrintable = function () { "list" }|;')
    assert fresh.say(fresh.innocent, "[1];") == ["[] list"]
    assert fresh.say(fresh.innocent, "[1];") == ["[] list"]
    assert fresh.world.record.printing_changed
    fresh.say(fresh.innocent, "System.resetLibrary|;")
    assert not fresh.world.record.printing_changed


def test_a_function_that_held_everybody_up_while_printing_is_put_back(fresh: Stage) -> None:
    def hold(this: Any) -> Any:
        raise HeldTooLong("held the interpreter for more than 0.5 s: give way with ';' or sleep")

    fresh.world.ops.put_slot(fresh.world.object, "hold", make_primitive(fresh.world, "hold", hold, 0, 0))
    fresh.say(fresh.saboteur, "Float.asString = function () { hold }|; String.asString = function () { size.hold }|;")
    said = fresh.say(fresh.innocent, "echo(1); echo(1); 5;")
    assert ": held the interpreter" in said[1]
    assert said[0] == "[] *** urbihw: put back in the library, since it held the interpreter: Float.asString"
    assert said[-2:] == ["[] *** 1", "[] 5"]


HELD = {
    "Float.asString": "function () { hold }|; try { echo(1) } catch {}",
    "Float.'<'": "function (b) { hold }|; try { echo(2 < 1) } catch {}",
    "String.'=='": 'function (b) { hold }|; try { echo("a" == "b") } catch {}',
    "Float.uid": "function () { hold }|; try { 1.uid } catch {}",
    "List.asString": "function () { hold }|; try { echo([1]) } catch {}",
}
"""Library functions, with what takes their place in one connection, and what comes upon it in another one."""


@pytest.mark.parametrize("name", HELD)
def test_what_held_the_interpreter_in_the_place_of_a_library_function_is_gone_at_once(fresh: Stage, name: str) -> None:
    blamed = []

    def hold(this: Any) -> Any:
        blamed.append(fresh.world.record.is_replaced({frame.f_code for frame, _ in traceback.walk_stack(None)}))
        raise HeldTooLong("held the interpreter")

    fresh.world.ops.put_slot(fresh.world.object, "hold", make_primitive(fresh.world, "hold", hold, 0, 0))
    (body, _, use), plain = HELD[name].partition("|; "), name.replace("'", "")
    for _ in range(2):
        assert fresh.say(fresh.saboteur, f"{name} = {body}|;") == []
        told = fresh.say(fresh.innocent, f"{use};")
        (line,) = told
        assert line == f"[] *** urbihw: put back in the library, since it held the interpreter: {plain}"
        fresh.say(fresh.innocent, f"{use};")
    # Who came upon it is not to blame; and there is no third time.
    assert blamed == [True, True]
    assert "cannot modify const slot" in fresh.say(fresh.saboteur, f"{name} = {body}|;")[0]


def test_a_program_that_holds_the_interpreter_itself_loses_none_of_its_functions(fresh: Stage) -> None:
    def hold(this: Any) -> Any:
        raise HeldTooLong("held the interpreter")

    fresh.world.ops.put_slot(fresh.world.object, "hold", make_primitive(fresh.world, "hold", hold, 0, 0))
    fresh.say(fresh.saboteur, "function Global.mine() { hold }|; Float.asString = function () { \"f\" }|; mine;")
    assert fresh.say(fresh.innocent, "try { mine } catch { echo(2) };") == ["[] *** f"]


def test_what_the_robots_own_code_changes_is_no_change(fresh: Stage) -> None:
    kernel, world = fresh.kernel, fresh.world
    kernel.host.run("var Global.part = Object.new|; function Global.act() { 1 }; var part.sub = Object.new|;", "a.u")
    fresh.say(fresh.saboteur, "")
    kernel.complete()
    fresh.say(fresh.saboteur, "List.size = function () { 3 }|;")
    text = "{ System.redefinitionMode; var Global.part = part.clone; function Global.act() { sleep(1s); 2 } }; act;"
    kernel.host.run(text, "a.u")
    fresh.say(fresh.innocent, "")
    told, _ = fresh.newcomer()
    assert told == ["[] *** urbihw: changed in the library: List.size; System.resetLibrary brings it back"]
    fresh.say(fresh.saboteur, "Global.removeSlot(\"part\"); Global.act = 3|;")
    told, _ = fresh.newcomer()
    assert told[0] == "[] *** urbihw: put back in the library: Global.part, Global.act"
    assert fresh.say(fresh.innocent, "act; System.resetLibrary;") == ["[] 2", '[] ["List.size"]']
    assert world.record.check() == []


def test_what_the_robots_own_code_changes_while_the_library_is_recorded_is_no_change(fresh: Stage) -> None:
    """The tree of a robot may grow while the daemon begins to serve, and while the first clients connect."""
    kernel, world = fresh.kernel, fresh.world
    kernel.host.run("var Global.go = Event.new|; class Global.Part { function tell() { 1 } };"
                    "var Global.part = Part.new|; waituntil (go?); function part.tell() { 2 }; waituntil (go?);", "a.u")
    fresh.say(fresh.saboteur, "")
    kernel.complete()
    for _ in range(2):
        fresh.say(fresh.innocent, "go!;")
        assert world.record.check() == []
    assert fresh.say(fresh.innocent, "part.tell; part.tell = function () { 3 }|; System.resetLibrary; part.tell;") == [
        "[] 2", '[] ["part.tell"]', "[] 2"]


def test_lobbies_that_were_made_end_with_the_connection_of_their_maker(fresh: Stage) -> None:
    lobbies = fresh.kernel.programs.lobbies
    before = dict(lobbies)
    maker = fresh.kernel.open_lobby("127.0.0.1")
    fresh.say(maker, "var l = Lobby.create|; l.receive(\"Lobby.create|; every (1s) echo(1),\"); Lobby.create.quit;")
    assert len(lobbies) == len(before) + 3
    fresh.say(fresh.innocent, "Lobby.create|;")
    maker.close()
    fresh.kernel.scheduler.run_simulated(fresh.kernel.clock.now() + 3)
    assert len(lobbies) == len(before) + 1
    assert {job.context for job in fresh.kernel.scheduler.jobs} <= {None, *lobbies}


def test_the_error_of_a_programs_own_printing_is_told(fresh: Stage) -> None:
    fresh.say(fresh.saboteur, 'Object.asToplevelPrintable = function () { throw "mine" };')
    error, text = fresh.say(fresh.innocent, "Object.new;")
    assert error == "[:error] !!! mine"
    assert text.startswith("[] Object_0x")


def test_the_banner_is_that_of_the_library(fresh: Stage) -> None:
    fresh.kernel.programs.quiet = False
    fresh.say(fresh.saboteur, "Lobby.banner = function () { sleep(1h); throw 3 };")
    lobby = fresh.kernel.open_lobby()
    assert lobby.output.take_bytes().decode("latin-1").count("\n") == 11
