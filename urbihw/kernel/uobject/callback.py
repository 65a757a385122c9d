"""Callbacks of variables: a handler is adapted to the number and the type of its arguments."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from types import FunctionType
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from urbihw.kernel.uobject.convert import converter, hints_of
from urbihw.kernel.uobject.registry import registry_of

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Handler = Callable[..., Any]


@runtime_checkable
class ClientFunction(Protocol):
    """A handler that is a function of a client."""

    def __call__(self) -> None:
        """Call the function with the lobby of its client."""

    def tell(self, error: Exception, what: str) -> bool:
        """Report a failure to the client, and what became of it; whether there is such a client."""


class Callback:
    """One handler of one variable.  ``run(uvar)`` calls it, and measures the call while statistics are enabled."""

    __slots__ = ("__weakref__", "_owner", "_plain", "_stats", "handler", "name", "run")

    def __init__(self, world: World, handler: Handler, owner: bool = False) -> None:
        self.handler = handler
        self._owner = owner
        self.name = getattr(handler, "__qualname__", type(handler).__name__)
        self._stats = registry_of(world).stats
        self._plain = self._adapted(world, handler)
        self.run: Callable[[Any], Any] = self._plain
        self._stats.add_measured(self)

    def set_measuring(self, on: bool) -> None:
        """Switch the measurement of calls on or off."""
        self.run = (lambda var: self._stats.timed(self.name, lambda: self._plain(var))) if on else self._plain

    def _adapted(self, world: World, handler: Handler) -> Callable[[Any], Any]:
        takes = _first_parameter(handler)
        if takes is None:
            return lambda var: handler()
        wanted = hints_of(handler).get(takes, inspect.Parameter.empty)
        if wanted is inspect.Parameter.empty or getattr(wanted, "__name__", wanted) in ("UVar", "Any", "object"):
            return handler
        convert, owner = converter(world, wanted), self._owner
        return lambda var: handler(convert(var.current(owner), 1))

    def tell(self, error: Exception, what: str) -> bool:
        """Report a failure to the client that registered the handler.  Returns False if no client has."""
        return isinstance(self.handler, ClientFunction) and self.handler.tell(error, what)

    def is_(self, other: Callback | Handler) -> bool:
        """Whether ``other`` is this callback, or the handler of this callback."""
        return self is other or self.handler == other


def _first_parameter(handler: Handler) -> str | None:
    """The name of the first argument that a handler takes, None if it takes none."""
    function = getattr(handler, "__func__", handler)
    if isinstance(function, FunctionType) and not hasattr(function, "__wrapped__"):
        # `inspect.signature` says the same of a plain function, and took a sixth of the start of a robot.
        code = function.__code__
        names = code.co_varnames[function is not handler : code.co_argcount]
        if not names and code.co_flags & inspect.CO_VARARGS:
            return code.co_varnames[code.co_argcount + code.co_kwonlyargcount]
        return names[0] if names else None
    try:
        parameters = inspect.signature(handler).parameters.values()
    except (TypeError, ValueError):
        return None
    takes = [one.name for one in parameters if one.kind not in (one.VAR_KEYWORD, one.KEYWORD_ONLY)]
    return takes[0] if takes else None
