"""CallMessage: how a function was called, with its unevaluated arguments."""

from __future__ import annotations

from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.plain import float_text
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import Lazy, List
from urbihw.kernel.runtime.world import World
from urbihw.kernel.stdlib.object import send_lazies

TABLE = Table("CallMessage")

NOTES = {
    "CallMessage.args": "The arguments, as a List of Lazies.",
    "CallMessage.code": "The function that was called.",
    "CallMessage.message": "The name by which it was called.",
    "CallMessage.sender": "Who called: this where the call is written.",
    "CallMessage.target": "On what it was called.",
}
"""What no docstring can say: of classes, and of slots that are values or fields."""


def _args(world: World, this: Any) -> list[Any]:
    args = world.get_slot(this, "args")
    if not isinstance(args, List):
        raise world.type_error(None, args, "List")
    return args.l


@TABLE.primitive("argsCount")
def args_count(world: World, this: Any) -> int:
    """The number of arguments, which are not evaluated."""
    return len(_args(world, this))


@TABLE.primitive("evalArgAt")
def eval_arg_at(world: World, this: Any, index: float) -> Any:
    """Evaluate an argument, counted from 0, each time anew; raises ``invalid index``."""
    args = _args(world, this)
    if not index.is_integer() or not 0 <= index < len(args):
        raise errors.primitive(f"invalid index: {float_text(index)}", "evalArgAt")
    return world.send(args[int(index)], "eval")


@TABLE.primitive("evalArgs")
def eval_args(world: World, this: Any) -> Any:
    """Evaluate all arguments; the list of their values."""
    return world.new_list([world.send(lazy, "eval") for lazy in _args(world, this)])


@TABLE.primitive("eval")
def eval_(world: World, this: Any) -> Any:
    """Make the call and give its value."""
    target = world.get_slot(this, "target")
    name = world.text(world.get_slot(this, "message"))
    sender = world.get_slot(this, "sender") if world.as_obj(this).find("sender") is not None else target
    lazies = [lazy if isinstance(lazy, Lazy) else world.evaluated(lazy) for lazy in _args(world, this)]
    return send_lazies(world, target, name, sender, lazies)


