"""The error tree of the kernel.

::

    UrbiError                an urbiscript value on its way up: thrown by ``throw`` or by native code
      Raised                 made by native code: a kind of Exception and its arguments, built into an object only if
                             somebody looks at it
        LookupFailed         a slot was not found
        TooDeep, TooLong     a statement that cannot be compiled
    KernelBug                our own fault, reported as such

``sched.signals`` holds what unwinds a job without being an error.
"""

from __future__ import annotations

from typing import Any


class UrbiError(Exception):
    """A value thrown by urbiscript code; ``value`` is what was thrown."""

    def __init__(self, value: Any) -> None:
        super().__init__()
        self.value = value


class Raised(UrbiError):
    """An exception raised by native code: ``kind`` is a slot of Exception, ``args`` are those of its constructor.

    The routine named in the message is that of the urbiscript call which led here, unless ``routine`` says otherwise.
    """

    def __init__(self, kind: str, message: str, routine: str | None = "", **slots: Any) -> None:
        super().__init__(None)
        self.kind = kind
        self.message = message
        self.routine = routine
        self.slots = slots


class LookupFailed(Raised):
    """A slot was not found; ``target`` is the value that was asked for it, None if there is none to tell of."""

    def __init__(self, name: str, target: Any) -> None:
        super().__init__("Lookup", f"lookup failed: {name}", None, name=name)
        self.target = target


class TooDeep(Raised):
    """A statement nests deeper than can be compiled; who knows where it stands makes a syntax error of it."""

    def __init__(self) -> None:
        super().__init__("Scheduling", TOO_DEEP, None)


class TooLong(Raised):
    """A statement is longer than can be compiled; who knows where it stands makes a syntax error of it."""

    def __init__(self) -> None:
        super().__init__("Scheduling", TOO_LONG, None)


class Refused(Raised):
    """Something may not move now; a write that fails by it is taken back."""

    def __init__(self, message: str) -> None:
        super().__init__("Primitive", message, None)


class Stopped(Refused):
    """A statement that began before a stop wants to move what was stopped; only who catches this may go on."""


TOO_DEEP = "statement too deeply nested"
TOO_LONG = "statement too long: make several of it"


class KernelBug(Exception):
    """Something that cannot happen did; always our fault, never the user's."""


def lookup_failed(name: str, target: Any = None) -> Raised:
    """``lookup failed: name``; whoever looks at it is told what slot of ``target`` may have been meant."""
    return LookupFailed(name, target)


def unexpected_void() -> Raised:
    """``unexpected void``: a value was needed."""
    return Raised("UnexpectedVoid", "unexpected void", None)


def arity(given: int, least: int, most: int | None = None, routine: str | None = "") -> Raised:
    """``name: expected N arguments, given M``; ``most`` None is the same as ``least``, -1 is no limit."""
    if most is None or most == least:
        wanted = f"{least} argument{'s' if least > 1 else ''}"
    elif most < 0:
        wanted = f"at least {least} argument{'s' if least > 1 else ''}"
    else:
        wanted = f"between {least} and {most} argument{'s' if most > 1 else ''}"
    return Raised("Arity", f"expected {wanted}, given {given}", routine, effective=given, min=least, max=most)


def primitive(message: str, routine: str | None = "") -> Raised:
    """``name: message`` raised by a built-in routine."""
    return Raised("Primitive", message, routine)


def redefinition(name: str) -> Raised:
    """``slot redefinition: name``."""
    return Raised("Redefinition", f"slot redefinition: {name}", None, name=name)


def constness() -> Raised:
    """``cannot modify const slot``."""
    return Raised("Constness", "cannot modify const slot", None)


def owed(name: str) -> Raised:
    """A slot that all connections need cannot be removed, replaced or hidden."""
    return Raised("Constness", f"{name} is for everybody: it cannot be removed, replaced or hidden", None)


def match_failure() -> Raised:
    """``pattern did not match``."""
    return Raised("MatchFailure", "pattern did not match", None)


def unfinalizable(routine: str | None = "") -> Raised:
    """``cannot inherit from a Finalizable without being a Finalizable too``."""
    return primitive("cannot inherit from a Finalizable without being a Finalizable too", routine)


def bad_number(kind: str, message: str) -> Raised:
    """``name: message`` about a number; kind is BadInteger, BadNumber, NegativeNumber or NonPositiveNumber."""
    return Raised(kind, message)
