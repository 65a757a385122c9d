"""The error tree of the kernel.

::

    ThrownError              a urbiscript value, thrown by ``throw`` or by native code
      Raised                 raised by native code: a kind of Exception and its arguments, built into an object only
                             on demand
        LookupFailed         a slot was not found
        ToldBefore           an error that is not reported again
        TooDeep, StatementTooLong  a statement that cannot be compiled

``sched.signals`` has the exceptions that unwind a job without being errors.
"""

from __future__ import annotations

from typing import Any


class ThrownError(Exception):
    """A value thrown by urbiscript code; ``value`` is the thrown value."""

    __slots__ = ("value",)

    def __init__(self, value: Any) -> None:
        super().__init__()
        self.value = value


class Raised(ThrownError):
    """An exception raised by native code: ``kind`` is a slot of Exception, ``args`` are the arguments of its
    constructor.

    The routine in the message is that of the urbiscript call which led here, unless ``routine`` is given.
    """

    __slots__ = ("kind", "message", "routine", "slots")

    def __init__(self, kind: str, message: str, routine: str | None = "", **slots: Any) -> None:
        Exception.__init__(self)
        self.value = None
        self.kind = kind
        self.message = message
        self.routine = routine
        self.slots = slots


class LookupFailed(Raised):
    """A slot was not found; ``target`` is the object of the lookup, None if it is unknown."""

    __slots__ = ("target",)

    def __init__(self, name: str, target: Any) -> None:
        Raised.__init__(self, "Lookup", "lookup failed: " + name, None, name=name)
        self.target = target


class ToldBefore(Raised):
    """An error of a kind that the connection has been told: it ends the statement, and is not reported again."""


class TooDeep(Raised):
    """A statement nests deeper than can be compiled; a caller that knows its location converts the error to a syntax
    error.
    """

    def __init__(self) -> None:
        super().__init__("Scheduling", TOO_DEEP, None)


class StatementTooLong(Raised):
    """A statement is longer than can be compiled; a caller that knows its location converts the error to a syntax
    error.
    """

    def __init__(self) -> None:
        super().__init__("Scheduling", TOO_LONG, None)


class MovementRefused(Raised):
    """A movement is not allowed now; the write that caused it is undone."""

    def __init__(self, message: str) -> None:
        super().__init__("Primitive", message, None)


class MovementStopped(MovementRefused):
    """A statement that began before a stop tried to move a stopped device; a program continues only if it catches this
    error.
    """


TOO_DEEP = "statement too deeply nested"
TOO_LONG = "statement too long: make several of it"


def lookup_failed(name: str, target: Any = None) -> Raised:
    """``lookup failed: name``; the message suggests a similar slot of ``target`` when it is read."""
    return LookupFailed(name, target)


def unexpected_void() -> Raised:
    """``unexpected void``: void was used where a value is required."""
    return Raised("UnexpectedVoid", "unexpected void", None)


def arity(given: int, least: int, most: int | None = None, routine: str | None = "") -> Raised:
    """``name: expected N arguments, given M``; ``most`` None stands for the same as ``least``, -1 for no limit."""
    if most is None or most == least:
        wanted = f"{least} argument{'s' if least > 1 else ''}"
    elif most < 0:
        wanted = f"at least {least} argument{'s' if least > 1 else ''}"
    else:
        wanted = f"between {least} and {most} argument{'s' if most > 1 else ''}"
    return Raised("Arity", f"expected {wanted}, given {given}", routine, effective=given, min=least, max=most)


def primitive(message: str, routine: str | None = "") -> Raised:
    """``name: message``, raised by a primitive."""
    return Raised("Primitive", message, routine)


def redefinition(name: str) -> Raised:
    """``slot redefinition: name``."""
    return Raised("Redefinition", f"slot redefinition: {name}", None, name=name)


def constness() -> Raised:
    """``cannot modify const slot``."""
    return Raised("Constness", "cannot modify const slot", None)


def protected_slot(name: str) -> Raised:
    """The error for removing, replacing or hiding a slot that all connections need."""
    return Raised("Constness", f"{name} is for everybody: it cannot be removed, replaced or hidden", None)


def match_failure() -> Raised:
    """``pattern did not match``."""
    return Raised("MatchFailure", "pattern did not match", None)


def unfinalizable(routine: str | None = "") -> Raised:
    """``cannot inherit from a Finalizable without being a Finalizable too``."""
    return primitive("cannot inherit from a Finalizable without being a Finalizable too", routine)


def bad_number(kind: str, message: str, effective: Any = None, routine: str | None = "") -> Raised:
    """``name: message`` for the number ``effective``; ``kind`` is BadInteger, BadNumber, NegativeNumber or
    NonPositiveNumber.
    """
    return Raised(kind, message, routine) if effective is None else Raised(kind, message, routine, effective=effective)
