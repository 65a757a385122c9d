"""The verbs that generated code calls by name: the compiler's whole contract with the runtime.

``make_ops(world)`` is the dict that stands in the place of Python's builtins in generated code, so that such code
reaches nothing else.  Values are urbiscript values; a thunk is a Python function without parameters.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from operator import add, mul, sub, truediv
from typing import TYPE_CHECKING, Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime import matching
from urbihw.kernel.runtime.backtrace import LINE_MAP, failed_in_code
from urbihw.kernel.runtime.blend import place
from urbihw.kernel.runtime.code import MISSING, Executable, Getter, make_code
from urbihw.kernel.runtime.conditions import Conditions
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.runtime.passage import (
    ConditionPassage,
    EventPassage,
    LoopPassage,
    ScopeTag,
    TagObject,
    TimeoutPassage,
)
from urbihw.kernel.runtime.slot import meta_of
from urbihw.kernel.runtime.slots import LOGICAL
from urbihw.kernel.runtime.trajectory import Trajectory
from urbihw.kernel.runtime.values import Dictionary, Lazy, String
from urbihw.kernel.runtime.watch import Box
from urbihw.kernel.sched.group import Group
from urbihw.kernel.sched.signals import UNWINDING, JobAborted, Leave, StopTag, supersedes
from urbihw.kernel.sched.tag import Tag

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


def _counted_given() -> int:
    def count(given: Any) -> int:
        return sys.getrefcount(given)

    held = Box(None)
    return count(held)


ALONE_GIVEN: Final = _counted_given()
"""The references to a value given to a verb when one local variable holds it: fewer there cannot be."""


INDEXING = frozenset(("[]", "[]="))
"""Names that stay strict where a lazy function answers to one: indexing a list must not pay for it ever after."""

ARITHMETIC: Final[dict[str, Callable[[float, float], float]]] = {
    "+=": add,
    "-=": sub,
    "*=": mul,
    "/=": truediv,
}


def make_ops(world: World) -> dict[str, Any]:
    """All verbs of one world."""
    scheduler = world.scheduler
    names: dict[str, Any] = {
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
        "method": world.ops.method,
        "update": world.update_slot,
        "equal": world.ops.equal,
        "unequal": world.ops.unequal,
        "push": world.ops.push,
    }
    for part in (_values, _calls, _slots, _flow, _concurrency, _assertions):
        names.update(part(world))
    conditions = Conditions(world)
    for verb in ("at_expr", "at_event", "whenever_expr", "whenever_event", "wait_expr", "wait_event", "emit"):
        names[verb] = getattr(conditions, verb)
    return names


def _values(world: World) -> dict[str, Any]:
    def new_dictionary(flat: list[Any]) -> Dictionary:
        """A Dictionary from keys and values in turn."""
        content: dict[str, Any] = {}
        for key, value in zip(flat[::2], flat[1::2], strict=True):
            content[world.key(key)] = value
        return world.dictionary(content)

    def no_void() -> None:
        """A value was needed where there was none."""
        raise errors.unexpected_void()

    def function(fn: Callable[..., Any], info: Any) -> Obj:
        """A function literal."""
        return make_code(world, fn, info)

    def new_class(name: str, protos: list[Any]) -> Obj:
        """The object that ``class name : protos`` makes, before its body runs."""
        return world.new_class(name, protos)

    def iterate(items: Any) -> Iterable[Any]:
        """What a for-each goes through: a snapshot of the members."""
        return world.iterate(items)

    def times(items: Any) -> Iterable[Any]:
        """What ``for (n)`` goes through; the values do not matter."""
        if items.__class__ is float and items >= 0 and items == int(items):
            return range(int(items))
        return world.iterate(items)

    return locals_of(new_dictionary, no_void, function, new_class, iterate, times)


def _calls(world: World) -> dict[str, Any]:
    def callee(value: Any) -> Executable:
        """What a local variable holds, as something that can be called."""
        return value if isinstance(value, Executable) else Getter(world, value)

    def lazies(thunks: list[Callable[[], Any]], nodes: tuple[Any, ...]) -> list[Lazy]:
        return [Lazy(world, thunk, node) for thunk, node in zip(thunks, nodes, strict=True)]

    def run(value: Any, target: Any, sender: Any, name: str, args: list[Lazy]) -> Any:
        if not isinstance(value, Executable):
            value = Getter(world, value)
        if value.strict:
            given = tuple([argument.force() for argument in args])
            if world.void in given:
                raise errors.unexpected_void()
            return value.call(target, given)
        return value.call_lazy(world.lazy_message(value, target, name, sender, args))

    def lazy_send(
        target: Any, sender: Any, name: str, thunks: list[Callable[[], Any]], nodes: tuple[Any, ...]
    ) -> Any:
        """A message by a name that may mean a lazy function."""
        return run(world.ops.method(target, name), target, sender, name, lazies(thunks, nodes))

    def lazy_value(
        value: Any, target: Any, name: str, thunks: list[Callable[[], Any]], nodes: tuple[Any, ...]
    ) -> Any:
        """Call a local variable that may hold a lazy function."""
        return run(value, target, target, name, lazies(thunks, nodes))

    def lazy_site(value: Any, target: Any, sender: Any, name: str, site: int) -> Any:
        """A call compiled as strict whose function is lazy: make its arguments from the waiting Python frame."""
        frame = sys._getframe(1)
        place = frame.f_globals[LINE_MAP]
        sites = place.syntax.late
        thunks = sites.thunks(site, frame, place, sender, world.run_late)
        if name not in INDEXING and name not in LOGICAL:
            world.lazy_names.add(name)
        return run(value, target, sender, name, lazies(thunks, sites.arguments(site)))

    def external(kind: str, path: str, arity: float | None, source: str | None) -> Any:
        """``external kind (arity) path from source``."""
        return world.external(kind, path, arity, source)

    return locals_of(callee, lazy_send, lazy_value, lazy_site, external)


def _slots(world: World) -> dict[str, Any]:
    def declare(target: Any, name: str, value: Any) -> Any:
        """``var target.name = value``."""
        return world.set_slot(target, name, value)

    def declare_const(target: Any, name: str, value: Any) -> Any:
        """``const var target.name = value``."""
        world.set_slot(target, name, value)
        meta_of(world.as_obj(target), name).constant = True
        return value

    def constant() -> None:
        """A constant local is assigned."""
        raise errors.constness()

    def get_property(target: Any, slot: str, name: str) -> Any:
        """``target.slot->name``."""
        return world.send(target, "getProperty", world.string(slot), world.string(name))

    def set_property(target: Any, slot: str, name: str, value: Any) -> Any:
        """``target.slot->name = value``."""
        return world.send(target, "setProperty", world.string(slot), world.string(name), value)

    def get_item(target: Any, index: list[Any]) -> Any:
        """``target[index]``, read to be changed."""
        return send_named(target, "[]", *index)

    def set_item(target: Any, index: list[Any], value: Any) -> Any:
        """``target[index] = value``, where it was read to be changed."""
        return send_named(target, "[]=", *index, value)

    def send_named(target: Any, name: str, *args: Any) -> Any:
        """A message that the program does not spell out: a built-in that fails names it all the same."""
        try:
            return world.send(target, name, *args)
        except errors.Raised as error:
            if error.routine == "" and not failed_in_code(error):
                error.routine = name
            raise

    def in_place(old: Any, operator: str, value: Any) -> Any:
        """What ``old operator= value`` makes of ``old``."""
        if old.__class__ is float is value.__class__ and operator in ARITHMETIC and not world.generic_floats:
            return ARITHMETIC[operator](old, value)
        return world.send(old, operator, value)

    def join(left: Any, text: str) -> Any:
        """``left + "text"``, where nobody but the operator sees the literal."""
        if left.__class__ is String and left.protos is world.quick_strings:
            return String(world, left.protos, left.s + text)
        return left + world.string(text)

    def join_in_place(left: Any, text: str) -> Any:
        """``left += "text"``, for a local variable."""
        if left.__class__ is String and left.protos is world.quick_strings:
            if sys.getrefcount(left) == ALONE_GIVEN and not left.slots and left.meta is None:
                return left.grow(text)
            return String(world, left.protos, left.s + text)
        left += world.string(text)
        return left

    def step(old: Any, operator: str) -> Any:
        """The successor or predecessor of ``old``."""
        if old.__class__ is float and not world.generic_floats:
            return old + 1.0 if operator == "++" else old - 1.0
        return world.send(old, operator)

    return locals_of(
        *(declare, declare_const, constant, get_property, set_property, get_item, set_item),
        *(in_place, join, join_in_place, step),
    )


def _flow(world: World) -> dict[str, Any]:
    def thrown(value: Any) -> BaseException:
        """The Python exception for ``throw value``."""
        if isinstance(value, Obj) and not world.record.is_shared(value):
            value.slots.pop("backtrace", None)
        return errors.UrbiError(value)

    def match(pattern: tuple[Any, ...], value: Any) -> list[Any] | None:
        """The values bound by a pattern, or None."""
        return matching.match(world, pattern, value)

    def match_payload(patterns: list[tuple[Any, ...]], payload: list[Any]) -> list[Any] | None:
        """The values bound by the patterns of an event."""
        return matching.match_payload(world, patterns, payload)

    def no_match() -> None:
        """A pattern had to match and did not."""
        raise errors.match_failure()

    def either(left: Any, right: Any) -> Any:
        """``left || right`` where left is an event."""
        return world.send(left, "||", right)

    def truth(value: Any) -> bool:
        """Whether a value counts as true."""
        return bool(value)

    def caught(error: BaseException) -> Any:
        """The value of a caught error.  A program that catches its being stopped goes on as if begun anew."""
        if isinstance(error, errors.Stopped):
            world.scheduler.running().renew()
        return world.caught(error)

    def outlasting(ending: BaseException, later: BaseException) -> BaseException:
        """What goes on when a ``finally`` clause that runs since a job ends, or leaves a tag, is left by ``later``.

        Its error is reported as that of a job.
        """
        if isinstance(later, Exception):
            scheduler = world.scheduler
            scheduler.failed(scheduler.running(), later)
        return later if supersedes(later, ending) else ending

    return locals_of(thrown, match, match_payload, no_match, either, truth, caught, outlasting)


class Pace:
    """The rhythm of an ``every``: absolute deadlines in the job's own time; an overrun starts the next turn at once."""

    __slots__ = ("_due", "_job", "_world")

    def __init__(self, world: World) -> None:
        self._world = world
        self._job = world.scheduler.running()
        self._due = self._job.local_time(world.scheduler.clock.now())

    def wait(self, period: Any) -> None:
        """Sleep until a period after the last turn was due."""
        if period.__class__ is not float:
            raise self._world.type_error(1, period, "Float", "+=")
        scheduler = self._world.scheduler
        now = self._job.local_time(scheduler.clock.now())
        self._due = max(self._due + period, now)
        scheduler.sleep(self._due - now)


def _concurrency(world: World) -> dict[str, Any]:
    def pace() -> Pace:
        """The rhythm of an ``every``."""
        return Pace(world)

    def tag_open(value: Any) -> Any:
        """A passage through the code under a tag (or a mutex)."""
        opener = getattr(value, "open", None)
        if opener is None:
            raise world.type_error(None, value, "Tag", None)
        return opener()

    def tag_named(holder: Any, implicit: bool, path: tuple[str, ...]) -> Any:
        """A passage through the tag of this name; an undeclared one is made in Tag."""
        return tag_open(world.tag_by_name(holder, implicit, path))

    def scope_tag() -> TagObject:
        """The tag of a scope."""
        tag = Tag(world.scheduler, "scope")
        return ScopeTag(world, [world.tag_proto], tag)

    def loop_tag() -> LoopPassage:
        """A passage through a loop whose body detaches jobs."""
        return LoopPassage(world)

    def timeout(duration: Any) -> TimeoutPassage:
        """``timeout (duration)``."""
        return TimeoutPassage(world, world.as_float(duration, None, "timeout"))

    def guard(kind: str, condition: Callable[[], Any]) -> ConditionPassage:
        """``stopif (condition)`` and ``freezeif (condition)``."""
        return ConditionPassage(world, condition, kind == "freezeif")

    def event_guard(kind: str, event: Any, accept: Callable[[list[Any]], Any]) -> EventPassage:
        """``stopif (event?)`` and ``freezeif (event?)``."""
        if not isinstance(event, Event):
            raise world.type_error(None, event, "Event", None)
        return EventPassage(world, event, accept, kind == "freezeif")

    def move_slot(target: Any, name: str, value: Any, attributes: dict[str, Any]) -> None:
        """``target.name = value time: 1s``."""
        if target.__class__ is not float and target.bounces and name not in target.slots:
            target.distribute(value, lambda member, share: move_slot(member, name, share, attributes))
            return
        read = world.ops.send0
        properties, blender = place(world, target, name)
        Trajectory(
            world, lambda: read(target, name), lambda v: world.update_slot(target, name, v), value, attributes,
            properties, blender,
        ).run()

    def move_local(box: Box, value: Any, attributes: dict[str, Any]) -> None:
        """``local = value time: 1s``."""

        def write(v: Any) -> None:
            box.v = v

        Trajectory(world, lambda: box.v, write, value, attributes).run()

    return locals_of(
        pace, tag_open, tag_named, scope_tag, loop_tag, timeout, guard, event_guard, move_slot, move_local
    )


OPPOSITE = {"==": "!=", "!=": "==", "<": ">=", ">=": "<", ">": "<=", "<=": ">", "===": "!==", "!==": "===",
            "~=": "!~=", "=~=": "!=~="}


def _assertions(world: World) -> dict[str, Any]:
    def asserting() -> bool:
        """Whether assertions are checked."""
        return not world.ndebug

    def fail(text: str, detail: str) -> None:
        raise errors.Raised("Exception", f"failed assertion: {text}{detail}", None)

    def assert_value(text: str, value: Any, literal: bool) -> None:
        """A claim that is no call."""
        if not value:
            fail(text, "" if literal else f" ({text} == {world.printable(value)})")

    def assert_call(
        text: str,
        target: Any,
        shown: bool,
        name: str,
        function: Any,
        thunks: list[Callable[[], Any]],
        nodes: tuple[Any, ...],
    ) -> None:
        """A claim that is a call: the message shows the values of its target and arguments."""
        args = [Lazy(world, thunk, node) for thunk, node in zip(thunks, nodes, strict=True)]
        for lazy in args:
            lazy.memoize()
        value = world.ops.method(target, name) if function is None else function
        if not isinstance(value, Executable):
            value = Getter(world, value)
        if value.strict:
            given = tuple([argument.force() for argument in args])
            if world.void in given:
                raise errors.unexpected_void()
            result = value.call(target, given)
        else:
            result = value.call_lazy(world.lazy_message(value, target, name, target, args))
        if not result:
            fail(text, _detail(target, shown, name, args, result))

    def _detail(target: Any, shown: bool, name: str, args: list[Lazy], result: Any) -> str:
        values = [world.printable(arg.cached) if arg.cached is not None else "?" for arg in args]
        if shown and name in OPPOSITE and len(values) == 1:
            return f" ({world.printable(target)} {OPPOSITE[name]} {values[0]})"
        called = world.quoted_name(name) + (f"({', '.join(values)})" if values else "")
        if shown:
            called = f"{world.printable(target)}.{called}"
        return f" ({called} == {world.printable(result)})"

    return locals_of(asserting, assert_value, assert_call)


def locals_of(*functions: Callable[..., Any]) -> dict[str, Any]:
    """Functions by their names."""
    return {function.__name__: function for function in functions}
