"""Float: loops over integers, minimum, maximum, and random numbers."""

from __future__ import annotations

import itertools
import random as python_random
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.plain import float_text
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib import members, prototype
from urbihw.kernel.stdlib.float import whole
from urbihw.kernel.stdlib.slices import calls, in_slices
from urbihw.kernel.stdlib.support import native
from urbihw.kernel.value import Value

__breakable__ = True
__calls__ = {"each_pipe": ("f",), "times": ("f",), "map_": ("f", "each|")}

TABLE = Table("Float")

NOTES = {
    "Float.fresh": "A number that was not returned before.",
    "Float.random": "A random integer from 0 up to, but not including, this number.  Raises BadInteger.",
    "Float.srandom": "Initialize the random number generator with this number.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


@TABLE.primitive("seq", "asList")
def seq(world: World, this: float) -> Value:
    """The list of the integers from 0 up to, but not including, this number.  Raises BadInteger."""
    return world.new_list([float(index) for index in in_slices(world, _range(world, this))])


def _range(world: World, this: float) -> range:
    number = whole(world, this)
    if number > members.MAX_GENERATED_MEMBERS:
        message = f"expected at most {members.MAX_GENERATED_MEMBERS:.0f}, got {float_text(this)}"
        raise errors.bad_number("BadInteger", message, this, "seq")
    return range(number)


@TABLE.primitive("each")
def each(world: World, this: float, function: Value) -> None:
    """Call the function with each integer from 0 up to, but not including, this number; other jobs may run in between.
    Raises BadInteger.
    """
    members.each(world, this, world.iterate(this), function)


@TABLE.primitive("each|")
def each_pipe(world: World, this: float, function: Value) -> None:
    """Call the function with each integer from 0 up to, but not including, this number, without a turn for other jobs.
    Raises BadInteger.
    """
    for index in world.iterate(this):
        world.invoke(function, this, (index,))


@TABLE.primitive("each&")
def each_and(world: World, this: float, function: Value) -> None:
    """Call the function with all integers from 0 up to, but not including, this number, in parallel.  Raises
    BadInteger.
    """
    members.each_apart(world, this, calls(world, [*world.iterate(this)]), function)


@TABLE.primitive("times")
def times(world: World, this: float, function: Value) -> None:
    """Call the function this number of times; other jobs may run in between.  Raises BadInteger."""
    scheduler = world.scheduler
    for index in range(whole(world, this)):
        if index and scheduler.ready:
            scheduler.yield_()
        world.invoke(function, this)


@TABLE.primitive("map")
def map_(world: World, this: float, function: Value) -> Value:
    """The list of the function's results for each integer from 0 up to, but not including, this number.  Raises
    BadInteger.
    """
    indexes = calls(world, _range(world, this))
    return world.new_list([world.invoke(function, this, (float(index),)) for index in indexes])


@TABLE.primitive("max")
def max_(world: World, this: Value, *others: Value) -> Value:
    """The maximum of this value and the arguments: ``[this, ...].max``."""
    return world.send(world.new_list([this, *others]), "max")


@TABLE.primitive("min")
def min_(world: World, this: Value, *others: Value) -> Value:
    """The minimum of this value and the arguments: ``[this, ...].min``."""
    return world.send(world.new_list([this, *others]), "min")


def install(world: World, programs: Any) -> None:
    """Install ``fresh``, ``random`` and ``srandom``, which have internal state."""
    fresh = itertools.count(1)
    generator = python_random.Random()

    def draw(this: Value) -> float:
        limit = world.as_float(this, None, "random")
        if not limit.is_integer() or limit <= 0:
            message = f"expected positive integer, got {float_text(limit)}"
            raise errors.bad_number("BadInteger", message, limit, "random")
        return float(generator.randrange(int(limit)))

    def seed(this: Value) -> Value:
        generator.seed(world.as_float(this, None, "srandom"))
        return world.void

    slots = prototype(world, "Float").slots
    slots["fresh"] = native(world, "fresh", lambda this: float(next(fresh)), 0)
    slots["random"] = native(world, "random", draw, 0)
    slots["srandom"] = native(world, "srandom", seed, 0)
