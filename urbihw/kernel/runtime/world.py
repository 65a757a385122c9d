"""One kernel's objects: the roots, the constants, and the verbs by which native code handles values.

All state belongs to a ``World`` and none to modules, so a process can run several kernels.  The classes of the standard
library put their slots on the bare prototypes made here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, TypeVar

from urbihw.kernel import errors
from urbihw.kernel.runtime import convert
from urbihw.kernel.runtime.arguments import ArgumentChecks
from urbihw.kernel.runtime.backtrace import failed_in_program
from urbihw.kernel.runtime.code import Executable, call_value, make_primitive
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.failures import Failures
from urbihw.kernel.runtime.holdings import Holdings
from urbihw.kernel.runtime.identifiers import Identifiers
from urbihw.kernel.runtime.lazy_names import LazyNames
from urbihw.kernel.runtime.lookup import Lookups
from urbihw.kernel.runtime.notifier import Notifier
from urbihw.kernel.runtime.object import Nil, Obj, Plain, Truth, Void
from urbihw.kernel.runtime.plain import plain_text
from urbihw.kernel.runtime.record import Record
from urbihw.kernel.runtime.redefinition import RedefinitionMode
from urbihw.kernel.runtime.remains import LARGE, Remains
from urbihw.kernel.runtime.slots import SlotOps
from urbihw.kernel.runtime.tagscope import RootTag, TagObject
from urbihw.kernel.runtime.values import (
    CallMessage,
    Dictionary,
    FloatObject,
    Lazy,
    List,
    String,
    TextList,
    Tuple,
    list_maker,
    string_maker,
)
from urbihw.kernel.runtime.watch import Recorder
from urbihw.kernel.sched.job import Job
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.tag import Tag
from urbihw.kernel.value import Value

KERNEL_JOB = "own"
"""The ``face`` of the kernel's own jobs."""


P = TypeVar("P")

__implied_calls__ = {"truth_of": "asBool"}
"""A condition calls ``asBool`` without naming it; ``backtrace`` shows the call."""


class World:
    """The objects of one kernel.  ``self.object`` is urbiscript's Object, and so on."""

    def __init__(self, scheduler: Scheduler) -> None:
        self.scheduler = scheduler
        self.recorder = Recorder(scheduler)
        self.remains = Remains(scheduler)
        self.lookups = Lookups(self)
        self.ndebug = False
        self.hide_system = True
        self.period = 0.02
        self.tag_count = 0
        self.float_slots: dict[int, tuple[float, Obj]] = {}
        self.lazy_names = LazyNames(scheduler)
        self.classes: dict[str, Any] = {}
        """The built-in prototypes by name (``A.B`` for a slot of another one), where no program can change them."""
        self.generic_floats = False
        self.truth_redefined = False
        """Whether a program has defined an ``asBool``, which conditions must then call."""
        self.record = Record(self)
        self.redefinition = RedefinitionMode(scheduler)
        self.client_gone: list[Callable[[Any], None]] = []
        """Called with a lobby as soon as its connection is lost, before its jobs are ended."""
        self.devices_released: list[Callable[[Any], None]] = []
        """Called with a lobby that shall not move devices any more by what it has done until now."""
        self.holdings = Holdings()
        """The resources of jobs without a lobby."""
        self.unheard: Callable[[str], None] = lambda line: None
        """Gets what jobs say that no connection has started: those of the files that a daemon loads."""
        self._parts: dict[type, Any] = {}
        """Objects of other layers that belong to this world, by class."""
        self._make_roots()
        self._make_verbs()

    def _make_roots(self) -> None:
        """The bare prototypes and the constants."""
        self.object = Plain(self, [])
        self.global_ = Plain(self, [self.object])
        self.object.protos = [self.global_]
        self.void = Void(self, [])
        self.float_proto = FloatObject(self, [self.object], 0.0)
        self.string_proto = String(self, [self.object], "")
        self.list_proto = List(self, [self.object], [])
        self.string_protos: list[Any] = [self.string_proto]
        self.list_protos: list[Any] = [self.list_proto]
        self.string = string_maker(self, self.string_protos)
        self.quick_strings: list[Any] | None = self.string_protos
        self._new_list = list_maker(self, self.list_protos)
        self.quick_lists: list[Any] | None = self.list_protos
        self.tuple_proto = Tuple(self, [self.object], [])
        self.dictionary_proto = Dictionary(self, [self.object], {})
        self.true = Truth(self, [self.object], True)
        self.false = Truth(self, [self.object], False)
        self.nil = Nil(self, [self.object])
        self.executable_proto = self.proto()
        self.code_proto = self.proto(self.executable_proto)
        self.primitive_proto = self.proto(self.executable_proto)
        self.lazy_proto = self.proto()
        self.call_message_proto = self.proto()
        self.exception_proto = self.proto()
        self.lobby_proto = self.proto()
        self.uvar_proto = self.proto()
        self.uobject_proto = self.proto()
        self.event_proto = Event(self, [self.object])
        self.tag_proto = RootTag(self, [self.object], Tag(self.scheduler, "tag"))
        self.tags = self.proto()

    def _make_verbs(self) -> None:
        """The verbs for values that have modules of their own."""
        self.ops = SlotOps(self)
        self.send = self.ops.send
        self.send1 = self.ops.send1
        self.get_slot = self.ops.get_slot
        self.set_slot = self.ops.set_slot
        self.update_slot = self.ops.update_slot
        self.float_zero_error = errors.primitive("division by 0", "/")
        failures = Failures(self)
        self.type_error = failures.type_error
        self.normalized = failures.normalized
        self.caught = failures.caught
        self.describe = failures.describe
        self.located_exception_text = failures.located_exception_text
        self.checks = ArgumentChecks(self)
        self.identifiers = Identifiers(self)
        self.uid = self.identifiers.uid
        self.call_soon = Notifier(self).call_soon

    # ---------------------------------------------------------------- other layers

    def install_part(self, part: object) -> None:
        """Store an object of another layer; ``part(its class)`` returns it."""
        self._parts[type(part)] = part

    def part(self, kind: type[P]) -> P:
        """The installed part of this class; raises KeyError if there is none."""
        found: P = self._parts[kind]
        return found

    def has_part(self, kind: type) -> bool:
        """Whether a part of this class was installed."""
        return kind in self._parts

    # ---------------------------------------------------------------- making values

    def proto(self, *protos: Obj) -> Obj:
        """A bare object with these prototypes (Object if none)."""
        return Plain(self, list(protos) or [self.object])

    def new_list(self, values: list[Value]) -> List:
        """A List that owns ``values``."""
        made = self._new_list(values)
        if len(values) >= LARGE:
            self.remains.follow(made)
        return made

    def new_texts(self, texts: list[str]) -> List:
        """A List of Strings that are parts of one String, and made when they are read; owns ``texts``."""
        if len(texts) >= LARGE:
            return self.new_list([*map(self.string, texts)])
        made = self._new_list(texts)
        made.__class__ = TextList
        return made

    def new_tuple(self, values: Iterable[Value]) -> Tuple:
        """Make a Tuple of some values."""
        return Tuple(self, [self.tuple_proto], [*values])

    def dictionary(self, values: dict[str, Value]) -> Dictionary:
        """A Dictionary that owns ``values``."""
        return Dictionary(self, [self.dictionary_proto], values)

    def boolean(self, value: object) -> Truth:
        """``true`` or ``false``."""
        return self.true if value else self.false

    def lazy(self, thunk: Callable[[], Any], node: Any) -> Lazy:
        """Make a Lazy of an unevaluated expression."""
        return Lazy(self, thunk, (node,))

    def call_message(self, code: Value, target: Value, args: Iterable[Value], message: str = "") -> CallMessage:
        """The message of a call made by native code, with arguments already evaluated."""
        return self.lazy_message(code, target, message, target, [self.evaluated(value) for value in args])

    def evaluated(self, value: Value) -> Lazy:
        """A lazy argument for a value that is computed already."""
        return Lazy(self, lambda: value)

    def lazy_message(self, code: Value, target: Value, name: str, sender: Value, args: list[Lazy]) -> CallMessage:
        """The message of a call with unevaluated arguments."""
        return CallMessage(self, code, target, name, sender, args)

    def new_class(self, name: str, protos: list[Value]) -> Obj:
        """What ``class name : protos`` makes before its body runs: an object with its ``type`` and ``as<name>``."""
        if any(isinstance(proto, Obj) and proto.requires_finalizable_heirs for proto in protos):
            raise errors.unfinalizable("apply")
        if len(protos) == 1 and protos[0].__class__ is not float:
            made: Obj = protos[0].clone()
        else:
            made = Plain(self, list(protos) or [self.object])
        made.slots["type"] = self.string(name)
        made.slots["as" + name] = self.object.slots["acceptVoid"]
        return made

    def key(self, value: Value) -> str:
        """A dictionary key: keys are strings."""
        if not isinstance(value, String):
            raise self.type_error(None, value, "String", None)
        return value.s

    def iterate(self, items: Value) -> Iterable[Any]:
        """The members of a container as ``each`` would give them: a snapshot."""
        if items.__class__ is float:
            if items < 0 or not items.is_integer():
                raise errors.bad_number("BadInteger", f"expected positive integer, got {self.text(items)}", items)
            return map(float, range(int(items)))
        if isinstance(items, List) and "each" not in items.slots:
            if self.recorder.active is not None:
                self.recorder.read(items, "")
            return list(items.l)
        found: list[Any] = []

        def add_member(this: Value, member: Value) -> Value:
            found.append(member)
            return self.void

        collector = make_primitive(self, "each", add_member, 1, 1)
        self.send(items, "each", collector)
        return found

    # ---------------------------------------------------------------- asking values

    def as_obj(self, value: Value) -> Obj:
        """The object that holds the slots of a value: itself, or for a number a holder keyed by identity."""
        if value.__class__ is not float:
            assert isinstance(value, Obj)
            return value
        known = self.float_slots.get(id(value))
        if known is None:
            known = self.float_slots[id(value)] = (value, Plain(self, [self.float_proto]))
            self.flush()  # it may have been looked through as a prototype
            self.identifiers.move_to_holder(value, known[1])
        return known[1]

    def peek_obj(self, value: Value) -> Obj:
        """Like ``as_obj`` for reading: a number without slots of its own is its prototype."""
        if value.__class__ is float:
            known = self.float_slots.get(id(value)) if self.float_slots else None
            return self.float_proto if known is None else known[1]
        assert isinstance(value, Obj)
        return value

    def protos_of(self, value: Value) -> list[Any]:
        """The prototypes of a value."""
        return [self.float_proto] if value.__class__ is float and id(value) not in self.float_slots \
            else self.as_obj(value).protos

    def is_a(self, value: Value, proto: Value) -> bool:
        """Whether ``proto`` is the value or one of its ancestors."""
        if value is proto:
            return True
        todo: list[Any] = list(self.protos_of(value))
        seen: set[int] = set()
        while todo:
            ancestor = todo.pop()
            if ancestor is proto:
                return True
            if id(ancestor) not in seen:
                seen.add(id(ancestor))
                todo.extend(self.protos_of(ancestor))
        return False

    def text(self, value: Value) -> str:
        """The result of ``value.asString`` as a Python str."""
        if value.__class__ is String and "asString" not in value.slots:
            return str(value.s)
        answer = self.send(value, "asString")
        if not isinstance(answer, String):
            raise self.type_error(None, answer, "String", "asString")
        return answer.s

    def printable(self, value: Value) -> str:
        """The result of ``value.asPrintable`` as a Python str."""
        answer = self.send(value, "asPrintable")
        if not isinstance(answer, String):
            raise self.type_error(None, answer, "String", "asPrintable")
        return answer.s

    def type_name(self, value: Value) -> str:
        """The ``type`` of a value."""
        return self.text(self.send(value, "type"))

    def as_float(self, value: Value, index: int | None, routine: str | None) -> float:
        """The value as a Python float; raises the type error if it is no Float."""
        if value.__class__ is not float:
            if isinstance(value, FloatObject):
                return value.value
            raise self.type_error(index, value, "Float", routine)
        return float(value)

    def quoted_name(self, name: str) -> str:
        """A slot name in the syntax of programs: quoted unless it is an identifier."""
        return name if name.isidentifier() else f"'{name}'"

    # ---------------------------------------------------------------- calling

    def invoke(self, value: Value, this: Value, args: tuple[Value, ...] = (), name: str = "") -> Value:
        """Call a value with a target and evaluated arguments, from native code."""
        if not isinstance(value, Executable):
            return call_value(self, value, args, name) if args else value
        if not value.strict:
            return value.call_lazy(self.call_message(value, this, args, name))
        return value.call(this, args)

    def operator_redefined(self, obj: Obj) -> None:
        """A program has redefined an operator of a class: from now on it is sent as a message to the values of the
        class.
        """
        if obj is self.float_proto:
            self.generic_floats = True
        elif obj is self.string_proto:
            self.quick_strings = None
        elif obj is self.list_proto:
            self.quick_lists = None

    def truth_of(self, obj: Obj) -> bool:
        """Whether an object counts as true, by its ``asBool`` (manual, section Truth Values)."""
        if obj.find("asBool") is None:
            return obj.default_truth()
        return bool(self.send(obj, "asBool"))

    def flush(self) -> None:
        """Drop all look-up caches, because prototypes have changed."""
        self.lookups.flush()

    # ---------------------------------------------------------------- tags

    def fresh_tag_name(self) -> str:
        """A new name for a tag without one."""
        self.tag_count += 1
        return f"tag_{self.tag_count}"

    def tag_by_name(self, holder: Value, implicit: bool, path: Sequence[str]) -> Any:
        """The tag that ``a.b:`` means; a tag is made for an undeclared name, in Tag.tags (``a`` alone) or in its
        parent.
        """
        for index, name in enumerate(path):
            obj = self.as_obj(holder)
            if index == 0 and implicit and obj.find(name) is None:
                obj = self.tags
            if obj.find(name) is None:
                parent = self.tag_proto if obj is self.tags else obj
                if not isinstance(parent, TagObject):
                    raise errors.Raised("ImplicitTagComponent", "invalid component in implicit tag", None)
                made = TagObject(self, [parent], Tag(self.scheduler, name, parent.tag))
                self.set_slot(obj, name, made)
            holder = self.ops.send0(obj, name)
        return holder

    # ---------------------------------------------------------------- errors

    def shown(self, value: Value) -> str:
        """The text that the top level prints for a value.

        An error in a program's own function is raised; where the library itself cannot print any more, the text is
        plain.
        """
        try:
            text = self.ops.send0(value, "asToplevelPrintable")
        except errors.ThrownError as error:
            if failed_in_program(error):
                raise
        else:
            if isinstance(text, String):
                return text.s
        return plain_text(self, value)

    # ---------------------------------------------------------------- conversions

    def global_name(self, value: Value) -> str | None:
        """The name of the first slot of Global that holds a value; None if there is none."""
        return next((name for name, held in self.global_.slots.items() if held is value), None)

    def from_python(self, value: Value) -> Value:
        """A Python value as an urbiscript one (see ``convert``)."""
        return convert.from_python(self, value)

    def spawn(self, body: Callable[[], Any], name: str = "", parent: Job | None = None) -> Job:
        """Make a job outside any group; its errors are reported to the lobby of its context."""
        return self.scheduler.spawn(body, name, parent=parent)

    def spawn_own(self, body: Callable[[], Any], name: str) -> Job:
        """Make a job of the kernel itself, which programs can neither see nor end."""
        job = self.scheduler.spawn(body, name)
        job.face = KERNEL_JOB
        return job
