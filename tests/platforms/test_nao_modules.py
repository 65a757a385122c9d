"""``ALModule``: functions of urbiscript that others call by QiMessaging, on the manual's own examples."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from nao_caller import QiCaller
from nao_lab import Lab, stand

from urbihw_nao.module_part import MODULE_CALL_BURST, MODULE_CALLS_A_SECOND
from urbihw_nao_fakes import codec
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.foreign import Info

MATHEMATICS = """
var mathematics = ALModule.new("mathematics")|;
function mathematics.add(a, b)
{
  var res = a + b;
  echo("mathematics.add => " + res);
  return res;
}|;
mathematics.setModuleDescription(
  "A powerful module to make remote computing in urbiscript :)");
mathematics.bindUrbiMethod("add", "Compute the sum of two numbers",
[["a",   "first number of the addition"],
 ["b",   "second number of the addition"]],
 ["sum", "the sum of the addition"] );
"""
"""The second example of the manual."""


@pytest.fixture
def open_lab() -> Iterator[Callable[..., Lab]]:
    """Makes robots that are found; at the end nothing listens any more."""
    made: list[Lab] = []

    def open_one(*arguments: Any, **options: Any) -> Lab:
        made.append(Lab.ready(*arguments, **options))
        return made[-1]

    yield open_one
    for lab in made:
        lab.unplug()
        lab.run(0.1)


@pytest.fixture
def lab(open_lab: Callable[..., Lab]) -> Lab:
    """A robot with the module of the manual."""
    made = open_lab()
    assert made.say(MATHEMATICS, 0.5) == ""
    return made


def infos(lab: Lab) -> dict[str, Info]:
    """The modules in the robot's directory."""
    return {each.info.name: each.info for each in lab.device.directory.foreign.values() if each.ready}


def caller_of(lab: Lab, name: str = "mathematics", **words: str) -> QiCaller:
    """A client that has found the module in the directory, and has logged in."""
    info = infos(lab)[name]
    (url,) = info.endpoints
    host, _, port = url.removeprefix("tcp://").partition(":")
    made = QiCaller((host, int(port)), lambda: lab.run(lab.tick), info.number)
    assert made.log_in(**words) == 3
    made.learn()
    return made


@pytest.fixture
def caller(lab: Lab) -> Iterator[QiCaller]:
    """One that calls mathematics."""
    with caller_of(lab) as made:
        yield made


def declare(lab: Lab, *functions: str) -> None:
    """Functions without parameters of the module: name and body."""
    text = "".join(
        f'function mathematics.{row} | mathematics.bindUrbiMethod("{row.partition("(")[0]}", "")|;' for row in functions
    )
    assert lab.say(text, 0.3) == ""


# ---------------------------------------------------------------- what others see


def test_the_example_of_the_manual(lab: Lab, caller: QiCaller) -> None:
    assert caller.call("add", 2, 3) == 5
    assert caller.call("add", "a", "b") == "ab"
    assert caller.call("add", [1, True], [{"k": 2.5}]) == [1, True, {"k": 2.5}]
    assert lab.heard() == ""


def test_it_says_what_it_is(lab: Lab, caller: QiCaller) -> None:
    assert caller.learn() == "A powerful module to make remote computing in urbiscript :)"
    assert caller.call("getModuleHelp") == ["mathematics", caller.learn()]
    assert caller.call("getMethodList") == ["add"]
    assert caller.call("getMethodHelp", "add") == [
        "add", "Compute the sum of two numbers",
        [["a", "first number of the addition"], ["b", "second number of the addition"]], "sum: the sum of the addition",
    ]  # fmt: skip
    assert caller.call("getUsage", "add") == "mathematics.add(a, b): Compute the sum of two numbers"
    assert caller.call("ping") is True
    assert caller.call("version") and caller.call("getBrokerName") == "urbihw"


def test_the_first_example_of_the_manual(open_lab: Callable[..., Lab]) -> None:
    lab = open_lab()
    assert lab.say(
        'var urbiHelloWorld = ALModule.new("urbiHelloWorld")|;'
        ' function urbiHelloWorld.sayHello() { tts.say("Hello"); }|;'
        " urbiHelloWorld.bindUrbiMethod(\"sayHello\", \"Nao will say 'Hello'\", [], []);", 0.5,
    ) == ""  # fmt: skip
    with caller_of(lab, "urbiHelloWorld") as caller:
        assert caller.call("ping") is True
        assert caller.call("sayHello") is None
    assert lab.device.speech.said == ["Hello"]


@pytest.mark.parametrize(
    ("name", "arguments", "error"),
    [
        ("exit", (), "exit: mathematics belongs to urbihw, and is ended there"),
        ("getMethodHelp", ("sub",), "getMethodHelp: mathematics has no method sub; it has add"),
        ("add", (1, None), "unexpected void"),
    ],
)
def test_errors_are_one_line(caller: QiCaller, name: str, arguments: tuple[object, ...], error: str) -> None:
    told = str(caller.call(name, *arguments))
    assert error in told and "\n" not in told


def test_errors_of_a_function(lab: Lab) -> None:
    declare(
        lab, 'boom() { throw "no" }', "unknown() { doesNotExist }", "odd() { return this }", "nothing() {}",
        "deep() { var x = []; for (20) x = [x]; return x }", "ring() { var x = []; x << x; return x }",
    )  # fmt: skip
    with caller_of(lab) as caller:
        assert str(caller.call("boom")) == "no"
        assert str(caller.call("unknown")) == "lookup failed: doesNotExist"
        assert str(caller.call("odd")).startswith("the result cannot be sent: only numbers, Strings")
        assert str(caller.call("deep")) == "the result cannot be sent: it is too deep"
        assert str(caller.call("ring")) == "the result cannot be sent"
        assert caller.call("nothing") is None
    assert lab.heard() == ""


def test_naoqi_may_call_over_the_connection_to_it(lab: Lab) -> None:
    (foreign,) = lab.device.directory.foreign.values()
    foreign.info = foreign.info._replace(endpoints=[])
    values: list[object] = []
    lab.device.directory.call_service("mathematics", "add", (2, 3), values.append)
    lab.run(0.5)
    assert values == [5.0]


# ---------------------------------------------------------------- several calls, long calls


def test_calls_do_not_wait_for_each_other(lab: Lab) -> None:
    declare(lab, "slow() { sleep(1s); return 1 }")
    with caller_of(lab) as caller:
        slow = caller.start("slow")
        began = lab.clock.now()
        assert caller.call("add", 1, 1) == 2
        assert lab.clock.now() - began < 0.2
        assert caller.value("slow", caller.finish(slow)) == 1
        assert lab.clock.now() - began == pytest.approx(1, abs=0.1)


def test_a_call_ends_with_its_caller(lab: Lab) -> None:
    declare(lab, "count() { loop { Global.counted++; sleep(100ms) } }")
    lab.say("var Global.counted = 0|;")
    with caller_of(lab) as caller:
        caller.start("count")
        caller.until(lambda: lab.number("counted") >= 3)
    lab.run(0.2)
    counted = lab.number("counted")
    lab.run(1.0)
    assert lab.number("counted") == counted


def test_a_call_that_takes_too_long_is_ended(lab: Lab) -> None:
    declare(lab, "count() { loop { Global.counted++; sleep(1s) } }")
    lab.say("var Global.counted = 0|;")
    with caller_of(lab) as caller:
        number = caller.start("count")
        caller.until(lambda: number in caller.answers, 4000)
        assert str(caller.value("count", caller.finish(number))) == "no result in 60 s"
        counted = lab.number("counted")
        assert 55 < counted < 65
        lab.run(2.0)
        assert lab.number("counted") == counted


def test_too_many_calls_at_once(lab: Lab) -> None:
    declare(lab, "slow() { sleep(1s); return 1 }")
    with caller_of(lab) as caller:
        numbers = [caller.start("slow") for _ in range(40)]
        values = [caller.value("slow", caller.finish(number)) for number in numbers]
    assert values.count(1.0) == 16
    assert {str(value) for value in values if value != 1.0} == {"slow: too many calls at once"}


def test_a_flood_of_callers_does_not_reach_the_programs(lab: Lab) -> None:
    declare(lab, "mark(x) { Global.marked++ }")
    lab.say('var Global.marked = 0|; mathematics.bindUrbiMethod("mark", "", [["x", ""]], []);', 0.3)
    callers = [caller_of(lab) for _ in range(4)]
    began = lab.clock.now()
    while lab.clock.now() < began + 2.0:
        for each in callers:
            for _ in range(20):
                each.start("mark", 1, kind=codec.POST)
        callers[0].look()
    passed = lab.number("marked")
    assert 100 < passed <= MODULE_CALL_BURST + MODULE_CALLS_A_SECOND * (lab.clock.now() - began) + 1
    lab.run(2.0)
    assert callers[0].call("add", 1, 1) == 2
    for each in callers:
        each.socket.close()


def test_a_long_argument_does_not_reach_the_programs(lab: Lab, caller: QiCaller) -> None:
    for argument in ("z" * 65000, [None] * 10000, [["z" * 100] * 20] * 20):
        told = str(caller.call("add", argument, 1))
        assert "more than" in told and len(told) <= 300 and "\n" not in told


def test_a_long_error_of_a_function_is_cut(lab: Lab) -> None:
    declare(lab, 'boom() { throw "no" * 10000 }')
    with caller_of(lab) as caller:
        assert len(str(caller.call("boom"))) <= 300


def test_a_post_is_run_and_not_answered(lab: Lab) -> None:
    declare(lab, "mark() { Global.marked = 1 }")
    lab.say("var Global.marked = 0|;")
    with caller_of(lab) as caller:
        caller.start("mark", kind=codec.POST)
        caller.until(lambda: lab.number("marked") == 1)
        assert caller.answers == {}


# ---------------------------------------------------------------- motion


def test_a_method_moves_the_robot_as_the_robot_itself(lab: Lab) -> None:
    stand(lab.device.body)
    declare(lab, "nod() { headPitch.val = 0.4 time:1s; return headPitch.val }", "go() { robot.go(2) }")
    with caller_of(lab) as caller:
        assert caller.call("nod") == pytest.approx(0.4, abs=0.05)
        assert "robot" in lab.look("HeadPitch.why")
        walk = caller.start("go")
        caller.until(lambda: lab.device.body.walk[0] > 0.05)
        assert lab.say("robot.stop;", 0.3) == ""
        assert lab.device.body.walk[0] == 0
        assert "was stopped after this statement had begun" in str(caller.value("go", caller.finish(walk)))
        # It may move again.
        assert caller.call("nod") == pytest.approx(0.4, abs=0.05)


def test_an_emergency_stop_holds_for_methods(lab: Lab) -> None:
    stand(lab.device.body)
    declare(lab, "nod() { headPitch.val = 0.4 }")
    lab.say("nao.estop = true|;", 0.2)
    with caller_of(lab) as caller:
        assert "emergency stop" in str(caller.call("nod"))
    assert lab.device.body.joints["HeadPitch"].angle < 0.3


def test_a_walk_ends_when_its_caller_leaves(lab: Lab) -> None:
    stand(lab.device.body)
    declare(lab, "go() { robot.go(2) }")
    with caller_of(lab) as caller:
        caller.start("go")
        caller.until(lambda: lab.device.body.walk[0] > 0.05)
    lab.run(0.5)
    assert lab.device.body.walk[0] == 0


# ---------------------------------------------------------------- coming and going


def test_nothing_listens_before_there_is_a_module(open_lab: Callable[..., Lab]) -> None:
    lab = open_lab()
    lab.run(0.2)
    assert infos(lab) == {}


def test_a_module_that_is_withdrawn(lab: Lab, caller: QiCaller) -> None:
    assert lab.say("mathematics.withdraw;", 0.2) == ""
    assert infos(lab) == {}
    caller.until(lambda: caller.closed)


def test_a_name_that_the_robot_has(lab: Lab) -> None:
    answer = lab.say('ALModule.new("ALMotion");', 0.3)
    assert "ALMotion: Service 'ALMotion' is already registered" in answer.splitlines()[0]
    assert lab.say('ALModule.new("a b");', 0.2).splitlines()[0].endswith(
        "a module cannot have the name 'a b': letters, digits and _ only"
    )  # fmt: skip
    assert list(infos(lab)) == ["mathematics"]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ('mathematics.bindUrbiMethod("sub", "x");', "there is no function sub"),
        ('mathematics.bindUrbiMethod("add", "x", [1], []);', "each parameter: write [name, description]"),
        ('mathematics.bindUrbiMethod("add", "x", [["a", "b"]], ["c"]);', "the result: write [name, description]"),
    ],
)
def test_wrong_declarations(lab: Lab, text: str, error: str) -> None:
    assert error.split(":")[0] in lab.say(text, 0.3)
    with caller_of(lab) as caller:
        assert caller.call("add", 2, 3) == 5


def test_declared_again_it_is_the_same_method(lab: Lab, caller: QiCaller) -> None:
    before = caller.methods["add"][0]
    declare(lab, "other() { 1 }")
    lab.say("mathematics.add = function (a, b) { a - b }|;")
    assert lab.say('mathematics.bindUrbiMethod("add", "", [["a", ""], ["b", ""]], []);', 0.3) == ""
    assert caller.call("add", 5, 3) == 2
    caller.learn()
    assert caller.methods["add"][0] == before


def test_withdrawn_and_made_again_the_new_one_is_called(lab: Lab) -> None:
    text = MATHEMATICS.replace("a + b", "a * b").replace("var mathematics =", "mathematics =")
    assert lab.say("mathematics.withdraw; " + text, 0.5) == ""
    with caller_of(lab) as caller:
        assert caller.call("add", 5, 3) == 15
    assert len(infos(lab)) == 1


def test_registered_again_when_the_link_is_back(lab: Lab, caller: QiCaller) -> None:
    declare(lab, "count() { loop { Global.counted++; sleep(100ms) } }")
    lab.say("var Global.counted = 0|;")
    with caller_of(lab) as other:
        other.start("count")
        other.until(lambda: lab.number("counted") >= 3)
        lab.unplug()
        other.until(lambda: other.closed)
    assert infos(lab) == {}
    counted = lab.number("counted")
    lab.run(1.0)
    assert lab.number("counted") == counted
    lab.end.replug()
    lab.until(lambda: "mathematics" in infos(lab))
    with caller_of(lab) as caller:
        assert caller.call("add", 2, 3) == 5


def test_a_name_that_the_robot_still_has_is_tried_again(lab: Lab) -> None:
    foreign = lab.device.directory.foreign
    (last,) = foreign.values()
    lab.unplug()
    lab.run(0.5)
    # The robot has not noticed that the last connection is gone.
    foreign[99] = last
    lab.end.replug()
    lab.run(2.0)
    assert list(foreign) == [99]
    del foreign[99]
    lab.until(lambda: "mathematics" in infos(lab))
    with caller_of(lab) as caller:
        assert caller.call("add", 2, 3) == 5


def test_a_password_is_asked_of_callers_too(open_lab: Callable[..., Lab]) -> None:
    lab = open_lab(Nao("nao", "secret"), user="nao", password="secret")
    assert lab.say(MATHEMATICS, 0.5) == ""
    info = infos(lab)["mathematics"]
    host, _, port = info.endpoints[0].removeprefix("tcp://").partition(":")
    with QiCaller((host, int(port)), lambda: lab.run(lab.tick), info.number) as stranger:
        assert stranger.log_in(auth_user="nao", auth_token="guess") == 1
        stranger.until(lambda: stranger.closed)
    with caller_of(lab, auth_user="nao", auth_token="secret") as caller:
        assert caller.call("add", 2, 3) == 5


def test_a_name_that_is_taken(lab: Lab) -> None:
    told = lab.say('ALModule.new("mathematics");', 0.5).splitlines()
    assert told[0].endswith(
        'there is a module mathematics already: choose another name, or naoModules.withdraw("mathematics") first'
    )
    # The first one works on, and its name is free again when it is withdrawn.
    assert lab.say("mathematics.add(1, 2);", 0.2).endswith("3")
    assert lab.say('mathematics.withdraw; ALModule.new("mathematics")|; echo("new");', 0.5) == "*** new"
    assert list(infos(lab)) == ["mathematics"]
