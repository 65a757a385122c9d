"""Slots, functions and objects of a robot as Python objects; ``robot`` adds the connection.

Reading a slot that holds a value (number, text, list, picture) returns it; one that holds an object or a function
returns something with slots of its own, or to be called.  Reading never calls a function, so completion moves no robot.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, Final
from weakref import ref

from urbihw.client.connection import Connection
from urbihw.client.errors import ClientError, SlotMissing
from urbihw.client.literals import (
    assignment_text,
    call_text,
    checked_path,
    checked_slot,
    literal,
    meaning_text,
    members_text,
    property_text,
    written_path,
)
from urbihw.client.session import NoPlainValue
from urbihw.client.shown import first_line, number_or, slots_text

COMMON_SLOTS: Final = (
    "var common = Object.slotNames | if (Global.hasSlot(\"Interface\")) { common += Interface.localSlotNames }"
)
"""Sets the names of the slots that every object has, or every device: those are no use in completion."""


class Slot:
    """A slot by its path, also one that is named like a method of ``Robot``: ``robot.slot("run")``.

    ``slot.get()`` reads it, ``slot.set(0.5, time=2)`` writes it, ``slot(1, 2)`` calls the function in it.
    """

    def __init__(self, connection: Connection, path: str) -> None:
        """Raises ValueError if the path is invalid."""
        self._connection = connection
        self.path = checked_path(path)

    def get(self) -> Any:
        """The value, or an object or a function.  Raises SlotMissing, UrbiError, or why there is no answer."""
        path = self.path
        answer = self._connection.ask(lambda dialect, channel: dialect.read(channel, path), self._connection.timeout)
        return wrapped(self._connection, answer, path)

    def set(self, value: Any, timeout: float | None = None, keep: bool = False, **modifiers: Any) -> None:
        """Write a value; ``set(0, sin=1, ampli=0.3)`` writes a trajectory, and returns at its end, if it has one,
        when the device has followed: its value stands, or half a second has passed.

        Raises UrbiError, TypeError for a value that urbiscript has not, or why there is no answer.  ``timeout`` in
        seconds, by default that of the connection, without modifiers; None: no limit.  ``keep`` as for ``Robot.run``.
        """
        path, text = checked_slot(self.path), literal(value)
        if not modifiers:
            limit = self._connection.timeout if timeout is None else timeout
            self._connection.ask(lambda dialect, channel: dialect.write(channel, path, text), limit, keep=keep)
            return
        body = assignment_text(path, text, modifiers)
        self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), timeout, keep=keep)

    def __call__(self, *args: Any, timeout: float | None = None, keep: bool = False) -> Any:
        """Call the function in the slot, and return its result.  Raises what ``get`` raises.

        ``timeout`` in seconds; None waits for the end.  ``keep`` as for ``Robot.run``.
        """
        body = call_text(self.path, args)
        answer = self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), timeout, keep=keep)
        return wrapped(self._connection, answer, "")

    def get_property(self, name: str) -> Any:
        """A property of the slot, such as ``blend``; None if it has none of this name.  Raises what ``get`` raises."""
        return evaluated(self._connection, property_text(self.path, name))

    @property
    def unit(self) -> str:
        """The unit of the value, such as ``rad``; "" if it has none."""
        return str(self.get_property("unit") or "")

    @property
    def min(self) -> float:
        """Smallest value that can be written, in its unit; -inf without a limit."""
        return number_or(self.get_property("rangemin"), -math.inf)

    @property
    def max(self) -> float:
        """Largest value that can be written, in its unit; inf without a limit."""
        return number_or(self.get_property("rangemax"), math.inf)

    @property
    def meaning(self) -> str:
        """What the value or function is, in the words of the server; "" if it says nothing."""
        return first_line(evaluated(self._connection, meaning_text(self.path)))

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.path}>"


class _Told:
    """The docstring of a class; of its instances what the server says of them, for ``help`` and notebooks."""

    def __init__(self, text: str, ask: Callable[[Any], str]) -> None:
        self._text = text
        self._ask = ask

    def __get__(self, instance: Any, owner: type) -> str:
        if instance is None:
            return self._text
        try:
            return self._ask(instance) or self._text
        except ClientError:
            return self._text


class UrbiFunction(Slot):
    __doc__ = _Told(
        "A function of the robot, such as ``robot.motor6.readRegister``; parentheses call it.",
        lambda function: function.meaning,
    )


class MemberIterator:
    """Iterates over the members that a group had when the iteration was made.

    Attributes:
        count: how many they are.
        is_fresh: whether no member was taken, and no length told.
    """

    def __init__(self, members: list[Any]) -> None:
        self._rest = iter(members)
        self.count = len(members)
        self.is_fresh = True

    def __iter__(self) -> MemberIterator:
        return self

    def __next__(self) -> Any:
        self.is_fresh = False
        return next(self._rest)


class UrbiObject:
    __doc__ = _Told(
        """An object of the robot, such as ``robot.motor6``: its attributes are its slots.

    Beside them there is only ``slot``; ``object["slot"]`` is the slot of that name, and ``object[6]`` a member.
    """,
        lambda device: slots_text(repr(device), device._slot_rows()),
    )

    _connection: Connection
    _path: str
    _printed: str
    _classes: tuple[str, ...]
    _iteration: ref[MemberIterator] | None = None
    """The iteration that was made last."""

    def __init__(self, connection: Connection, path: str, printed: str = "", classes: tuple[str, ...] = ()) -> None:
        for name, value in (("_connection", connection), ("_path", path), ("_printed", printed), ("_classes", classes)):
            object.__setattr__(self, name, value)

    def slot(self, name: str) -> Slot:
        """A slot by its name, or by its path from here."""
        return Slot(self._connection, f"{self._path}.{name}" if self._path else name)

    def __getattr__(self, name: str) -> Any:
        """The value of a slot.  Raises SlotMissing, which is an AttributeError, and what ``Slot.get`` raises."""
        if name.startswith("_"):
            raise AttributeError(f"{name}: for a slot with such a name there is .slot({name!r})")
        try:
            return self.slot(name).get()
        except SlotMissing as error:
            error.name, error.obj = name, self  # Python tells "Did you mean" from these
            raise

    def __setattr__(self, name: str, value: Any) -> None:
        """Write a slot.  Raises what ``Slot.set`` raises."""
        if name.startswith("_") or hasattr(type(self), name):
            raise AttributeError(f"{name} is no slot; for a slot with such a name there is [{name!r}]")
        self.slot(name).set(value)

    def __getitem__(self, key: str | int) -> Any:
        """The slot of a name or path, or the member with an index."""
        return self._at(key).get()

    def __setitem__(self, key: str | int, value: Any) -> None:
        """Write the slot of a name or path, or a member."""
        self._at(key).set(value)

    def __iter__(self) -> Iterator[Any]:
        """The members of a group, such as ``robot.motors``.  Raises TypeError for an object without members."""
        made = MemberIterator(self._members("cannot be iterated"))
        object.__setattr__(self, "_iteration", ref(made))
        return made

    def __len__(self) -> int:
        """The number of members of a group.  Raises TypeError for an object without members."""
        made = self._iteration() if self._iteration is not None else None
        if made is not None and made.is_fresh:
            # Python's list(group) makes an iteration, and then asks for the length of the group.
            made.is_fresh = False
            return made.count
        return len(self._members("has no length"))

    def __bool__(self) -> bool:
        """True, as of most objects of Python: an empty group is an object, too."""
        return True

    def _members(self, problem: str) -> list[Any]:
        try:
            members: list[Any] = evaluated(self._connection, members_text(self.urbiscript_path()))
        except SlotMissing:
            raise TypeError(f"{self!r} {problem}: it has no members") from None
        return members

    def _at(self, key: str | int) -> Slot:
        return self.slot(key) if isinstance(key, str) else Slot(self._connection, f"{self._path}[{int(key)}]")

    def urbiscript_path(self) -> str:
        """How it is written in urbiscript."""
        return written_path(checked_path(self._path))

    def __dir__(self) -> list[str]:
        """The slots that not every object has, for completion; none when the server does not answer."""
        found = {name for name in self._slot_names() if name.isidentifier() and not name.startswith("_")}
        methods = {name for name in vars(type(self)) if not name.startswith("_")} - {"urbiscript_path"}
        return sorted(found | methods | {"slot"})

    def _slot_names(self) -> set[str]:
        here = written_path(self._path)
        every, own, common = self._names(f"{COMMON_SLOTS} | [{here}.slotNames, {here}.localSlotNames, common]", 3)
        return every - common | own

    def _names(self, body: str, count: int) -> list[set[str]]:
        """So many lists of names, which an expression tells; empty ones when the server does not answer."""
        try:
            told = self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), 1.0)
            return [set(map(str, names)) for names in told] if len(told) == count else [set()] * count
        except (ClientError, TypeError):
            return [set()] * count

    def __repr__(self) -> str:
        """How the server prints it, and its class."""
        return f"<{self._classes[0] if self._classes else 'object'} {self._path or self._printed}>"

    def __eq__(self, other: object) -> bool:
        """Whether both have the same path on the same connection."""
        same = isinstance(other, UrbiObject) and self._connection is other._connection
        return same and isinstance(other, UrbiObject) and self._path == other._path

    def __hash__(self) -> int:
        return hash(self._path)

    def _repr_html_(self) -> str:
        """The slots of a device as a table, for notebooks."""
        from urbihw.client.shown import object_html

        return object_html(repr(self), self._slot_rows())

    def _slot_rows(self) -> list[list[str]]:
        """For each slot of a device name, value, unit, range and meaning; empty when the server does not tell."""
        body = f'if (System.hasSlot("slotTable")) System.slotTable({written_path(self._path)}) else []'
        try:
            rows = self._connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), 2.0)
        except ClientError:
            return []
        return [[*map(str, row)] for row in rows]


def evaluated(connection: Connection, body: str) -> Any:
    """The value of an expression that was made by this library.  Raises what ``Slot.get`` raises."""
    answer = connection.ask(lambda dialect, channel: dialect.evaluate(channel, body), connection.timeout)
    return wrapped(connection, answer, "")


def wrapped(connection: Connection, answer: Any, path: str) -> Any:
    """An answer as the program gets it: objects as ``UrbiObject``.  ``path`` is where it was read, "" for nowhere."""
    if isinstance(answer, NoPlainValue):
        if answer.kind == "function":
            return UrbiFunction(connection, path)
        return UrbiObject(connection, path or answer.printed, answer.printed, answer.classes)
    if isinstance(answer, list):
        return [wrapped(connection, member, "") for member in answer]
    if isinstance(answer, dict):
        return {key: wrapped(connection, member, "") for key, member in answer.items()}
    return answer
