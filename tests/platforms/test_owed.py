"""No program takes the robot from the others: its slots in Global, ``robot.stop`` and the emergency stop work whatever
was made of the library, on every platform, in simulated time."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from typing import Any

import pytest
from lab import RobotLab

from urbihw.buses import messages as m
from urbihw.kernel import Kernel
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject.protection import protect_robot
from urbihw.platforms import find, folders
from urbihw.robot import ROBOT_LIBRARY

APART = 0.1
"""Seconds between two stops that are not the same one."""


class Stage:
    """A robot that is open, as the daemon has it, with a saboteur and an innocent."""

    def __init__(self, platform: str, *, comes_late: bool = False) -> None:
        module = importlib.import_module(f"{platform}_lab")
        self.lab: RobotLab = module.lab() if hasattr(module, "lab") else module.Lab.ready()
        self.slot = find(platform).slot
        steps = [lambda: protect_robot(self.lab.robot, self.slot), self.lab.kernel.complete]
        for step in reversed(steps) if comes_late else steps:
            step()
        self.world = self.lab.kernel.world
        self.sent: list[m.ToWorker] = []
        assert self.lab.worker is not None
        self.lab.worker.send = self.sent.append

    def answer(self, text: str) -> str:
        """What the innocent is answered, without letting the bus go on."""
        lab = self.lab
        lab.clock.advance(APART)
        lab.kernel.feed(lab.observer, text.encode())
        lab.kernel.scheduler.run_simulated(lab.clock.now())
        return lab.observer.output.take_bytes().decode()

    def spoil(self, action: Callable[[], Any]) -> None:
        """Let the saboteur do something."""
        self.lab.kernel.scheduler.spawn(action, "sabotage", context=self.lab.lobby)
        self.lab.kernel.scheduler.run_simulated(self.lab.clock.now())

    def harm(self) -> list[str]:
        """What is wrong with the stops of the innocent, in words."""
        wrong = []
        for text, kind in (
            ("robot.stop;", m.Stop), (f"{self.slot}.stop;", m.Stop),
            (f"{self.slot}.estop = true;", m.EmergencyStop), (f"{self.slot}.estop = false;", m.Release),
        ):  # fmt: skip
            self.sent.clear()
            said = self.answer(text)
            if not any(isinstance(message, kind) for message in self.sent):
                wrong.append(f"{text} {said}")
        return wrong

    def mended(self) -> list[str]:
        """The output of a new connection, without time stamps."""
        lobby = self.lab.kernel.open_lobby()
        told = [line.partition("] ")[2] for line in lobby.output.take_bytes().decode().splitlines()]
        lobby.close()
        self.lab.kernel.scheduler.run_simulated(self.lab.clock.now())
        return told


@pytest.fixture(params=[folder.name for folder in folders()])
def stage(request: pytest.FixtureRequest) -> Stage:
    return Stage(request.param)


def test_the_stop_needs_no_slot_of_the_library(stage: Stage) -> None:
    world = stage.world
    classes: list[Any] = [world.object, world.global_, world.lobby_proto, world.classes["System"], stage.lab.robot.face]
    slots = world.global_.slots
    robot = slots["robot"]
    assert isinstance(robot, Obj)
    classes += [robot, *robot.protos, *stage.lab.robot.face.protos]
    classes += [slots[name] for name in ("Mobility", "Component", "Localizer") if name in slots]
    classes += [slots["Interface"].slots[name] for name in ("Mobile", "Identity")]
    wrong, tried = [], 0
    assert stage.harm() == []
    for obj in dict.fromkeys(classes):
        for slot in list(obj.slots):
            stage.spoil(lambda obj=obj, slot=slot: world.ops.remove_slot(obj, slot))  # type: ignore[misc]
            wrong += [f"{slot} removed: {harm}" for harm in stage.harm()]
            world.record.reset()
            tried += 1
        stage.spoil(lambda obj=obj: obj.set_protos([]))  # type: ignore[misc]
        wrong += [f"{world.uid(obj)}.protos emptied: {harm}" for harm in stage.harm()]
        world.record.reset()
    assert wrong == []
    assert tried > 200


SABOTAGE = (
    'Global.removeSlot("robot")', 'Global.removeSlot("SLOT")', "robot = 3", "SLOT = 3", "Global.robot = nil",
    "var Lobby.robot = 3", "var Object.SLOT = 3", 'Object.setSlot("robot", nil)',
    "robot.stop = 3", 'robot.setSlot("stop", 3)', 'robot.removeSlot("stop")', "SLOT.stop = 3",
    'SLOT.setSlot("stop", 3)',
    'SLOT.setSlot("estop", 3)', 'SLOT.removeSlot("estop")', "SLOT.estop = 3", "SLOT->constant = false | SLOT = 3",
    "{ System.redefinitionMode; function robot.stop() { 1 } }", "{ System.redefinitionMode; var Global.SLOT = 1 }",
    'SLOT.setProperty("stop", "constant", false) | SLOT.stop = 3', "robot.protos = []", "SLOT.protos = []",
    "{ var x = Object.new | var x.robot = 3 | Object.addProto(x) }",
    "{ var y = Object.new | Object.addProto(y) | var y.robot = 3 }", "Global.protos = []", "Lobby.protos = []",
    'UVar.new(SLOT, "stop")', 'UVar.new(Global, "robot")', 'SLOT.getSlot("estop").unnotify', "SLOT.destroy",
)  # fmt: skip


def test_no_statement_takes_the_stop_away(stage: Stage) -> None:
    wrong = []
    for text in SABOTAGE:
        lab, text = stage.lab, text.replace("SLOT", stage.slot)
        lab.kernel.feed(lab.lobby, f"{text};".encode())
        lab.kernel.scheduler.run_simulated(lab.clock.now())
        lab.lobby.output.take_bytes()
        wrong += [f"{text}: {harm}" for harm in stage.harm()]
        stage.mended()
    assert wrong == []


def test_devices_that_a_program_removes_are_there_for_the_next_connection(stage: Stage) -> None:
    slots = stage.world.global_.slots
    name = next(name for name, value in slots.items() if getattr(value, "python", None) and name != stage.slot)
    device = slots[name]
    for text in (f'Global.removeSlot("{name}");', f"Global.{name} = 3;"):
        stage.lab.say(text)
        assert stage.mended() == [f"*** urbihw: put back in the library: Global.{name}"]
        assert slots[name] is device
    assert stage.mended() == []


def test_what_the_robot_makes_of_itself_later_is_no_change(stage: Stage) -> None:
    lab = stage.lab
    lab.kernel.host.run("robot.makeCompactNames;", "later")
    lab.run(0.1)
    assert stage.mended() == []


def test_a_robot_that_is_protected_after_the_start_is_no_change(caplog: pytest.LogCaptureFixture) -> None:
    stage = Stage("spykee", comes_late=True)
    assert stage.mended() == []
    assert stage.harm() == []
    assert "library" not in caplog.text


def test_the_state_of_a_behaviour_of_the_robot_is_not_put_back() -> None:
    kernel = Kernel(clock=SimClock(), libraries=(ROBOT_LIBRARY,))
    kernel.host.run("class Global.behaviour { var running = nil; };", "behaviour.u")
    kernel.scheduler.run_simulated(0.1)
    kernel.complete()
    first = kernel.open_lobby()
    kernel.feed(first, b'behaviour.running = Tag.new("t")|;')
    kernel.scheduler.run_simulated(0.2)
    first.output.take_bytes()
    second = kernel.open_lobby()
    kernel.feed(second, b"behaviour.running.isNil;")
    kernel.scheduler.run_simulated(0.3)
    assert b"false" in second.output.take_bytes()


def test_what_kind_of_robot_it_is_may_be_said(caplog: pytest.LogCaptureFixture) -> None:
    stage = Stage("chain")
    stage.lab.say('robot.type = "humanoid";')
    assert stage.mended() == []
    assert stage.lab.look("robot.type") == '"humanoid"'
    assert "library" not in caplog.text


def test_the_devices_of_a_robot_that_a_program_made_are_its_own() -> None:
    kernel = Kernel(clock=SimClock(), libraries=(ROBOT_LIBRARY,))
    kernel.complete()
    first = kernel.open_lobby()
    kernel.feed(
        first,
        b"class Wheel { var val = 0 }; var Global.robot = Component.new(\"robot\");"
        b"robot.addDevice(\"wheel\", Wheel.new.addProto(Interface.RotationalMotor));"
        b"robot.makeCompactNames; wheel.val = 2;",
    )
    kernel.scheduler.run_simulated(0.1)
    assert kernel.world.record.check() == []


def test_devices_that_are_found_later_are_no_change(caplog: pytest.LogCaptureFixture) -> None:
    stage = Stage("bioloid")
    slots = stage.world.global_.slots
    joint = slots["joint"]
    stage.lab.robot.on_found(m.Found(()))  # a worker that was replaced has looked at the bus
    stage.lab.kernel.scheduler.run_simulated(stage.lab.clock.now())
    assert slots["joint"] is not joint
    assert [record.getMessage() for record in caplog.records if "not complete" in record.getMessage()] == []
    assert stage.mended() == []
    stage.lab.say('Global.removeSlot("joint");')
    assert stage.mended() == ["*** urbihw: put back in the library: Global.joint"]


@pytest.mark.parametrize(("platform", "switch_on"), [("p3dx", "P3dx.body.load = 1|;"), ("segway", ""), ("nxt", "")])
def test_a_new_connection_does_not_disturb_a_movement(platform: str, switch_on: str) -> None:
    stage = Stage(platform)
    lab = stage.lab
    lab.say(switch_on, 1.0)
    lab.say('at (robot.aborted?) echo("aborted"); robot.go(2.4);')
    lab.run(1.0)
    assert lab.look("robot.mobility.motion.isNil") == "false"
    assert stage.mended() == []
    assert lab.look("robot.mobility.motion.isNil") == "false"


def test_compact_names_are_made_by_any_program(stage: Stage) -> None:
    lab = stage.lab
    said = lab.say(
        "robot.makeCompactNames; robot.addComponent(\"hat\");"
        " robot.hat.addDevice(\"feather\", Object.new.addProto(Interface.Motor));"
        " robot.makeCompactNames; feather === robot.hat.feather;"
    )
    assert said == "true"
    assert stage.mended() == []
    assert lab.say("System.resetLibrary; feather === robot.hat.feather;") == "[]\ntrue"


def test_compact_names_of_another_tree_do_not_become_the_librarys() -> None:
    stage = Stage("bioloid")
    stage.lab.say(
        "var r = Component.new(\"robot\")|; r.addComponent(\"body\"); r.body.addComponent(Localizer.new(\"joint\"));"
        " r.body.joint.set(0, Object.new.addProto(Interface.Motor))|; r.makeCompactNames;"
    )
    assert stage.mended() == ["*** urbihw: changed in the library: Global.joint; System.resetLibrary brings it back"]
