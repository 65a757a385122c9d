"""Answers to programs, on a channel that the program has chosen: for client libraries.  Not in the manual.

An answer is one line, a List that begins with a String, its kind.  Unlike printed values, numbers have all digits::

    ["", VALUE]                               a Float, String, List, Dictionary, Binary, true, false, nil
    ["object", "motor6", ["AX12", ...]]       another object: how it is printed, the names of its class and prototypes
    ["function", "robot.stop"]                a function, which a reading does not call
    ["error", KIND, ["1.1-3: lookup failed: foo", "   called from: ..."]]
    ["stopped"]                               the statement was ended by a tag

Objects inside of lists are printed by their names.
"""

from __future__ import annotations

import re
from types import TracebackType
from typing import Any, Final

from urbihw.kernel.library import (
    BinaryObject,
    Dictionary,
    Emission,
    Event,
    FloatObject,
    List,
    Nil,
    Obj,
    StopTag,
    String,
    Table,
    Tag,
    TagEntry,
    Truth,
    Tuple,
    Value,
    Void,
    World,
    errors,
    escaped,
    own_lobby,
    prototype,
)
from urbihw.robot.nested_text import NestedText
from urbihw.robot.slot_reading import PathStep, Unreadable, make_reader, make_slot_reader, parse_path

TABLE = Table("Lobby")
TABLES = [TABLE]

MAX_LENGTH: Final = 16 * 1024 * 1024
"""Maximum length of an answer in characters, without the data of Binaries."""
MAX_BACKLOG: Final = 256 * 1024
"""Number of bytes that the client has not read from which on events are left out and counted."""
MAX_FOLLOWED: Final = 64
"""Maximum number of events that are sent to a connection."""
MAX_ASSIGNMENTS: Final = 1000
"""Maximum number of compiled assignments."""
OUTCOME: Final = ("applied", "limitedBy")
"""The slots of a device that tell what became of the last write."""
KIND: Final = "followed events"
_WORD: Final = re.compile(r"[A-Za-z_][\w.]*", re.ASCII)


@TABLE.primitive("answerValue")
def answer_value(world: World, this: Value, channel: str, statement: Value) -> None:
    """Call a closure, and send its result or its error as one line on a channel."""
    text = '["stopped"]'
    try:
        with _Answering(world, this, channel):
            text = _kind_text(world, world.invoke(statement, this))
    except Exception as error:
        text = _error_text(world, error)
    finally:
        _send(world, this, channel, text)


@TABLE.primitive("answerBegun")
def answer_begun(world: World, this: Value, channel: str, statement: Value) -> None:
    """Call a closure in a new job, and send one line on a channel as soon as the job waits or ends: ``["", nil]``, or
    its error.  A later error is reported like that of any background job.
    """
    lobby = own_lobby(world, this)
    errors_before: list[str] = []
    answered = False

    def run() -> None:
        try:
            with _Answering(world, this, channel):
                world.invoke(statement, this)
        except Exception as error:
            if answered:
                raise
            errors_before.append(_error_text(world, error))

    maker = world.scheduler.running()
    job = world.scheduler.spawn(run, lobby.shell.next_name(), maker.context, entries=maker.entries)
    job.descend(maker)
    world.scheduler.run_first(job)
    answered = True
    _send(world, this, channel, errors_before[0] if errors_before else '["", nil]')


@TABLE.primitive("endStatement")
def end_statement(world: World, this: Value, channel: str) -> None:
    """End the statement whose answer goes to a channel of this connection, as a tag would: its client does not wait any
    more.  Does nothing when it has ended.
    """
    tag = own_lobby(world, this).answering.get(channel)
    if tag is not None:
        tag.stop(None)


class _Answering:
    """The statement that runs inside is ended by ``endStatement`` with its channel; a block ``with``."""

    __slots__ = ("_channel", "_entry", "_running", "_tag")

    def __init__(self, world: World, this: Value, channel: str) -> None:
        self._running: dict[str, Tag] = own_lobby(world, this).answering
        self._channel = channel
        self._tag = Tag(world.scheduler, channel)
        self._entry: TagEntry | None = None

    def __enter__(self) -> None:
        self._running[self._channel] = self._tag
        self._entry = self._tag.enter()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if self._running.get(self._channel) is self._tag:
            del self._running[self._channel]
        assert self._entry is not None
        self._tag.leave(self._entry)
        return isinstance(error, StopTag) and error.entry is self._entry


@TABLE.primitive("answerSlot")
def answer_slot(world: World, this: Value, channel: str, path: str) -> None:
    """Read a slot by its path, such as ``motor6.val``, and send its value on a channel.  No function is called."""
    text = '["stopped"]'
    try:
        text = _slot_text(world, this, path)
    except Exception as error:
        text = _error_text(world, error)
    finally:
        _send(world, this, channel, text)


@TABLE.primitive("answerEvents")
def answer_events(world: World, this: Value, channel: str, event: Event) -> None:
    """Send each emission of an event from now on as a line on a channel: ``[time in s, lost, [payload]]``."""
    _Followed(world, own_lobby(world, this), channel, event)


@TABLE.primitive("endAnswers")
def end_answers(world: World, this: Value, channel: str) -> None:
    """Send the events of a channel no more; does nothing for another channel."""
    for one in own_lobby(world, this).holdings.held():
        if isinstance(one, _Followed) and one.channel == channel:
            one.close()


class _Followed:
    """Sends the emissions of an event, until the connection ends."""

    def __init__(self, world: World, lobby: Any, channel: str, event: Event) -> None:
        self.channel = channel
        self._world = world
        self._lobby = lobby
        self._event = event
        self._lost = 0
        lobby.holdings.register(self, KIND, MAX_FOLLOWED)
        event.subscribe(self)

    def offer(self, emission: Emission) -> None:
        """The event is emitted: send it, unless the client does not read."""
        if self._lobby.output.backlog > MAX_BACKLOG:
            self._lost += 1
            return
        payload = emission.payload
        try:
            values = _text(self._world, self._world.new_list(payload))
        except Exception:
            values = "[]"
        self._lobby.output.line(f"[{self._world.scheduler.now:.4f}, {self._lost}, {values}]", self.channel)

    def ended(self, emission: Emission, match: Any) -> None:
        """An emission is over."""

    def close(self) -> None:
        """End the answers that are followed."""
        self._event.subscriptions.pop(self, None)
        self._lobby.holdings.unregister(self)


def _send(world: World, this: Value, channel: str, text: str) -> None:
    lobby = own_lobby(world, this)
    if lobby.connected:
        lobby.output.line(text, channel)


def _slot_text(world: World, this: Value, path: str) -> str:
    steps = parse_path(world, path)
    try:
        return _kind_text(world, make_reader(world, this, steps)())
    except Unreadable as refusal:
        holder = this if len(steps) == 1 else make_reader(world, this, steps[:-1])()
        if steps[-1].index is not None:
            return _error_lines("Lookup", [str(refusal)])
        if world.peek_obj(holder).find(steps[-1].name) is not None:
            return f'["function", {escaped(path)}]'
        raise errors.LookupFailed(steps[-1].name, holder) from None


def _kind_text(world: World, value: Value) -> str:
    if _is_plain(value):
        return f'["", {_text(world, value)}]'
    classes = [world.type_name(value)] + [world.type_name(proto) for proto in value.protos]
    return f'["object", {escaped(world.printable(value))}, [{", ".join(map(escaped, dict.fromkeys(classes)))}]]'


def _error_text(world: World, error: Exception) -> str:
    if isinstance(error, Unreadable):
        return _error_lines("Lookup", [str(error)])
    kind = error.kind if isinstance(error, errors.Raised) else ""
    return _error_lines(kind, world.describe(error))


def _error_lines(kind: str, lines: list[str]) -> str:
    return f'["error", {escaped(kind)}, [{", ".join(map(escaped, lines))}]]'


def _is_plain(value: Value) -> bool:
    return value is None or value.__class__ is float or isinstance(
        value, FloatObject | String | Truth | Nil | Void | List | Tuple | Dictionary | BinaryObject
    )


def _text(world: World, value: Value) -> str:
    """A value as a literal, with all digits of numbers."""
    return _Literal(world, MAX_LENGTH).text(value)


class _Literal(NestedText):
    """Writes one value as a literal of urbiscript.  The bytes of a Binary are not counted."""

    between = " => "

    def text(self, value: Value, depth: int = 0) -> str:
        if isinstance(value, BinaryObject):
            head = f" {value.keywords}" if value.keywords else ""
            return f"BIN {len(value.content)}{head}\n{value.data}"
        return super().text(value, depth)

    def dictionary(self, members: list[str]) -> str:
        return f"[{', '.join(members) or '=>'}]"

    def string(self, text: str) -> str:
        return escaped(text)

    def plain(self, value: Value) -> str:
        if isinstance(value, FloatObject):
            value = value.value
        if value.__class__ is float:
            return repr(value)
        if isinstance(value, String):
            return escaped(value.s)
        if isinstance(value, Truth):
            return "true" if value.value else "false"
        if value is None or isinstance(value, Void | Nil):
            return "nil"
        shown = self.world.printable(value)
        return shown if _WORD.fullmatch(shown) and isinstance(value, Obj) else escaped(shown)


def _told_after(world: World, holder: Value, name: str) -> Value:
    """What a device tells of its last write by a slot; nil for what has no such slot."""
    if world.peek_obj(holder).find(name) is None:
        return world.nil
    return make_slot_reader(world)(holder, name)


def install(world: World, programs: Any) -> None:
    """Install ``answerSet`` and ``answerWrites``, which keep the compiled assignments."""
    table = Table("Lobby")
    assignments: dict[str, tuple[Value, list[PathStep]]] = {}

    def assignment(this: Value, path: str) -> tuple[Value, list[PathStep]]:
        """The function that assigns to a path, and the steps of the path.  Raises an urbiscript error."""
        known = assignments.get(path)
        if known is None:
            steps = parse_path(world, path)
            known = programs.evaluate(f"function (_value) {{ {path} = _value }}", this), steps
            if len(assignments) >= MAX_ASSIGNMENTS:
                assignments.clear()
            assignments[path] = known
        return known

    @table.primitive("answerSet")
    def answer_set(world: World, this: Value, channel: str, path: str, value: Value) -> None:
        """Write a slot by its path, such as ``motor6.val``, and send ``["", nil]`` or the error on a channel."""
        text = '["stopped"]'
        try:
            assign, steps = assignment(this, path)
            if len(steps) == 1:
                refuse_device(this, steps, path)
            with _Answering(world, this, channel):
                world.invoke(assign, this, (value,))
                text = '["", nil]'
        except Exception as error:
            text = _error_text(world, error)
        finally:
            _send(world, this, channel, text)

    def target(this: Value, path: str) -> tuple[Value, Value]:
        """The function that assigns to a path, and what holds its slot.  Raises an urbiscript error if nothing does."""
        assign, steps = assignment(this, path)
        holder = make_reader(world, this, steps[:-1])()
        if steps[-1].index is None and world.peek_obj(holder).find(steps[-1].name) is None:
            raise errors.LookupFailed(steps[-1].name, holder)
        refuse_device(holder, steps, path)
        return assign, holder

    def refuse_device(holder: Value, steps: list[PathStep], path: str) -> None:
        """Raise an urbiscript error if a path names a device, which a value would hide from this connection."""
        found = None if steps[-1].index is not None else world.peek_obj(holder).find(steps[-1].name)
        if found is not None and isinstance(getattr(found.slots[steps[-1].name], "kind", None), type):
            raise errors.primitive(f"{path} is a device: write one of its slots, such as {path}.val")

    @table.primitive("answerWrites")
    def answer_writes(world: World, this: Value, channel: str, paths: List, values: List) -> None:
        """Write slots by their paths, all in one turn, so that the values go out with one tick of the bus, and send on
        a channel for each what its device tells of it: ``["", [[applied, limitedBy], ...]]``, nil where it tells
        nothing; or the error.  No slot is written if one of the paths has no slot.
        """
        text = '["stopped"]'
        try:
            writes = [(*target(this, world.text(path)), value) for path, value in zip(paths.l, values.l, strict=True)]
            with _Answering(world, this, channel):
                for assign, _, value in writes:
                    world.invoke(assign, this, (value,))
                told = [[_told_after(world, holder, name) for name in OUTCOME] for _, holder, _ in writes]
                text = _kind_text(world, world.new_list([world.new_list(row) for row in told]))
        except Exception as error:
            text = _error_text(world, error)
        finally:
            _send(world, this, channel, text)

    table.install(world, prototype(world, "Lobby"))
