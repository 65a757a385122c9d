"""What every platform owes to the standard robot API (docs/robot-api.md), checked on its robot in simulated time.

A platform takes part by its manifest and by ``tests/platforms/<name>_lab.py``: that module offers ``lab()``, which
gives a ``lab.RobotLab`` (or something with the same ``say`` and ``look``) whose robot is open, with its fake in memory;
where there is no ``lab()``, ``Lab.ready()`` is called.  The other contracts want its ``MOTION`` (``motions``) and a
``<name>_plant.py`` (``random_programs``); `urbihw new-platform` writes all of them.
"""

from __future__ import annotations

import importlib
import ipaddress
import re
from typing import NamedTuple

import component_names as names
import pytest
from lab import RobotLab

from urbihw.buses.gate import NO_ORIGIN
from urbihw.platforms import find, folders

PENDING: dict[str, str] = {}
"""Platforms that do not hold the contract yet, and why; a row here that is no longer needed fails."""

_LINE = re.compile(r"\*\*\* ( *)(\[?)(\w+)\]?(?:: (.+))?")
_SLOTS = """
for (var e : robot.named)
  for (var kind : Interface.interfaces(e.part))
    for (var slot : Interface.Promises.needs(kind) + Interface.Promises.offers(kind))
      if (kind.hasLocalSlot(slot) && kind.getProperty(slot, "unit") != "")
        echo("%s|%s|%s" % [e.compactName, slot, kind.getProperty(slot, "unit")])|;
"""


class Node(NamedTuple):
    """One line of ``robot.dump``: how urbiscript reaches the part, its names without places, what it says it is."""

    expression: str
    path: tuple[str, ...]
    kinds: tuple[str, ...]


class Tree:
    """A robot's structure tree as ``dump`` shows it."""

    def __init__(self, lab: RobotLab) -> None:
        self.lab = lab
        self.nodes = list(_nodes(lab.say("robot.dump;")))
        self.devices = [node for node in self.nodes if node.kinds]
        self.compact = lab.say("for (var e : robot.named) echo(e.compactName)|;").replace("*** ", "").split("\n")


def _nodes(dump: str) -> list[Node]:
    found: list[Node] = []
    way: list[Node] = []
    for line in dump.split("\n"):
        match = _LINE.fullmatch(line)
        assert match is not None, f"no line of a dump: {line}"
        indent, bracket, name, kinds = match.groups()
        del way[len(indent) // 2 :]
        above = way[-1] if way else Node("", (), ())
        if bracket:
            node = Node(f"{above.expression}[{name}]", above.path, tuple((kinds or "").split()))
        else:
            node = Node(f"{above.expression}.{name}".lstrip("."), (*above.path, name), tuple((kinds or "").split()))
        way.append(node)
        found.append(node)
    return found


def tree_of(platform: str) -> Tree:
    """The tree of a platform's robot."""
    module = importlib.import_module(f"{platform}_lab")
    return Tree(module.lab() if hasattr(module, "lab") else module.Lab.ready())


def _platforms() -> list[object]:
    marks = {name: [pytest.mark.xfail(reason=reason, strict=True)] for name, reason in PENDING.items()}
    return [pytest.param(name, marks=marks.get(name, [])) for name in (folder.name for folder in folders())]


@pytest.fixture(params=_platforms(), scope="module")
def tree(request: pytest.FixtureRequest) -> Tree:
    """The tree of each platform in turn."""
    return tree_of(request.param)


def test_the_robot_has_devices_under_standard_names(tree: Tree) -> None:
    assert tree.devices
    assert [problem for node in tree.nodes for problem in names.problems_of_path(node.path)] == []


def test_every_device_has_interfaces_that_fit_its_name_and_keeps_what_they_promise(tree: Tree) -> None:
    problems = []
    for node in tree.devices:
        kinds = tree.lab.look(f'Interface.interfaces({node.expression}).map(function (k) {{ k.type }}).join(" ")')
        problems += names.problems_of_kinds(node.path, kinds.strip('"').split())
        missing = tree.lab.look(f"Interface.Promises.missing({node.expression})")
        if missing != "[]":
            problems.append(f"{node.expression} misses {missing}")
    leaves = {node.expression for node in tree.nodes}
    for node in tree.nodes:
        inner = any(other != node.expression and other.startswith(node.expression) for other in leaves)
        if not inner and not node.kinds and tree.lab.look(f"{node.expression}.isA(Component)") != "true":
            problems.append(f"{node.expression} is a leaf without interface")
    assert problems == []


def test_values_are_in_the_units_of_their_slots(tree: Tree) -> None:
    problems = []
    rows = [line.removeprefix("*** ").split("|") for line in tree.lab.say(_SLOTS).split("\n")]
    for name, slot, unit in rows:
        text = tree.lab.look(f"{name}.{slot}.asPrintable").strip('"')
        numbers = re.findall(r"[-\w.+]+", text) if text.startswith("[") else [text]
        for number in numbers:
            if number == "nil":
                continue
            try:
                problem = names.problem_of_value(unit, float(number))
            except ValueError:
                problem = f"{number} is no number of {unit}"
            if problem:
                problems.append(f"{name}.{slot}: {problem}")
    assert problems == []


def test_every_device_is_reached_by_its_compact_name(tree: Tree) -> None:
    assert len(tree.compact) == len(set(tree.compact)) == len(tree.devices)
    pairs = zip(tree.compact, tree.devices, strict=True)
    wrong = [name for name, node in pairs if tree.lab.look(f"{name} === {node.expression}") != "true"]
    assert wrong == []


def test_the_flat_dump_has_every_device_under_its_kinds(tree: Tree) -> None:
    expected: dict[str, list[str]] = {}
    for name, node in zip(tree.compact, tree.devices, strict=True):
        for kind in node.kinds:
            expected.setdefault(kind, []).append(name)
    lines = [f"*** {kind}: {' '.join(expected[kind])}" for kind in sorted(expected)]
    assert tree.lab.say("robot.flatDump;").split("\n") == lines


def test_every_robot_says_what_it_is_in_the_same_words_everywhere(tree: Tree) -> None:
    lab, platform = tree.lab, find(tree.lab.platform).slot
    assert {"Identity", "Network"} <= {*tree.nodes[0].kinds}
    assert lab.look("robot.type").strip('"') in names.CATEGORIES
    for slot in ("name", "model"):
        assert lab.look(f"robot.{slot}.isA(String) && robot.{slot} != \"\"") == "true"
    assert lab.look("robot.serial.isA(String)") == "true"
    ipaddress.ip_address(lab.look("robot.IP").strip('"'))
    for slot in ("name", "model", "serial", "IP"):
        assert lab.look(f"robot.{slot} == {platform}.{slot}") == "true", slot


def test_what_a_battery_cannot_tell_is_nan_and_help_says_so(tree: Tree) -> None:
    for node in tree.devices:
        if "Battery" in node.kinds:
            for slot in ("capacity", "current", "voltage"):
                value = f"{node.expression}.{slot}"
                assert tree.lab.look(f"{value}.isA(Float)") == "true", value
                said = tree.lab.look(f'System.documentation({node.expression}, "{slot}")')
                assert tree.lab.look(f"{value} == {value}") == "true" or "cannot tell it" in said, said


def test_every_device_is_printed_by_a_name_that_leads_to_it(tree: Tree) -> None:
    wrong = [node.expression for node in tree.nodes
             if tree.lab.look(f"({tree.lab.look(node.expression)}) === {node.expression}") != "true"]  # fmt: skip
    assert wrong == []


def test_every_slot_of_a_device_has_a_meaning_and_every_number_a_unit(tree: Tree) -> None:
    problems = []
    for node in [*tree.devices[1:], Node(find(tree.lab.platform).slot, (), ())]:
        rows = tree.lab.say(f'for (var r : System.slotTable({node.expression})) echo(r.join("|"))|;')
        for row in rows.replace("*** ", "").split("\n"):
            name, value, unit, _, meaning = row.split("|", 4)
            path = f"{node.expression}.{name}"
            if re.fullmatch(r"-?[\d.]+(e-?\d+)?|nan|-?inf", value):
                if unit not in names.UNITS:
                    problems.append(f"{path}: no unit")
                elif tree.lab.look(f"{path}->unit") != f'"{unit}"':
                    problems.append(f"{path}: ->unit is not {unit}")
            # An object says itself what it is.
            if not meaning and re.match(r'"|true|false|-?[\d.]|nan|-?inf', value):
                problems.append(f"{path}: no meaning")
    assert problems == []


def test_no_slot_that_a_client_writes_is_refused_for_want_of_an_origin(
    tree: Tree, caplog: pytest.LogCaptureFixture
) -> None:
    written = 0
    for node in tree.devices:
        for row in tree.lab.say(f'for (var r : System.slotTable({node.expression})) echo(r.join("|"))|;').split("\n"):
            name, value = row.removeprefix("*** ").split("|")[:2]
            if re.fullmatch(r"-?[\d.]+(e-?\d+)?", value):
                tree.lab.say(f"{node.expression}.{name} = {value}|;")
                written += 1
    tree.lab.say("", 0.5)
    assert written
    assert NO_ORIGIN not in caplog.text


@pytest.mark.parametrize("platform", [folder.name for folder in folders()])
def test_clients_come_in_only_when_the_tree_is_built(platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    lab = importlib.import_module(f"{platform}_lab").Lab()
    lab.run(0)
    built: list[bool] = []
    answer = lab.robot.arrival.answer

    def look(error: object) -> None:
        if lab.robot.arrival.opening:
            built.append("body" in getattr(lab.kernel.world.global_.slots.get("robot"), "slots", ()))
        answer(error)

    monkeypatch.setattr(lab.robot.arrival, "answer", look)
    # The worker is ahead of a kernel that is busy: what it found and what it measured come in the same round.
    with monkeypatch.context() as busy:
        busy.setattr(lab.kernel.scheduler, "run_simulated", lambda until=None: lab.clock.idle(until))
        for _ in range(150):
            lab.step()
    lab.until(lambda: bool(lab.opened))
    assert (lab.opened, built) == ([None], [True])


# ---------------------------------------------------------------- the check itself


@pytest.mark.parametrize(
    ("path", "problem"),
    [
        (("robot", "body", "head", "yaw"), ""),
        (("robot", "body", "experimentalGrip", "touch"), ""),
        (("body",), "body: the root is called robot"),
        (("robot", "fin"), "robot.fin: fin is no standard name; begin it with experimental"),
        (("robot", "leg"), "robot.leg: leg is part of body, not of robot"),
    ],
)
def test_names_are_checked(path: tuple[str, ...], problem: str) -> None:
    assert names.problems_of_path(path) == ([problem] if problem else [])


def test_kinds_and_values_are_checked() -> None:
    assert names.problems_of_kinds(("robot", "body", "gyro"), ["Led"]) == [
        "robot.body.gyro is Led, but gyro should be GyroSensor"
    ]
    assert names.problems_of_kinds(("robot", "body", "light"), []) == ["robot.body.light has no interface"]
    assert names.problem_of_value("rad", 90.0) == "90 is no value in rad"
    assert names.problem_of_value("rad", float("nan")) == ""
    assert names.problem_of_value("furlong", 1.0) == "there is no unit 'furlong'"


def test_units_and_places_of_the_language_are_those_of_the_table() -> None:
    lab = tree_of("bioloid").lab
    units = lab.say(
        "for (var k : Interface.interfaces) for (var s : Interface.Promises.needs(k) + Interface.Promises.offers(k))"
        '  if (k.hasLocalSlot(s)) echo(k.getProperty(s, "unit"))|;'
    )
    assert {line.removeprefix("*** ").strip() for line in units.split("\n")} - {"***"} <= {*names.UNITS, ""}
    for place in names.PLACES:
        assert lab.look(f"Localization.{place}") == place
    kinds = set(lab.look('Interface.interfaces.map(function (k) { k.type }).join(" ")').strip('"').split())
    named = {kind for part in (names.COMPONENTS | names.DEVICES).values() for kind in part.interfaces}
    assert named <= kinds
