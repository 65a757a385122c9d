"""The verbs: the functions that generated code calls by name.  They are the whole contract between compiler and
runtime.

``make_ops`` returns the dict that replaces Python's builtins in generated code, so that this code has access to nothing
else.  Values are urbiscript values; a thunk is a Python function without parameters.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

from urbihw.kernel import errors
from urbihw.kernel.runtime import matching
from urbihw.kernel.runtime.backtrace import LINE_MAP
from urbihw.kernel.runtime.code import MISSING, Executable, Getter, LazyPrimitive, make_code
from urbihw.kernel.runtime.conditions import Conditions
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.ops_assert import assertion_verbs
from urbihw.kernel.runtime.ops_jobs import tag_verbs, time_verbs
from urbihw.kernel.runtime.ops_slots import slot_verbs, update_verbs
from urbihw.kernel.runtime.slots import LOGICAL
from urbihw.kernel.runtime.values import Dictionary, Lazy
from urbihw.kernel.runtime.verbs import call_unevaluated, locals_of
from urbihw.kernel.runtime.watch import Box, mark_straight
from urbihw.kernel.sched.group import Group
from urbihw.kernel.sched.signals import UNWINDING, JobAborted, Leave, StopTag, supersedes
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


CONDITION_VERBS = (
    *("at_expr", "at_event", "at_sync_expr", "at_sync_event"),
    *("whenever_expr", "whenever_event", "wait_expr", "wait_event", "emit"),
)
"""The verbs of ``Conditions`` that generated code calls."""


RunLate = Callable[[Any, Any, Any], Any]
"""Takes a node, ``this`` and the visible local variables, and returns the value of the node."""
DeclareExternal = Callable[["World", str, str, float | None, str | None], Any]
"""Takes kind, path, number of arguments and source of ``external kind (arity) path from source``."""


def make_ops(world: World, run_late: RunLate, declare_external: DeclareExternal) -> dict[str, Any]:
    """The verbs of one world.

    ``run_late`` evaluates a node of the syntax with the local variables of a waiting frame; ``declare_external`` makes
    the local object for a function or variable of another process.
    """
    names = _constants(world)
    names.update(_calls(world, run_late, declare_external))
    for part in (_values, _flow, slot_verbs, update_verbs, tag_verbs, time_verbs, assertion_verbs):
        names.update(part(world))
    conditions = Conditions(world)
    for verb in CONDITION_VERBS:
        names[verb] = getattr(conditions, verb)
    return names


def _constants(world: World) -> dict[str, Any]:
    """Values, classes and bound methods that generated code uses as they are."""
    scheduler = world.scheduler
    return {
        "VOID": world.void,
        "NIL": world.nil,
        "TRUE": world.true,
        "FALSE": world.false,
        "ZERO": 0.0,
        "ONCE": (None,),
        "MISSING": MISSING,
        "bool": bool,
        "Exception": Exception,
        "Leave": Leave,
        "StopTag": StopTag,
        "BaseException": BaseException,
        "ENDINGS": UNWINDING,
        "JobAborted": JobAborted,
        "Box": Box,
        "straight": mark_straight,
        "Event": Event,
        "token": object,
        "ready": scheduler.ready,
        "yield_": scheduler.yield_,
        "group": lambda: Group(scheduler),
        "nothing": lambda: world.void,
        "new_list": world.new_list,
        "new_tuple": world.new_tuple,
        "new_string": world.string,
        "send0": world.ops.send0,
        "own_send0": world.ops.own_send0,
        "method": world.ops.method,
        "own_method": world.ops.own_method,
        "update": world.update_slot,
        "equal": world.ops.equal,
        "unequal": world.ops.unequal,
        "push": world.ops.push,
        "remainder": world.ops.remainder,
    }


def _values(world: World) -> dict[str, Any]:
    def new_dictionary(flat: list[Value]) -> Dictionary:
        """A Dictionary from alternating keys and values."""
        content: dict[str, Any] = {}
        for key, value in zip(flat[::2], flat[1::2], strict=True):
            content[world.key(key)] = value
        return world.dictionary(content)

    def no_void() -> None:
        """Raise the error for void where a value is needed."""
        raise errors.unexpected_void()

    def function(fn: Callable[..., Any], info: Any) -> Obj:
        """The value of a function literal."""
        return make_code(world, fn, info)

    def new_class(name: str, protos: list[Value]) -> Obj:
        """The object that ``class name : protos`` makes, before its body runs."""
        return world.new_class(name, protos)

    def iterate(items: Value) -> Iterable[Any]:
        """The members that a for-each visits: a snapshot."""
        return world.iterate(items)

    def times(items: Value) -> Iterable[Any]:
        """The iterations of ``for (n)``; the values are not used."""
        if items.__class__ is float and items >= 0 and items == int(items):
            return range(int(items))
        return world.iterate(items)

    return locals_of(new_dictionary, no_void, function, new_class, iterate, times)


def _calls(world: World, run_late: RunLate, declare_external: DeclareExternal) -> dict[str, Any]:
    def callee(value: Value) -> Executable:
        """The value of a local variable as an executable."""
        return value if isinstance(value, Executable) else Getter(world, value)

    def lazies(thunks: list[Callable[[], Any]], nodes: Sequence[Any]) -> list[Lazy]:
        return [Lazy(world, thunk, nodes, index) for index, thunk in enumerate(thunks)]

    def lazy_send(
        target: Value, sender: Value, name: str, thunks: list[Callable[[], Any]], nodes: Sequence[Any]
    ) -> Value:
        """A message whose name may belong to a lazy function."""
        return call_unevaluated(world, world.ops.method(target, name), target, sender, name, lazies(thunks, nodes))

    def is_built_in(target: Value, name: str) -> bool:
        """Whether ``&&`` or ``||`` of a target is that of the library, which generated code computes itself."""
        return world.ops.method(target, name).__class__ is LazyPrimitive

    def lazy_send0(target: Value, sender: Value, name: str) -> Value:
        """The same without arguments."""
        value: Any = world.ops.method(target, name)
        return value.c0(target) if value.strict else call_unevaluated(world, value, target, sender, name, [])

    def lazy_call(
        value: Any, target: Value, sender: Value, name: str, thunks: list[Callable[[], Any]], nodes: Sequence[Any]
    ) -> Value:
        """Call a function that may be lazy."""
        if not value.strict:
            return call_unevaluated(world, value, target, sender, name, lazies(thunks, nodes))
        given = [thunk() for thunk in thunks]
        if world.void in given:
            raise errors.unexpected_void()
        return value.call(target, tuple(given))

    def lazy_site(value: Value, target: Value, sender: Value, name: str, site: int) -> Value:
        """A call that was compiled as strict and whose function is lazy: the arguments use the waiting Python frame."""
        frame = sys._getframe(1)
        place = frame.f_globals[LINE_MAP]
        sites = place.syntax.late
        thunks = sites.thunks(site, frame, place, sender, run_late)
        if name not in LOGICAL:
            world.lazy_names.add(name)
        return call_unevaluated(world, value, target, sender, name, lazies(thunks, sites.arguments(site)))

    def external(kind: str, path: str, arity: float | None, source: str | None) -> Any:
        """``external kind (arity) path from source``."""
        return declare_external(world, kind, path, arity, source)

    return locals_of(callee, lazy_send, lazy_send0, is_built_in, lazy_call, lazy_site, external)


def _flow(world: World) -> dict[str, Any]:
    def thrown(value: Value) -> BaseException:
        """The Python exception for ``throw value``."""
        if isinstance(value, Obj) and not world.record.is_shared(value):
            value.slots.pop("backtrace", None)
        return errors.ThrownError(value)

    def match(pattern: tuple[Any, ...], value: Value) -> list[Any] | None:
        """The values bound by a pattern, or None."""
        return matching.match(world, pattern, value)

    def match_payload(patterns: list[tuple[Any, ...]], payload: list[Value]) -> list[Any] | None:
        """The values bound by the patterns of an event."""
        return matching.match_payload(world, patterns, payload)

    def no_match() -> None:
        """Raise the error for a pattern that does not match."""
        raise errors.match_failure()

    def either(left: Value, right: Value) -> Any:
        """``left || right`` where left is an event."""
        return world.send(left, "||", right)

    def truth(value: Value) -> bool:
        """Whether a value counts as true."""
        return bool(value)

    def caught(error: BaseException) -> Any:
        """The value of a caught error.  For a program that catches its emergency stop, a new statement begins."""
        if isinstance(error, errors.MovementStopped):
            world.scheduler.running().renew()
        return world.caught(error)

    def outlasting(ending: BaseException, later: BaseException) -> BaseException:
        """The exception that goes on when a ``finally`` clause, run because of ``ending``, raises ``later``.

        If ``later`` is an error, it is reported like the error of a job.
        """
        if isinstance(later, Exception):
            scheduler = world.scheduler
            scheduler.hooks.job_failed(scheduler.running(), later)
        return later if supersedes(later, ending) else ending

    return locals_of(thrown, match, match_payload, no_match, either, truth, caught, outlasting)
