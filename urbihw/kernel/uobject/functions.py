"""Device methods as urbiscript functions: arguments are checked and converted, results are converted back."""

from __future__ import annotations

import functools
import inspect
import logging
from collections.abc import Callable, Collection, Hashable
from typing import TYPE_CHECKING, Any, NamedTuple

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import Primitive, make_primitive
from urbihw.kernel.uobject.convert import converter, hints_of
from urbihw.kernel.uobject.part import DevicePart, parts_of
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.threads import Lock
from urbihw.kernel.uobject.uvalue import to_urbi

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World
    from urbihw.kernel.uobject.uobject import UObject

log = logging.getLogger("urbihw.uobject")

Method = Callable[..., Any]


class BoundFunction(NamedTuple):
    """A method that is a function of a device.

    Attributes:
        method: as the class has it, without an instance.
        python: its name in Python.
        part: the part of the device that has it; None for the device itself.
    """

    method: Method
    python: str
    part: type[DevicePart] | None = None

    def of(self, device: UObject) -> Method:
        """The method of an instance."""
        found: Method = getattr(device if self.part is None else device.part(self.part), self.python)
        return found


def bound_functions(kind: type[UObject]) -> dict[str, BoundFunction]:
    """The bound methods of a class and its parts by their urbiscript names; ``init`` is always bound."""
    found = {"init": BoundFunction(kind.init, "init")}
    for part in (*parts_of(kind), None):
        for python, value in inspect.getmembers(part or kind, inspect.isfunction):
            urbi = getattr(value, "__urbi_name__", None)
            if urbi is not None:
                found[urbi] = BoundFunction(value, python, part)
    return found


def arity(method: Method) -> tuple[int, int]:
    """The minimum and the maximum number of arguments of a bound method or function; -1 stands for no limit."""
    return _arity_of(inspect.signature(method).parameters.values())


def _arity_of(parameters: Collection[inspect.Parameter]) -> tuple[int, int]:
    places = [one for one in parameters if one.kind in (one.POSITIONAL_ONLY, one.POSITIONAL_OR_KEYWORD)]
    least = sum(1 for one in places if one.default is one.empty)
    variadic = any(one.kind is one.VAR_POSITIONAL for one in parameters)
    return least, -1 if variadic else len(places)


def class_function(world: World, urbi: str, bound: BoundFunction) -> Primitive:
    """The function in a slot of a prototype: it calls the method of the instance that is its target.

    ``init`` may take any arguments although its base takes none, so only named parameters count.
    """
    inner: Method = functools.partial(bound.method, None)

    def find(this: Any) -> Method:
        instance = getattr(this, "python", None)
        if instance is None:
            raise errors.primitive("this is a class: make an instance with new")
        return bound.of(instance)

    return _function(world, urbi, inner, find, getattr(bound.method, "__urbi_lock__", None))


def instance_function(world: World, urbi: str, method: Method, lock: Lock | None) -> Primitive:
    """The function in a slot of one instance."""
    return _function(world, urbi, method, lambda this: method, lock)


def _function(
    world: World, urbi: str, method: Method, find: Callable[[Any], Method], lock: Lock | None
) -> Primitive:
    registry = registry_of(world)
    hints = hints_of(method)
    parameters = list(inspect.signature(method).parameters.values())
    least, most = _arity_of(parameters)
    convert = [converter(world, hints.get(one.name, inspect.Parameter.empty)) for one in parameters]

    def run(this: Any, *args: Any) -> Any:
        call = find(this)
        given = [convert[min(index, len(convert) - 1)](value, index + 1) for index, value in enumerate(args)]

        def work() -> Any:
            if lock is None:
                return call(*given)
            return registry.threads.run(lambda: call(*given), _key(lock, this, urbi))

        try:
            if registry.stats.enabled:
                return to_urbi(world, registry.stats.timed(f"{registry.class_name(this)}.{urbi}", work))
            return to_urbi(world, work())
        except errors.ThrownError:
            raise
        except ValueError as refusal:
            raise errors.primitive(str(refusal)) from refusal
        except Exception as error:
            log.error("%s of %s failed: %s: %s", urbi, registry.class_name(this), type(error).__name__, error)
            log.debug("its traceback", exc_info=error)
            raise errors.primitive(f"{type(error).__name__}: {error}") from error

    run.__urbi_method__ = method  # type: ignore[attr-defined]  # which tells the names of its arguments
    return make_primitive(world, urbi, run, least, most)


def _key(lock: Lock, this: Any, urbi: str) -> Hashable:
    """The key of calls that must not run at the same time; None if there is no such restriction."""
    if lock is Lock.NONE:
        return None
    if lock is Lock.FUNCTION:
        return (lock, id(this), urbi)
    if lock is Lock.INSTANCE:
        return (lock, id(this))
    kind = type(this.python)
    return (lock, kind) if lock is Lock.CLASS else (lock, kind.__module__)
