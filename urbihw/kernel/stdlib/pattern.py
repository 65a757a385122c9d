"""Pattern: structural matching as an object.  (Patterns in a program's text are compiled and do not use it.)"""

from __future__ import annotations

from typing import Any

from urbihw.kernel.runtime.matching import decides
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import Dictionary
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

PATTERN = Table("Pattern")
BINDING = Table("Pattern.Binding")
TABLES = (PATTERN, BINDING)

NOTES = {
    "Pattern.Binding": "Matches any value and stores it under a name.",
    "Pattern.pattern": "The value with which values are compared.",
    "Pattern.bindings": "A Dictionary, filled by a match: name of a Binding -> matched value.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


@PATTERN.primitive("init")
def init(world: World, this: Obj, pattern: Any) -> None:
    """Make a pattern: any value; the Bindings in it match any part."""
    this.slots["pattern"] = pattern
    this.slots["bindings"] = world.dictionary({})


@PATTERN.primitive("match")
def match(world: World, this: Obj, value: Value) -> bool:
    """Whether a value matches; if so, ``bindings`` holds the parts matched by the Bindings."""
    this.slots["bindings"] = world.dictionary({})
    return bool(match_pattern(world, this, world.get_slot(this, "pattern"), value))


@PATTERN.primitive("matchPattern")
def match_pattern(world: World, this: Obj, pattern: Any, value: Value) -> bool:
    """Match a part: by ``pattern.match(this, value)``, else ``value.matchAgainst(this, pattern)``, where these take two
    arguments, else ``==``."""
    if decides(world, pattern, "match"):
        return bool(world.send(pattern, "match", this, value))
    if decides(world, value, "matchAgainst"):
        return bool(world.send(value, "matchAgainst", this, pattern))
    return bool(world.ops.equal(pattern, value))


@BINDING.primitive("init")
def init_binding(world: World, this: Obj, name: Value) -> None:
    """Make a Binding, which matches any value and stores it under a name."""
    this.slots["name"] = name


@BINDING.primitive("match")
def match_binding(world: World, this: Obj, handler: Obj, value: Value) -> bool:
    """Store the value in the bindings of the handler."""
    bindings = world.get_slot(handler, "bindings")
    if not isinstance(bindings, Dictionary):
        raise world.type_error(None, bindings, "Dictionary")
    bindings.d[world.text(world.get_slot(this, "name"))] = value
    bindings.touch()
    return True


@BINDING.primitive("asString")
def binding_string(world: World, this: Obj) -> str:
    """``var name``."""
    return f"var {world.text(this.slots['name'])}" if "name" in this.slots else "Binding"
