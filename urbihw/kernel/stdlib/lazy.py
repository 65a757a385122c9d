"""Lazy: a value that is computed on demand."""

from __future__ import annotations

from urbihw.kernel.compiler import print_node
from urbihw.kernel.runtime.code import Code
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import Lazy
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.executable import body_text
from urbihw.kernel.value import Value

TABLE = Table("Lazy")
PROTOS = {"Lazy": ("Comparable",), "PseudoLazy": ("Object",)}

NOTES = {
    "PseudoLazy": "Named in the manual without slots; programs use Lazy.",
    "Lazy": "A value that is computed at its first use.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


@TABLE.primitive("new")
def new(world: World, this: Value, function: Value) -> Value:
    """Make a value that a function without arguments computes on demand."""
    made = Lazy(world, lambda: world.void, code=function)
    made.thunk = lambda: world.invoke(function, made, (), "eval")
    made.protos = [this]
    return made


@TABLE.primitive("eval")
def eval_(world: World, this: Lazy) -> Value:
    """Compute the value, at each call anew."""
    world.recorder.boxes(this.thunk)
    this.cached = this.thunk()
    return this.cached


@TABLE.primitive("value")
def value(world: World, this: Lazy) -> Value:
    """The value, computed at most once."""
    return eval_(world, this) if this.cached is None else this.cached


@TABLE.primitive("==")
def equal(world: World, this: Value, that: Value) -> bool:
    """Whether both have the same source, and the same value or no value yet."""
    if this is that or not (isinstance(this, Lazy) and isinstance(that, Lazy)):
        return this is that
    if (this.cached is None) != (that.cached is None):
        return False
    if _source(world, this) != _source(world, that):
        return False
    return this.cached is None or bool(world.ops.equal(this.cached, that.cached))


@TABLE.primitive("asString")
def as_string(world: World, this: Value) -> str:
    """The source of the expression."""
    return _source(world, this) if isinstance(this, Lazy) else "Lazy"


def _source(world: World, lazy: Lazy) -> str:
    if isinstance(lazy.code, Code):
        return body_text(lazy.code)
    if lazy.node is not None:
        inner = getattr(lazy.node, "body", None) if type(lazy.node).__name__ == "Scope" else lazy.node
        return "" if inner is None else print_node(inner)
    return world.printable(lazy.force())
