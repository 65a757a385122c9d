"""Float: counting, and what random numbers are made of."""

from __future__ import annotations

import itertools
import random as python_random
from collections.abc import Iterable
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.plain import float_text
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import members, prototype
from urbihw.kernel.stdlib.float import whole
from urbihw.kernel.stdlib.slices import calls, in_slices
from urbihw.kernel.stdlib.support import native

__breakable__ = True

TABLE = Table("Float")

NOTES = {
    "Float.fresh": "A number that was not given before.",
    "Float.random": "A random integer from 0 up to, not including, this one; raises BadInteger.",
    "Float.srandom": "Let the random numbers begin anew from this seed.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


@TABLE.primitive("seq", "asList")
def seq(world: World, this: float) -> Any:
    """The integers from 0 up to, not including, this one; raises BadInteger."""
    return world.new_list([float(index) for index in in_slices(world, _range(world, this))])


def _range(world: World, this: float) -> range:
    number = whole(world, this)
    if number > members.MANY:
        raise errors.Raised("BadInteger", f"expected at most {members.MANY:.0f}, got {float_text(this)}", "seq")
    return range(number)


def _below(world: World, this: float) -> Iterable[float]:
    return map(float, range(whole(world, this)))


@TABLE.primitive("each")
def each(world: World, this: float, function: Any) -> None:
    """Call the function on each integer from 0 up to this one; other jobs may run in between; raises BadInteger."""
    members.each(world, this, _below(world, this), function)


@TABLE.primitive("each|")
def each_pipe(world: World, this: float, function: Any) -> None:
    """Call the function on each integer from 0 up to this one, without a pause; raises BadInteger."""
    for index in _below(world, this):
        world.invoke(function, this, (index,))


@TABLE.primitive("each&")
def each_and(world: World, this: float, function: Any) -> None:
    """Call the function on all integers from 0 up to this one at once; raises BadInteger."""
    members.each_apart(world, this, map(float, calls(world, range(whole(world, this)))), function)


@TABLE.primitive("times")
def times(world: World, this: float, function: Any) -> None:
    """Call the function this many times; other jobs may run in between; raises BadInteger."""
    scheduler = world.scheduler
    for index in range(whole(world, this)):
        if index and scheduler.ready:
            scheduler.yield_()
        world.invoke(function, this)


@TABLE.primitive("map")
def map_(world: World, this: float, function: Any) -> Any:
    """What the function gives for each integer from 0 up to this one; raises BadInteger."""
    indexes = calls(world, _range(world, this))
    return world.new_list([world.invoke(function, this, (float(index),)) for index in indexes])


@TABLE.primitive("max")
def max_(world: World, this: Any, *others: Any) -> Any:
    """The greatest of this and the arguments."""
    return best(world, [this, *others], True)


@TABLE.primitive("min")
def min_(world: World, this: Any, *others: Any) -> Any:
    """The least of this and the arguments."""
    return best(world, [this, *others], False)


def best(world: World, values: list[Any], greatest: bool) -> Any:
    """The first value that no other one beats, by their own ``<``."""
    found = values[0]
    for value in values[1:]:
        first, second = (found, value) if greatest else (value, found)
        less = first < second if first.__class__ is second.__class__ is float else world.send(first, "<", second)
        if less:
            found = value
    return found


def install(world: World, programs: Any) -> None:
    """``fresh``, ``random`` and ``srandom``, which remember something."""
    fresh = itertools.count(1)
    generator = python_random.Random()

    def draw(this: Any) -> float:
        limit = world.as_float(this, None, "random")
        if not limit.is_integer() or limit <= 0:
            raise errors.Raised("BadInteger", f"expected positive integer, got {float_text(limit)}", "random")
        return float(generator.randrange(int(limit)))

    def seed(this: Any) -> Any:
        generator.seed(world.as_float(this, None, "srandom"))
        return world.void

    slots = prototype(world, "Float").slots
    slots["fresh"] = native(world, "fresh", lambda this: float(next(fresh)), 0)
    slots["random"] = native(world, "random", draw, 0)
    slots["srandom"] = native(world, "srandom", seed, 0)
