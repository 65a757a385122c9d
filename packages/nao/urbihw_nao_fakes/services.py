"""How a service of NAOqi is declared here: a class whose methods are marked with their NAOqi name and signatures."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar

Run = TypeVar("Run", bound=Callable[..., Any])

MAIN_OBJECT = 1
"""Number of the object that a service itself is."""
FIRST_OBJECT = 1000
"""Number of the first object that a service hands out."""
FIRST_MEMBER = 100
"""Number of the first method or signal of an object; those below are common to all."""
REGISTER_EVENT, UNREGISTER_EVENT, META_OBJECT, TERMINATE = range(4)
GET_PROPERTY, SET_PROPERTY = 5, 6
"""Numbers of what all objects have."""
AUTHENTICATE = 8
"""The action of service 0 that logs in."""
DONE, REFUSED = 3, 1
"""States of a login."""
MODULES_PREFIX = "AL"
"""How the names of NAOqi's own modules begin."""
OF_MODULES = (("exit", "v", None), ("version", "s", "2.1.4.13"), ("ping", "b", True))
"""Methods that each of those has, with the signature of the result and the result.  ``exit`` ends no module here."""
_MARK = "naoqi_methods"


class Failed(Exception):
    """A method failed; the text goes to the caller."""


def as_failure(error: Exception) -> Failed:
    """What a caller hears of an exception of a method: NAOqi turns each one into an error answer."""
    return error if isinstance(error, Failed) else Failed(f"{type(error).__name__}: {error}")


@dataclass(frozen=True)
class Later:
    """Result of a method that blocks: the answer is sent as soon as ``ready`` says so, or fails if it raises."""

    ready: Callable[[], bool]
    value: Any = None


class Signal(NamedTuple):
    """A signal of a service: ``signature`` is that of its tuple of values."""

    name: str
    signature: str


class Property(NamedTuple):
    """A property of a service: ``signature`` is that of its value, ``first`` the value at the beginning."""

    name: str
    signature: str
    first: Any


class Declared(NamedTuple):
    """What `method` notes: the signatures of the parameters (a tuple) and of the result."""

    name: str
    parameters: str
    returns: str


@dataclass(frozen=True)
class Method:
    """A method of one service object, with its number; ``run`` gets the decoded arguments."""

    uid: int
    returns: str
    name: str
    parameters: str
    run: Callable[..., Any]


def method(name: str, parameters: str = "()", returns: str = "v") -> Callable[[Run], Run]:
    """Declare a method of a service: its NAOqi name, the signatures of its parameters and of its result.

    Several of them on one function declare overloads, or other names, in the order in which they stand.
    """

    def mark(run: Run) -> Run:
        setattr(run, _MARK, [Declared(name, parameters, returns), *getattr(run, _MARK, [])])
        return run

    return mark


class Service:
    """Base of the services, and of the objects that they hand out.

    A subclass sets ``name``, marks its methods with `method`, and has its signals and properties as class attributes
    (`Signal`, `Property`).  They are numbered from 100 on, in the order of the class body.

    Attributes:
        methods, signals, properties: the members by number.
        values: those of the properties, by name.
        calls: how often each method was called, by name.
        objects: what it has handed out, by number.
        number, thing: the service, and the object in it, that a message names.
    """

    name = ""

    def __init__(self) -> None:
        self.methods: dict[int, Method] = {}
        self.signals: dict[int, Signal] = {}
        self.properties: dict[int, Property] = {}
        self.values: dict[str, Any] = {}
        self.calls: Counter[str] = Counter()
        self.objects: dict[int, Service] = {}
        self.number, self.thing = 0, MAIN_OBJECT
        self.send_event: Callable[[Service, int, tuple[Any, ...]], None] = lambda *_: None
        for uid, (member, attribute) in enumerate(_members(type(self)), FIRST_MEMBER):
            if isinstance(member, Signal):
                self.signals[uid] = member
            elif isinstance(member, Property):
                self.properties[uid] = member
                self.values[member.name] = member.first
            else:
                run = getattr(self, attribute)
                self.methods[uid] = Method(uid, member.returns, member.name, member.parameters, run)
        if self.name.startswith(MODULES_PREFIX):
            own = {each.name for each in self.methods.values()}
            for name, returns, value in OF_MODULES:
                if name not in own:
                    uid = FIRST_MEMBER + len(self.methods) + len(self.signals) + len(self.properties)
                    self.methods[uid] = Method(uid, returns, name, "()", lambda value=value: value)

    def advance(self, now: float) -> None:
        """Time has passed; a service that does something by itself does it here."""

    def is_active(self) -> bool:
        """Whether ``advance`` must be called soon, without a call of a method."""
        return False

    def find_object(self, thing: int) -> Service:
        """The object of a message.  Raises Failed."""
        if thing in (0, MAIN_OBJECT):
            return self
        if thing not in self.objects:
            raise Failed(f"no object {thing}")
        return self.objects[thing]

    def find_method(self, uid: int) -> Method:
        """The method with a number.  Raises Failed."""
        if uid not in self.methods:
            raise Failed(f"no method {uid}")
        return self.methods[uid]

    def call(self, called: Method, *arguments: Any) -> Any:
        """Run one of its methods, and count it."""
        self.calls[called.name] += 1
        return called.run(*arguments)

    def find_property(self, key: int | str) -> Property:
        """The property with a number or a name.  Raises Failed."""
        for uid, each in self.properties.items():
            if key in (uid, each.name):
                return each
        raise Failed(f"no property {key}")

    def emit(self, signal: Signal, *values: Any) -> None:
        """Send a signal to all that listen."""
        for uid, each in self.signals.items():
            if each == signal:
                self.send_event(self, uid, values)

    def add_object(self, made: Service) -> None:
        """Number an object, so that a method can return its `reference`."""
        made.number, made.thing, made.send_event = self.number, FIRST_OBJECT + len(self.objects), self.send_event
        self.objects[made.thing] = made

    def reference(self) -> tuple[Any, ...]:
        """The value of signature ``o`` that names this object."""
        return self.describe(), self.number, self.thing

    def describe(self) -> tuple[Any, ...]:
        """The metaObject of the service."""
        methods: dict[int, Any] = {
            row.uid: (row.uid, row.returns, row.name, row.parameters, "", [], "")
            for row in (*COMMON, *self.methods.values())
        }
        signals = {uid: (uid, *signal) for uid, signal in self.signals.items()}
        properties = {uid: (uid, row.name, row.signature) for uid, row in self.properties.items()}
        return methods, signals, properties, self.name


def _members(kind: type) -> Iterator[tuple[Declared | Signal | Property, str]]:
    """What a class declares, and under which attribute; what a base declares comes first."""
    for base in reversed(kind.__mro__):
        for attribute, value in vars(base).items():
            if isinstance(value, Signal | Property):
                yield value, attribute
            for declared in getattr(value, _MARK, ()):
                yield declared, attribute


def _never_run() -> None:
    """The server itself carries out what all objects have."""


COMMON = (
    Method(REGISTER_EVENT, "L", "registerEvent", "(IIL)", _never_run),
    Method(UNREGISTER_EVENT, "v", "unregisterEvent", "(IIL)", _never_run),
    Method(TERMINATE, "v", "terminate", "(I)", _never_run),
    Method(META_OBJECT, "({I(Issss[(ss)]s)}{I(Iss)}{I(Iss)}s)", "metaObject", "(I)", _never_run),
    Method(GET_PROPERTY, "m", "property", "(m)", _never_run),
    Method(SET_PROPERTY, "v", "setProperty", "(mm)", _never_run),
)
"""What all objects have."""


def finite(value: Any) -> float:
    """A number.  Raises Failed for another value, and for inf and nan."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise Failed(f"{value!r:.40} is no number")
    return float(value)


def as_list(value: Any) -> list[Any]:
    """One value, or several: NAOqi takes both."""
    return list(value) if isinstance(value, list | tuple) else [value]
