"""Shared helpers of the verbs (modules ``ops`` and ``ops_*``)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Executable, Getter
from urbihw.kernel.runtime.values import Lazy
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


def call_unevaluated(
    world: World, value: Value, target: Value, sender: Value, name: str, args: list[Lazy]
) -> Value:
    """Call ``value`` with unevaluated arguments: a strict function evaluates them now, a lazy one gets a call message.

    Raises unexpected void for a strict argument without a value, and what the arguments and the function raise.
    """
    if not isinstance(value, Executable):
        value = Getter(world, value)
    if value.strict:
        given = tuple([argument.force() for argument in args])
        if world.void in given:
            raise errors.unexpected_void()
        return value.call(target, given)
    return value.call_lazy(world.lazy_message(value, target, name, sender, args))


def locals_of(*functions: Callable[..., Any]) -> dict[str, Any]:
    """Functions by their names."""
    return {function.__name__: function for function in functions}
