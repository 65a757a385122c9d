"""One kernel's objects: the roots, the constants, and the verbs by which native code handles values.

Everything hangs on a ``World``; there is no module-level state, so two kernels fit in one process.  The classes of the
standard library put their slots on the bare prototypes made here.
"""

from __future__ import annotations

import contextlib
import logging
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime import convert
from urbihw.kernel.runtime.backtrace import Stack, failed_in_program, stack_of
from urbihw.kernel.runtime.code import Executable, make_primitive
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.holdings import Holdings
from urbihw.kernel.runtime.lookup import Lookups
from urbihw.kernel.runtime.object import Nil, Obj, Plain, Truth, Void
from urbihw.kernel.runtime.passage import RootTag, TagObject
from urbihw.kernel.runtime.plain import plain_error, plain_text
from urbihw.kernel.runtime.record import Record
from urbihw.kernel.runtime.slots import SlotOps
from urbihw.kernel.runtime.spelling import suggestion
from urbihw.kernel.runtime.values import CallMessage, Dictionary, FloatObject, Lazy, List, String, Tuple
from urbihw.kernel.runtime.watch import Recorder
from urbihw.kernel.sched.errors import HeldTooLong, TooManyJobs
from urbihw.kernel.sched.job import SLEEPING, WAITING, Job
from urbihw.kernel.sched.scheduler import Scheduler
from urbihw.kernel.sched.tag import Tag

log = logging.getLogger("urbihw.kernel")

UID_BASE, UID_STEP = 0x10000000, 0x10
"""Unique identifiers look like addresses, as in the manual, but the same program gives the same ones."""
OWN = "own"
"""The ``face`` of a job of the kernel itself."""
FLOATS_NUMBERED = 1000
"""How many numbers without slots keep the identifier they were asked for; they are kept alive meanwhile."""


class World:
    """The objects of one kernel.  ``self.object`` is urbiscript's Object, and so on."""

    def __init__(self, scheduler: Scheduler) -> None:
        self.scheduler = scheduler
        self.recorder = Recorder()
        self.lookups = Lookups(self)
        self.ndebug = False
        self._showing = False
        self.hide_system = True
        self.period = 0.02
        self.tag_count = 0
        self._numbered = 0
        self._float_numbers: dict[int, tuple[float, int]] = {}
        self.float_slots: dict[int, tuple[float, Obj]] = {}
        self.lazy_names: set[str] = set()
        self.classes: dict[str, Any] = {}
        """The built-in prototypes by their names (``A.B`` for a slot of another), where no program reaches them."""
        self.generic_floats = False
        self.record = Record(self)

        self.object = Plain(self, [])
        self.global_ = Plain(self, [self.object])
        self.object.protos = [self.global_]
        self.void = Void(self, [])
        self.float_proto = FloatObject(self, [self.object], 0.0)
        self.string_proto = String(self, [self.object], "")
        self.list_proto = List(self, [self.object], [])
        self.string_protos: list[Any] = [self.string_proto]
        self.list_protos: list[Any] = [self.list_proto]
        self.quick_strings: list[Any] | None = self.string_protos
        self.quick_lists: list[Any] | None = self.list_protos
        self.tuple_proto = Tuple(self, [self.object], [])
        self.dictionary_proto = Dictionary(self, [self.object], {})
        self.boolean_proto = self.proto()
        self.true = Truth(self, [self.boolean_proto], True)
        self.false = Truth(self, [self.boolean_proto], False)
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
        self._soon: deque[Callable[[], None]] = deque()
        self._notifier: Job | None = None
        self.client_gone: list[Callable[[Any], None]] = []
        """Called with a lobby at once when its connection is gone, before what it runs is ended."""
        self.holdings = Holdings()
        """What is held by jobs that speak to no lobby."""
        self.uobjects: Any = None
        self.pipes: Any = None
        self.external: Callable[..., Any] = _no_compiler
        self.event_proto = Event(self, [self.object])
        self.tag_proto = RootTag(self, [self.object], Tag(scheduler, "tag"))
        self.tags = self.proto()
        self.run_late: Callable[..., Any] = _no_compiler
        self.redefining: Callable[[], bool] = lambda: False
        self.ops = SlotOps(self)
        self.send = self.ops.send
        self.send1 = self.ops.send1
        self.get_slot = self.ops.get_slot
        self.set_slot = self.ops.set_slot
        self.update_slot = self.ops.update_slot
        self.float_zero_error = errors.primitive("division by 0", "/")

    # ---------------------------------------------------------------- making values

    def proto(self, *protos: Obj) -> Obj:
        """A bare object with these prototypes (Object if none)."""
        return Plain(self, list(protos) or [self.object])

    def string(self, s: str) -> String:
        """A String; characters beyond latin-1 become their UTF-8 bytes."""
        return String(self, self.string_protos, s)

    def new_list(self, values: list[Any]) -> List:
        """A List that owns ``values``."""
        return List(self, self.list_protos, values)

    def new_tuple(self, values: Iterable[Any]) -> Tuple:
        """A Tuple."""
        return Tuple(self, [self.tuple_proto], [*values])

    def dictionary(self, values: dict[str, Any]) -> Dictionary:
        """A Dictionary that owns ``values``."""
        return Dictionary(self, [self.dictionary_proto], values)

    def boolean(self, value: object) -> Truth:
        """``true`` or ``false``."""
        return self.true if value else self.false

    def lazy(self, thunk: Callable[[], Any], node: Any) -> Lazy:
        """A value not yet computed."""
        return Lazy(self, thunk, node)

    def call_message(self, code: Any, target: Any, args: Iterable[Any], message: str = "") -> CallMessage:
        """The message of a call made by native code, with arguments already evaluated."""
        return self.lazy_message(code, target, message, target, [self.evaluated(value) for value in args])

    def evaluated(self, value: Any) -> Lazy:
        """A lazy argument that is a value already."""
        return Lazy(self, lambda: value, None)

    def lazy_message(self, code: Any, target: Any, name: str, sender: Any, args: list[Lazy]) -> CallMessage:
        """The message of a call with unevaluated arguments."""
        return CallMessage(self, code, target, name, sender, args)

    def new_class(self, name: str, protos: list[Any]) -> Obj:
        """What ``class name : protos`` makes before its body runs: an object with its ``type`` and ``as<name>``."""
        if any(isinstance(proto, Obj) and proto.heirs_alike for proto in protos):
            raise errors.unfinalizable("apply")
        if len(protos) == 1 and protos[0].__class__ is not float:
            made: Obj = protos[0].clone()
        else:
            made = Plain(self, list(protos) or [self.object])
        made.slots["type"] = self.string(name)
        made.slots["as" + name] = self.object.slots["acceptVoid"]
        return made

    def key(self, value: Any) -> str:
        """A dictionary key: keys are strings."""
        if not isinstance(value, String):
            raise self.type_error(None, value, "String", None)
        return value.s

    def iterate(self, items: Any) -> Iterable[Any]:
        """The members of a container as ``each`` would give them: a snapshot."""
        if items.__class__ is float:
            if items < 0 or not items.is_integer():
                raise errors.Raised("BadInteger", f"expected positive integer, got {self.text(items)}", "each")
            return map(float, range(int(items)))
        if isinstance(items, List) and "each" not in items.slots:
            if self.recorder.active is not None:
                self.recorder.read(items, "")
            return list(items.l)
        found: list[Any] = []

        def take(this: Any, member: Any) -> Any:
            found.append(member)
            return self.void

        taker = make_primitive(self, "each", take, 1, 1)
        self.send(items, "each", taker)
        return found

    # ---------------------------------------------------------------- asking values

    def as_obj(self, value: Any) -> Obj:
        """The object that holds the slots of a value: itself, or for a number a holder keyed by identity."""
        if value.__class__ is not float:
            assert isinstance(value, Obj)
            return value
        known = self.float_slots.get(id(value))
        if known is None:
            known = self.float_slots[id(value)] = (value, Plain(self, [self.float_proto]))
            self.flush()  # it may have been looked through as a prototype
            numbered = self._float_numbers.pop(id(value), None)
            if numbered is not None and numbered[0] is value:
                known[1].number = numbered[1]
        return known[1]

    def peek_obj(self, value: Any) -> Obj:
        """Like ``as_obj`` for reading: a number without slots of its own is its prototype."""
        if value.__class__ is float:
            known = self.float_slots.get(id(value)) if self.float_slots else None
            return self.float_proto if known is None else known[1]
        assert isinstance(value, Obj)
        return value

    def protos_of(self, value: Any) -> list[Any]:
        """The prototypes of a value."""
        return [self.float_proto] if value.__class__ is float and id(value) not in self.float_slots \
            else self.as_obj(value).protos

    def is_a(self, value: Any, proto: Any) -> bool:
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

    def text(self, value: Any) -> str:
        """What ``value.asString`` says, as a Python str."""
        if value.__class__ is String and "asString" not in value.slots:
            return str(value.s)
        answer = self.send(value, "asString")
        if not isinstance(answer, String):
            raise self.type_error(None, answer, "String", "asString")
        return answer.s

    def printable(self, value: Any) -> str:
        """What ``value.asPrintable`` says, as a Python str."""
        answer = self.send(value, "asPrintable")
        if not isinstance(answer, String):
            raise self.type_error(None, answer, "String", "asPrintable")
        return answer.s

    def type_name(self, value: Any) -> str:
        """The ``type`` of a value."""
        return self.text(self.send(value, "type"))

    def as_float(self, value: Any, index: int | None, routine: str | None) -> float:
        """A value that must be a Float."""
        if value.__class__ is not float:
            if isinstance(value, FloatObject):
                return value.value
            raise self.type_error(index, value, "Float", routine)
        return float(value)

    def quoted_name(self, name: str) -> str:
        """A slot name as it is written in a program: quoted unless it is an identifier."""
        return name if name.isidentifier() else f"'{name}'"

    def uid(self, value: Any) -> str:
        """What tells a value from all others: ``0x`` and hexadecimal digits, given out in the order of the asking."""
        if value.__class__ is float and id(value) not in self.float_slots:
            known = self._float_numbers.get(id(value))
            if known is None or known[0] is not value:
                if len(self._float_numbers) >= FLOATS_NUMBERED:
                    self._float_numbers.pop(next(iter(self._float_numbers)))
                known = self._float_numbers[id(value)] = (value, self._next_number())
            return hex(known[1])
        obj = self.as_obj(value)
        if not obj.number:
            obj.number = self._next_number()
        return hex(obj.number)

    def _next_number(self) -> int:
        self._numbered += 1
        return UID_BASE + UID_STEP * self._numbered

    # ---------------------------------------------------------------- calling

    def invoke(self, value: Any, this: Any, args: tuple[Any, ...] = (), name: str = "") -> Any:
        """Call a value with a target and evaluated arguments, from native code."""
        if not isinstance(value, Executable):
            if args:
                raise errors.arity(len(args), 0, routine=name or "")
            return value
        if not value.strict:
            return value.call_lazy(self.call_message(value, this, args, name))
        return value.call(this, args)

    def operator_redefined(self, obj: Obj) -> None:
        """Somebody gave a class an operator of his own: its values are sent it from now on."""
        if obj is self.float_proto:
            self.generic_floats = True
        elif obj is self.string_proto:
            self.quick_strings = None
        elif obj is self.list_proto:
            self.quick_lists = None

    def flush(self) -> None:
        """The structure of some prototype changed: forget where inherited slots were found."""
        self.lookups.flush()

    # ---------------------------------------------------------------- tags

    def fresh_tag_name(self) -> str:
        """A name for a tag that was given none."""
        self.tag_count += 1
        return f"tag_{self.tag_count}"

    def tag_by_name(self, holder: Any, implicit: bool, path: Sequence[str]) -> Any:
        """The tag meant by ``a.b:``; an undeclared name makes a tag, in Tag.tags (``a`` alone) or in its parent."""
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

    def type_error(self, index: int | None, value: Any, expected: str, routine: str | None = "") -> errors.UrbiError:
        """``routine: unexpected VALUE for argument INDEX, expected a TYPE``."""
        if value is self.void:
            return errors.unexpected_void()
        where = "" if index is None else f" for argument {index}"
        article = "an" if expected[:1] in "AEIOU" else "a"
        kind = "Type" if index is None else "ArgumentType"
        return errors.Raised(kind, f"unexpected {self._shown(value)}{where}, expected {article} {expected}", routine)

    def _shown(self, value: Any) -> str:
        """``printable``, or something plainer when printing it is what failed."""
        if self._showing:
            return f"{self.type_name(value)}_{self.uid(value)}"
        self._showing = True
        try:
            return self.printable(value)
        finally:
            self._showing = False

    def normalized(self, error: BaseException) -> errors.UrbiError:
        """Any Python exception as an urbiscript one; what is no error of urbiscript is logged as a bug of ours."""
        if isinstance(error, errors.UrbiError):
            return error
        if isinstance(error, ZeroDivisionError):
            raised: errors.UrbiError = errors.primitive("division by 0", "/")
        elif isinstance(error, RecursionError):
            raised = errors.Raised("Scheduling", "stack exhausted", None)
        elif isinstance(error, TooManyJobs | HeldTooLong):
            raised = errors.Raised("Scheduling", str(error), None)
        elif isinstance(error, MemoryError):
            raised = errors.Raised("Scheduling", "memory exhausted", None)
        elif isinstance(error, OSError):
            raised = errors.primitive(error.strerror or str(error), None)
        else:
            log.error("bug in urbihw: %s: %s", type(error).__name__, error)
            log.debug("traceback of the bug", exc_info=error)
            raised = errors.primitive(f"internal error ({type(error).__name__}), please report it: {error}", None)
        return raised.with_traceback(error.__traceback__)

    def caught(self, error: BaseException) -> Any:
        """The urbiscript value of a caught error; Exceptions get their location and backtrace here."""
        urbi = self.normalized(error)
        if isinstance(urbi, errors.Raised):
            if urbi.value is None:
                urbi.value = self._exception(urbi)
            return urbi.value
        value = urbi.value
        if isinstance(value, Obj) and "backtrace" not in value.slots and self.is_a(value, self.exception_proto):
            self._locate(value, stack_of(urbi, self.hide_system))
        return value

    def describe(self, error: BaseException) -> list[str]:
        """The lines that tell a user of an uncaught error, without the leading marks.

        Never fails, though it may run a program's functions: an error in one of these is told instead, and where the
        library itself cannot print any more, the text is plain.
        """
        try:
            return self._described(error)
        except Exception as second:
            if failed_in_program(second):
                with contextlib.suppress(Exception):
                    return self._described(second)
        urbi = self.normalized(error)
        return plain_error(self, urbi, stack_of(urbi, self.hide_system))

    def _described(self, error: BaseException) -> list[str]:
        urbi = self.normalized(error)
        stack = stack_of(urbi, self.hide_system)
        value = self.caught(urbi)
        if isinstance(value, Obj) and self.is_a(value, self.exception_proto):
            head = self.exception_text(value)
            place = self._slot_text(value, "location")
            loc = self._slot_text(value, "loc")
            lines = [f"{loc or place}: {head}" if loc or place else head]
            if loc and stack.routine:  # a syntax error in a text that was being evaluated
                lines.append(f"   called from: {place}: {stack.routine}")
        else:
            lines = [self.text(value)]
        lines += [f"   called from: {frame.location}: {frame.name}" for frame in stack.calls]
        return lines

    def exception_text(self, value: Any) -> str:
        """``routine: message`` of an Exception."""
        loc = self._slot_text(value, "loc")
        routine = self._slot_text(value, "routine")
        message = self.text(self.send(value, "message"))
        if loc:
            return f"syntax error: {message}"
        return f"{routine}: {message}" if routine else message

    def _slot_text(self, value: Any, name: str) -> str:
        holder = self.as_obj(value).find(name)
        content = None if holder is None else holder.slots[name]
        if content is None or content is self.void or content is self.nil:
            return ""
        return self.text(content)

    def _exception(self, raised: errors.Raised) -> Obj:
        base = self.exception_proto
        kind = base if raised.kind == "Exception" else self.classes.get(f"Exception.{raised.kind}", base)
        made = Plain(self, [kind])
        made.slots["message"] = self.string(raised.message + self._spelling(raised))
        stack = stack_of(raised, self.hide_system)
        routine = stack.routine if raised.routine == "" else raised.routine
        if routine is not None:
            made.slots["routine"] = self.string(routine)
        for name, value in raised.slots.items():
            made.slots[name] = self.from_python(value)
        self._locate(made, stack)
        return made

    def _spelling(self, raised: errors.Raised) -> str:
        """What to add to the message of a look-up that failed."""
        if not isinstance(raised, errors.LookupFailed) or raised.target is None:
            return ""
        kind = self.classes.get("Exception.Lookup")
        if kind is None or not kind.slots.get("fixSpelling"):
            return ""
        return suggestion(self, raised.target, raised.slots["name"])

    def _locate(self, value: Obj, stack: Stack) -> None:
        value.slots["location"] = self.location_value(stack.location)
        value.slots["backtrace"] = self.backtrace_value(stack)
        if value.cache is not None:
            self.flush()

    def location_value(self, location: Any) -> Any:
        """A Location object (replaced by the standard library; a string until then)."""
        return self.nil if location is None else self.string(str(location))

    def backtrace_value(self, stack: Stack) -> Any:
        """A list of StackFrames (replaced by the standard library)."""
        return self.new_list([])

    def shown(self, value: Any) -> str:
        """What the top level prints of a value.

        An error in a program's own function is raised; where the library itself cannot print any more, the text is
        plain.
        """
        try:
            text = self.ops.send0(value, "asToplevelPrintable")
        except errors.UrbiError as error:
            if failed_in_program(error):
                raise
        else:
            if isinstance(text, String):
                return text.s
        return plain_text(self, value)

    # ---------------------------------------------------------------- conversions

    def from_python(self, value: Any) -> Any:
        """A Python value as an urbiscript one (see ``convert``)."""
        return convert.from_python(self, value)

    def soon(self, action: Callable[[], None]) -> None:
        """Run something that may wake conditions or emit events: at once inside a job, else in a job of its own.

        What is asked for outside any job is gathered, so that a burst of samples costs one job.
        """
        if self.scheduler.current is not None:
            action()
            return
        self._soon.append(action)
        job = self._notifier
        # One that a condition or a guard of a program holds up is not waited for.
        if job is None or job.done or job.state in (SLEEPING, WAITING):
            self._notifier = self.spawn_own(self._do_soon, "notify")

    def _do_soon(self) -> None:
        while self._soon:
            action = self._soon.popleft()
            try:
                action()
            except Exception as error:
                log.error("error in a notification: %s", "; ".join(self.describe(error)))

    def spawn(self, body: Callable[[], Any], name: str = "", parent: Job | None = None) -> Job:
        """A new job that ends alone; its errors are reported to the lobby of its context."""
        return self.scheduler.spawn(body, name, parent=parent)

    def spawn_own(self, body: Callable[[], Any], name: str) -> Job:
        """A job of the kernel itself: no program can see it or end it."""
        job = self.scheduler.spawn(body, name)
        job.face = OWN
        return job


def _no_compiler(*args: Any) -> Any:
    raise errors.KernelBug("this world has no compiler")
