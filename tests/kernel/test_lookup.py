"""Inherited slots are found where a plain depth-first search finds them, at a cost that does not grow with depth."""

from __future__ import annotations

import gc
import random
from typing import Any
from weakref import ref

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.lookup import NO_ANSWERS
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.record import lineage
from urbihw.kernel.runtime.spelling import MAX_LENGTH, nearest
from urbihw.kernel.runtime.world import World
from urbihw.kernel.sched.clock import SimClock

DEEP = 20_000
"""More prototypes than Python can recurse through."""


@pytest.fixture(scope="module")
def world() -> World:
    return Kernel(SimClock()).world


def holder_by_search(world: World, target: Obj, name: str) -> Obj | None:
    """What a search that remembers nothing finds."""
    return next((obj for obj in lineage(world, target) if name in obj.slots), None)


def chain(obj: Obj, length: int) -> Obj:
    for _ in range(length):
        obj = obj.clone()
    return obj


class CountingDict(dict[str, Any]):
    """Slots that count how often they are asked for a name."""

    asked = 0

    def __contains__(self, name: object) -> bool:
        CountingDict.asked += 1
        return super().__contains__(name)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_remembered_is_what_a_search_finds(world: World, seed: int) -> None:
    chance = random.Random(seed)
    objects = [world.object.clone() for _ in range(3)]
    for number in range(400):
        kind = chance.randrange(6)
        target = chance.choice(objects)
        name = chance.choice("abcd")
        if kind == 0:
            made = target.clone()
            if chance.random() < 0.4:  # prototypes are older objects: no circles
                made.set_protos(chance.sample(objects, min(len(objects), chance.randint(1, 4))))
            objects.append(made)
        elif kind == 1:
            world.ops.put_slot(target, name, float(number))
        elif kind == 2:
            world.ops.remove_slot(target, name)
        elif kind == 3 and chance.random() < 0.3:
            older = objects[: objects.index(target)]
            if older:
                target.set_protos(chance.sample(older, min(len(older), chance.randint(1, 4))))
        for _ in range(5):
            asked, name = chance.choice(objects), chance.choice("abcd")
            expected = holder_by_search(world, asked, name)
            assert asked.find(name) is expected
            if expected is not None:
                assert world.ops.send0(asked, name) == expected.slots[name]
    assert not NO_ANSWERS


def test_prototypes_may_go_round_in_a_circle(world: World) -> None:
    first = world.object.clone()
    ring = chain(first, 5)
    first.set_protos([ring])
    assert ring.find("a") is None
    world.ops.put_slot(first, "a", 1.0)
    assert ring.find("a") is first
    first.set_protos([ring, world.object])
    assert ring.clone().find("clone") is world.object


def test_deep_chains(world: World) -> None:
    root = world.object.clone()
    deep = chain(root, DEEP)
    assert deep.find("missing") is None
    world.ops.put_slot(root, "missing", 1.0)
    assert deep.find("missing") is root
    world.ops.remove_slot(root, "missing")
    assert deep.find("missing") is None


def test_the_cost_does_not_grow_with_depth(world: World) -> None:
    """After one lookup, an object that derives from anywhere in the chain asks few others."""
    root = world.object.clone()
    world.ops.put_slot(root, "foo", 1.0)
    objects = [root]
    for _ in range(5_000):
        objects.append(objects[-1].clone())
    objects[-1].find("foo")
    for obj in objects:
        obj.slots = CountingDict(obj.slots)
    for obj in random.Random(1).sample(objects, 50):
        CountingDict.asked = 0
        assert obj.find("foo") is root
        assert CountingDict.asked < 40
    world.ops.put_slot(objects[2000], "other", 1.0)  # no answer for foo is forgotten
    CountingDict.asked = 0
    objects[-1].find("foo")
    assert CountingDict.asked < 40


def test_many_prototypes_are_searched_once(world: World) -> None:
    protos = [world.object.clone() for _ in range(2_000)]
    world.ops.put_slot(protos[-1], "foo", 1.0)
    wide = world.object.clone()
    wide.set_protos(protos)
    assert wide.find("foo") is protos[-1]
    for proto in protos:
        proto.slots = CountingDict(proto.slots)
    CountingDict.asked = 0
    assert wide.find("foo") is protos[-1]
    assert wide.find("missing") is wide.find("missing") is None
    assert CountingDict.asked < 3 * len(protos)


def test_nobody_is_kept_alive_by_having_been_looked_through(few_objects: None, world: World) -> None:
    parent = world.object.clone()
    gone = ref(parent)
    assert parent.clone().find("clone") is world.object
    del parent
    gc.collect()
    assert gone() is None


def test_a_number_as_prototype_may_get_slots_later(world: World) -> None:
    number = 5.0 + 0.0
    heir = world.object.clone()
    heir.set_protos([number])
    child = heir.clone()
    assert child.find("foo") is None
    world.set_slot(number, "foo", 1.0)
    assert world.ops.send0(child, "foo") == 1.0


def test_long_names_have_no_suggestion_since_to_compare_them_takes_seconds() -> None:
    name = "x" * MAX_LENGTH
    assert nearest(name, [name[:-1] + "y"]) == name[:-1] + "y"
    assert nearest(name + "x", [name + "y"]) == ""
    assert nearest("y" * 100_000, ["x" * 100_000]) == ""


@pytest.mark.parametrize("hook", ["updateSlot", "setSlot", "createSlot"])
def test_objects_with_hooks_slow_no_assignment_to_the_others(hook: str, monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = Kernel(SimClock())
    lobby = kernel.open_lobby("127.0.0.1")
    slow: list[str] = []
    other = kernel.world.ops.update_other

    def counted(target: Any, name: str, value: Any) -> Any:
        slow.append(name)
        return other(target, name, value)

    monkeypatch.setattr(kernel.world.ops, "update_other", counted)
    kernel.run_text(lobby, f"class Hooked {{ var a = 1; function {hook}(name, value = 0) {{ 7 }} }}|;"
                           "class Free { var a = 1 }|; var free = Free.new|; free.a = 2|; slow|;")
    slow.clear()
    answered = kernel.run_text(lobby, "for| (5) free.a = 3; Free.new.a = 4; Hooked.a = 5;")
    assert slow == (["a"] if hook == "updateSlot" else [])
    assert answered.split()[-1] == ("7" if hook == "updateSlot" else "5")
