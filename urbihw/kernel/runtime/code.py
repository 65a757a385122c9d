"""Executables: urbiscript functions (``Code``) and built-in ones (``Primitive``).

Generated code calls an executable by the number of arguments, ``f.c2(this, a, b)``, when ``f.strict``; a lazy
executable (without formal arguments, or using ``call``) takes a call message instead.  A function of exactly two
arguments is a ``Code2`` whose ``c2`` *is* the compiled Python function, so the usual call costs one attribute look-up.
Any other number of arguments goes through ``call``, which checks the number, fills in defaults and collects the rest.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

from urbihw.kernel import errors
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.value import Value

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World


class _Missing:
    """Represents an argument that was not given, until its default is computed."""


MISSING: Any = _Missing()

Direct = tuple[Callable[..., Any] | None, Callable[..., Any] | None, Callable[..., Any] | None]
"""The functions that run a built-in with zero, one and two arguments; None where there is none."""


class Executable(Obj):
    """An object that runs when called.

    ``strict``: it takes values and not a call message.  ``takes_text``: its first argument may be a Python str instead
    of a String, so that a literal such as the key in ``d["key"]`` need not become an object first.

    ``strict`` is an instance attribute although it is the same for all objects of a class: generated code reads it at
    each call, and CPython reads instance attributes faster.
    """

    __slots__ = ("strict", "takes_text")
    runs = True
    takes_values = True

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.strict = self.takes_values
        self.takes_text = False

    def peek(self) -> Value:
        """The value that a read of the slot gives, if this is a variable; None for a function, which would run."""
        return None

    def call(self, this: Value, args: tuple[Value, ...]) -> Value:
        """Run with evaluated arguments; raises the arity error when their number is wrong."""
        raise NotImplementedError

    def takes(self, given: int) -> bool:
        """Whether a call with so many arguments has no arity error, as far as is known before the call."""
        return True

    def call_lazy(self, message: Value) -> Value:
        """Run a lazy executable with a call message."""
        raise NotImplementedError

    def c0(self, this: Value) -> Value:
        """Call the function without arguments."""
        return self.call(this, ())

    def c1(self, this: Value, a: Value) -> Value:
        """Call with one argument."""
        return self.call(this, (a,))

    def c2(self, this: Value, a: Value, b: Value) -> Value:
        """Call with two arguments."""
        return self.call(this, (a, b))

    def c3(self, this: Value, a: Value, b: Value, c: Value) -> Value:
        """Call with three arguments."""
        return self.call(this, (a, b, c))

    def cn(self, this: Value, *args: Value) -> Value:
        """Call with any number of arguments."""
        return self.call(this, args)


class Getter(Executable):
    """Makes a plain value callable: a call without arguments gives the value, one with arguments is a call of the
    value's operator ``()`` (manual, release notes of 2.0 beta 3).
    """

    __slots__ = ("value",)

    def __init__(self, world: World, value: Value) -> None:
        super().__init__(world, [])
        self.value = value

    def call(self, this: Value, args: tuple[Value, ...]) -> Value:
        """The value, or the answer of its operator."""
        return call_value(self.world, self.value, args)


def call_value(world: World, value: Value, args: tuple[Value, ...], routine: str = "") -> Value:
    """Call a value that is no executable: without arguments it is the result, else its operator ``()`` answers.

    Raises the arity error, about ``routine``, if there are arguments and no operator.
    """
    if not args:
        return value
    if world.peek_obj(value).find("()") is None:
        raise errors.arity(len(args), 0, routine=routine)
    return ObjectCall(world, value).call(value, args)


class ObjectCall(Executable):
    """The operator ``()`` of an object, for built-ins that call a function: ``list.map(object)``."""

    __slots__ = ("target",)

    def __init__(self, world: World, target: Value) -> None:
        super().__init__(world, [])
        self.target = target

    def call(self, this: Value, args: tuple[Value, ...]) -> Value:
        """Let the operator answer; its ``this`` is the object."""
        return self.world.invoke(self.world.get_slot(self.target, "()"), self.target, args, "()")


class FunctionDescription(Protocol):
    """The compiler's description of a function literal.

    ``least`` and ``most`` are the minimum and maximum number of arguments (most -1: any), ``lazy``: it has no formals,
    ``uses_call``: it needs the call message, ``node`` is its syntax for printing and comparing.
    """

    least: int
    most: int
    lazy: bool
    uses_call: bool
    closure: bool
    formals: int
    node: Any


class Code(Executable):
    """An urbiscript function or closure: a compiled Python function and the description of its literal.

    The Python function takes ``this``, then the call message if it uses one, then one value per formal (``MISSING``
    where a default is to be computed; a List for a variadic last one).
    """

    __slots__ = ("fn", "info")

    def __init__(self, world: World, fn: Callable[..., Any], info: FunctionDescription) -> None:
        super().__init__(world, [world.code_proto])
        self.fn = fn
        self.info = info

    def call(self, this: Value, args: tuple[Value, ...]) -> Value:
        """Run with evaluated arguments."""
        info = self.info
        if info.lazy or info.uses_call:
            return self.call_lazy(self.world.call_message(self, this, args))
        return self.fn(this, *self._fill(args))

    def takes(self, given: int) -> bool:
        """Whether it has so many formals, or may have, or takes a call message."""
        return self.info.lazy or self.info.least <= given and (self.info.most < 0 or given <= self.info.most)

    def call_lazy(self, message: Value) -> Value:
        """Run with a call message; strict formals are evaluated from it."""
        if self.info.lazy:
            return self.fn(message.target, message)
        values = [argument.force() for argument in message.args]
        for value in values:
            if value is self.world.void:
                raise errors.unexpected_void()
        return self.fn(message.target, message, *self._fill(tuple(values)))

    def call_with(self, message: Value, this: Value, args: tuple[Value, ...]) -> Value:
        """Run a function that uses the call message, with another message than that of the call."""
        return self.fn(this, message) if self.info.lazy else self.fn(this, message, *self._fill(args))

    def _fill(self, args: tuple[Value, ...]) -> tuple[Any, ...]:
        info = self.info
        given = len(args)
        if given < info.least or (info.most >= 0 and given > info.most):
            raise errors.arity(given, info.least, info.most)
        if info.most < 0:
            fixed = info.formals - 1
            rest = self.world.new_list(list(args[fixed:]))
            return args[:fixed] + (MISSING,) * (fixed - given) + (rest,)
        return args + (MISSING,) * (info.formals - given)


class LazyCode(Code):
    """A function that takes a call message instead of values."""

    __slots__ = ()
    takes_values = False


class Code0(Code):
    """A function of no argument."""

    __slots__ = ("c0",)


class Code1(Code):
    """A function of one argument."""

    __slots__ = ("c1",)


class Code2(Code):
    """A function of two arguments."""

    __slots__ = ("c2",)


class Code3(Code):
    """A function of three arguments."""

    __slots__ = ("c3",)


def make_code(world: World, fn: Callable[..., Any], info: FunctionDescription) -> Code:
    """The Code for a compiled function."""
    if info.lazy or info.uses_call:
        return LazyCode(world, fn, info)
    if info.least == info.most:
        if info.least == 0:
            code0 = Code0(world, fn, info)
            code0.c0 = fn  # type: ignore[method-assign]
            return code0
        if info.least == 1:
            code1 = Code1(world, fn, info)
            code1.c1 = fn  # type: ignore[method-assign]
            return code1
        if info.least == 2:
            code2 = Code2(world, fn, info)
            code2.c2 = fn  # type: ignore[method-assign]
            return code2
        if info.least == 3:
            code3 = Code3(world, fn, info)
            code3.c3 = fn  # type: ignore[method-assign]
            return code3
    return Code(world, fn, info)


class Primitive(Executable):
    """A built-in function: ``fn(this, *args)`` in Python, with the minimum and the maximum number of arguments.

    ``source`` is the original Python function; its docstring is the help text of the built-in.
    """

    __slots__ = ("fn", "least", "most", "name", "source")

    def __init__(self, world: World, name: str, fn: Callable[..., Any], least: int, most: int) -> None:
        super().__init__(world, [world.primitive_proto])
        self.name = name
        self.fn = self.source = fn
        self.least = least
        self.most = most

    def call(self, this: Value, args: tuple[Value, ...]) -> Value:
        """Run with evaluated arguments."""
        given = len(args)
        if given < self.least or (self.most >= 0 and given > self.most):
            raise errors.arity(given, self.least, self.most)
        return self.fn(this, *args)

    def takes(self, given: int) -> bool:
        """Whether the built-in takes so many arguments."""
        return self.least <= given and (self.most < 0 or given <= self.most)


class LazyPrimitive(Primitive):
    """A built-in that takes a call message: ``fn(message)``."""

    __slots__ = ()
    takes_values = False

    def call(self, this: Value, args: tuple[Value, ...]) -> Value:
        """Run with evaluated arguments, wrapped in a call message."""
        return self.call_lazy(self.world.call_message(self, this, args))

    def call_lazy(self, message: Value) -> Value:
        """Run with a call message."""
        given = len(message.args)
        if given < self.least or (self.most >= 0 and given > self.most):
            raise errors.arity(given, self.least, self.most)
        return self.fn(message)


class DirectPrimitive(Primitive):
    """A built-in with faster calls for some numbers of arguments: Python functions replace ``c0`` to ``c2``."""

    __slots__ = ("c0", "c1", "c2")

    def __init__(
        self, world: World, name: str, fn: Callable[..., Any], least: int, most: int, direct: Direct
    ) -> None:
        super().__init__(world, name, fn, least, most)
        self.fill(fn, direct)

    def fill(self, fn: Callable[..., Any], direct: Direct) -> None:
        """Set the functions that run it."""
        self.fn = fn
        self.c0 = direct[0] or super().c0  # type: ignore[method-assign]
        self.c1 = direct[1] or super().c1  # type: ignore[method-assign]
        self.c2 = direct[2] or super().c2  # type: ignore[method-assign]


def make_primitive(
    world: World, name: str, fn: Callable[..., Any], least: int, most: int, direct: Direct | None = None
) -> Primitive:
    """The Primitive for a Python function.  A function with a fixed small number of arguments is called directly."""
    if direct is None and least == most < 3:
        direct = (fn if most == 0 else None, fn if most == 1 else None, fn if most == 2 else None)
    if direct is None or not any(direct):
        return Primitive(world, name, fn, least, most)
    return DirectPrimitive(world, name, fn, least, most, direct)
