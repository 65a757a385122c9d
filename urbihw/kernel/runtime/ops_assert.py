"""The verbs of generated code for ``assert``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.values import Lazy
from urbihw.kernel.runtime.verbs import call_unevaluated, locals_of
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

OPPOSITE = {"==": "!=", "!=": "==", "<": ">=", ">=": "<", ">": "<=", "<=": ">", "===": "!==", "!==": "===",
            "~=": "!~=", "=~=": "!=~="}


def assertion_verbs(world: World) -> dict[str, Any]:
    """``assert``: whether claims are checked, and the claims that are calls or values."""

    def asserting() -> bool:
        """Whether assertions are checked."""
        return not world.ndebug

    def fail(text: str, detail: str) -> None:
        raise errors.Raised("Exception", f"failed assertion: {text}{detail}", None)

    def assert_value(text: str, value: Value, literal: bool) -> None:
        """Check a claim that is no call."""
        if not value:
            fail(text, "" if literal else f" ({text} == {world.printable(value)})")

    def assert_call(
        text: str,
        target: Value,
        shown: bool,
        name: str,
        function: Value,
        thunks: list[Callable[[], Any]],
        nodes: Sequence[Any],
    ) -> None:
        """Check a claim that is a call; the message of a failure shows the values of its target and arguments."""
        args = [Lazy(world, thunk, nodes, index) for index, thunk in enumerate(thunks)]
        for lazy in args:
            lazy.memoize()
        value = world.ops.method(target, name) if function is None else function
        result = call_unevaluated(world, value, target, target, name, args)
        if not result:
            fail(text, _call_detail(world, target, shown, name, args, result))

    return locals_of(asserting, assert_value, assert_call)


def _call_detail(world: World, target: Value, shown: bool, name: str, args: list[Lazy], result: Value) -> str:
    """The part of the message of a failed claim with the values of the target and the arguments, and the result."""
    values = [world.printable(arg.cached) if arg.cached is not None else "?" for arg in args]
    if shown and name in OPPOSITE and len(values) == 1:
        return f" ({world.printable(target)} {OPPOSITE[name]} {values[0]})"
    called = world.quoted_name(name) + (f"({', '.join(values)})" if values else "")
    if shown:
        called = f"{world.printable(target)}.{called}"
    return f" ({called} == {world.printable(result)})"
