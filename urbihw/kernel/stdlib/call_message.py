"""CallMessage: a function call with its unevaluated arguments."""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.plain import float_text
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import Lazy, List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.object import send_lazies
from urbihw.kernel.value import Value

TABLE = Table("CallMessage")

NOTES = {
    "CallMessage.args": "The arguments, as a List of Lazies.",
    "CallMessage.code": "The function that was called.",
    "CallMessage.message": "The name under which the function was called.",
    "CallMessage.sender": "The calling object: the value of this at the call.",
    "CallMessage.target": "The object on which the function was called.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


def _args(world: World, this: Value) -> list[Any]:
    args = world.get_slot(this, "args")
    if not isinstance(args, List):
        raise world.type_error(None, args, "List")
    return args.l


@TABLE.primitive("argsCount")
def args_count(world: World, this: Value) -> int:
    """The number of arguments, without evaluating them."""
    return len(_args(world, this))


@TABLE.primitive("evalArgAt")
def eval_arg_at(world: World, this: Value, index: float) -> Value:
    """Evaluate the argument at an index, counted from 0, at each call anew.  Raises ``invalid index``."""
    args = _args(world, this)
    if not index.is_integer() or not 0 <= index < len(args):
        raise errors.primitive(f"invalid index: {float_text(index)}", "evalArgAt")
    return world.send(args[int(index)], "eval")


@TABLE.primitive("evalArgs")
def eval_args(world: World, this: Value) -> Value:
    """Evaluate all arguments; returns the list of their values."""
    return world.new_list([world.send(lazy, "eval") for lazy in _args(world, this)])


@TABLE.primitive("eval")
def eval_(world: World, this: Value) -> Value:
    """Make the call and return its value."""
    target = world.get_slot(this, "target")
    name = world.text(world.get_slot(this, "message"))
    sender = world.get_slot(this, "sender") if world.as_obj(this).find("sender") is not None else target
    lazies = [lazy if isinstance(lazy, Lazy) else world.evaluated(lazy) for lazy in _args(world, this)]
    return send_lazies(world, target, name, sender, lazies)


