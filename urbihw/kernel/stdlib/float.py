"""Float: numbers.  The compiler inlines most operators and comparisons; this module serves explicit calls, operators
that Python defines differently, and numbers with slots of their own (``FloatObject``)."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.plain import float_text
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.values import FloatObject
from urbihw.kernel.runtime.world import World
from urbihw.kernel.value import Value

TABLE = Table("Float")
WORD_SIZE = 64
"""The size of the results of shifts, in bits."""
PROTOS = {"Float": ("Comparable", "Orderable", "RangeIterable")}

NOTES = {
    "Float": "Numbers: all are 64-bit floating point, including integers.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


def number(world: World, value: Value, index: int | None, routine: str) -> float:
    """The number that a value represents.  Raises the type error of ``routine``."""
    return value if value.__class__ is float else world.as_float(value, index, routine)


def integer(world: World, value: Value, index: int | None, routine: str) -> int:
    """An integer.  Raises BadInteger for other numbers."""
    found = number(world, value, index, routine)
    if not found.is_integer():
        raise errors.bad_number("BadInteger", f"expected integer, got {float_text(found)}", found, routine)
    return int(found)


def whole(world: World, value: float) -> int:
    """A number of iterations.  Raises BadInteger, with the name of the running routine, for negative and fractional
    numbers.
    """
    if not value.is_integer() or value < 0:
        raise errors.bad_number("BadInteger", f"expected non-negative integer, got {float_text(value)}", value)
    return int(value)


# ---------------------------------------------------------------- operators


def _power(a: float, b: float) -> float:
    try:
        return math.pow(a, b)
    except OverflowError:
        return -math.inf if a < 0 and b % 2 == 1 else math.inf
    except ValueError:
        return math.inf if a == 0 else math.nan


def _modulo(a: float, b: float) -> float:
    if b == 0:
        raise errors.primitive("modulo by 0", "%")
    return math.fmod(a, b) if math.isfinite(a) else math.nan


def _divide(a: float, b: float) -> float:
    if b == 0:
        raise errors.primitive("division by 0", "/")
    return a / b


def _binary(name: str, compute: Callable[[float, float], Any], doc: str) -> None:
    def make(world: World) -> Any:
        def run(this: Value, that: Value) -> Value:
            if this.__class__ is not float:
                this = world.as_float(this, None, name)
            if that.__class__ is not float:
                if that.assigns_to_members:
                    return that.after_number(this, name)
                that = world.as_float(that, 1, name)
            return compute(this, that)

        return run

    make.__doc__ = doc
    TABLE.raw(name, least=1)(make)


def _comparison(name: str, compute: Callable[[float, float], bool], doc: str) -> None:
    def make(world: World) -> Any:
        true, false = world.true, world.false

        def run(this: Value, that: Value) -> Value:
            return true if compute(number(world, this, None, name), number(world, that, 1, name)) else false

        return run

    make.__doc__ = doc
    TABLE.raw(name, least=1)(make)


def _unsigned(world: World, value: Value, index: int | None, name: str) -> int:
    """An operand of a bitwise operator, which is unsigned (manual, release notes of 2.0 beta 4)."""
    return whole(world, number(world, value, index, name))


def _bits(name: str, compute: Callable[[int, int], int], doc: str) -> None:
    def make(world: World) -> Any:
        return lambda this, that: float(compute(_unsigned(world, this, None, name), _unsigned(world, that, 1, name)))

    make.__doc__ = doc
    TABLE.raw(name, least=1)(make)


def _signed(name: str, unary: Callable[[float], float], binary: Callable[[float, float], float], doc: str) -> None:
    def make(world: World) -> Any:
        def run(this: Value, *args: Value) -> Value:
            if not args:
                return unary(number(world, this, None, name))
            return binary(number(world, this, None, name), number(world, args[0], 1, name))

        return run

    make.__doc__ = doc
    TABLE.raw(name, least=0, most=1)(make)


_signed("+", operator.pos, operator.add, "The sum; without argument, this number.")
_signed("-", operator.neg, operator.sub, "The difference; without argument, the opposite.")
_binary("*", operator.mul, "The product.")
_binary("/", _divide, "The quotient; raises ``division by 0``.")
_binary("%", _modulo, "The rest of the division, of the sign of this number; raises ``modulo by 0``.")
_binary("**", _power, "This number to the power of the argument.")
_comparison("<", operator.lt, "Whether this is less than the argument.")
_comparison("<=", operator.le, "Whether this is the argument at most.")
_comparison(">", operator.gt, "Whether this is greater than the argument.")
_comparison(">=", operator.ge, "Whether this is the argument at least.")
_comparison("!=", operator.ne, "Whether the numbers differ.")
_bits("bitand", operator.and_, "The bits set in both.")
_bits("bitor", operator.or_, "The bits set in one at least.")
_bits("^", operator.xor, "The bits set in one only.")


@TABLE.raw("==", least=1)
def equal(world: World) -> Any:
    """Whether both are the same number; a number is never equal to a value of another type."""

    def run(this: Value, that: Value) -> Value:
        if isinstance(that, float | FloatObject):
            return world.boolean(number(world, this, None, "==") == number(world, that, 1, "=="))
        return world.false

    return run


@TABLE.primitive("~=")
def near(world: World, this: float, that: Value) -> bool:
    """Whether both numbers differ by less than one millionth."""
    other = number(world, that, 1, "~=")
    return this == other or abs(this - other) <= 1e-5


def _shift(name: str, shift: Callable[[int, int], int], doc: str) -> None:
    def make(world: World) -> Any:
        def run(this: Value, that: Value) -> float:
            bits, by = _unsigned(world, this, None, name), _unsigned(world, that, 1, name)
            return float(shift(bits, min(by, WORD_SIZE)) & (2**WORD_SIZE - 1))

        return run

    make.__doc__ = doc
    TABLE.raw(name, least=1)(make)


_shift("<<", operator.lshift, "The bits of this integer moved up, in 64 bits.")
_shift(">>", operator.rshift, "The bits of this integer moved down.")


@TABLE.raw("compl", least=0)
def complement(world: World) -> Any:
    """The one's complement of the lower 32 bits of this integer."""
    return lambda this: float(~_unsigned(world, this, None, "compl") & 0xFFFFFFFF)


@TABLE.primitive("++")
def successor(world: World, this: float) -> float:
    """This number plus one."""
    return this + 1.0


@TABLE.primitive("--")
def predecessor(world: World, this: float) -> float:
    """This number minus one."""
    return this - 1.0


# ---------------------------------------------------------------- functions of one number


def _function(name: str, compute: Callable[[float], float], doc: str) -> None:
    def run(world: World, this: float) -> float:
        return compute(this)

    run.__doc__ = doc
    TABLE.primitive(name)(run)


def _or_nan(compute: Callable[[float], float]) -> Callable[[float], float]:
    """A function of ``math`` that returns nan where Python raises a domain error."""

    def run(value: float) -> float:
        try:
            return compute(value)
        except ValueError:
            return math.nan
        except OverflowError:
            return math.inf

    return run


def _not_negative(compute: Callable[[float], float]) -> Callable[[float], float]:
    """A function that is defined for numbers from 0; it raises Primitive for negative ones."""

    def run(value: float) -> float:
        if value < 0:
            raise errors.primitive("argument has to be positive")
        return compute(value)

    return run


def _arc(compute: Callable[[float], float]) -> Callable[[float], float]:
    """An inverse trigonometric function; it raises Primitive for arguments outside -1..1."""

    def run(value: float) -> float:
        if abs(value) > 1:
            raise errors.primitive(f"argument has to be between -1 and 1, got {float_text(value)}")
        return compute(value)

    return run


def _log(value: float) -> float:
    return -math.inf if value == 0 else math.log(value)


def _finite(compute: Callable[[float], int]) -> Callable[[float], float]:
    """A rounding function that returns inf and nan unchanged."""
    return lambda value: float(compute(value)) if math.isfinite(value) else value


def _sign(value: float) -> float:
    return 1.0 if value > 0 else 0.0 if value == 0 else -1.0


def _round(value: float) -> int:
    size = math.floor(abs(value))
    size += abs(value) - size >= 0.5
    return size if value >= 0 else -size


_function("abs", abs, "The absolute value.")
_function("sin", _or_nan(math.sin), "The sine of an angle in radians.")
_function("cos", _or_nan(math.cos), "The cosine of an angle in radians.")
_function("tan", _or_nan(math.tan), "The tangent of an angle in radians.")
_function("asin", _arc(math.asin), "The arc sine, in radians; raises Primitive beyond -1 and 1.")
_function("acos", _arc(math.acos), "The arc cosine, in radians; raises Primitive beyond -1 and 1.")
_function("atan", math.atan, "The arc tangent, in radians.")
_function("exp", _or_nan(math.exp), "e to the power of this number.")
_function("log", _not_negative(_log), "The natural logarithm; that of 0 is -inf.  Raises Primitive for less.")
_function("sqrt", _not_negative(math.sqrt), "The square root; raises Primitive for less than 0.")
_function("sqr", lambda value: value * value, "The square.")
_function("ceil", _finite(math.ceil), "The next integer, up.")
_function("floor", _finite(math.floor), "The next integer, down.")
_function("trunc", _finite(math.trunc), "The next integer towards 0.")
_function("round", _finite(_round), "The nearest integer, half-way cases away from 0.")
_function("sign", _sign, "1, 0 or -1.")


@TABLE.primitive("atan2")
def atan2(world: World, this: float, x: float) -> float:
    """The angle of the point (x, this), in radians."""
    return math.atan2(this, x)


@TABLE.primitive("isNan")
def is_nan(world: World, this: float) -> bool:
    """Whether this is not a number."""
    return math.isnan(this)


@TABLE.primitive("isInf")
def is_inf(world: World, this: float) -> bool:
    """Whether this number is infinite."""
    return math.isinf(this)


# ---------------------------------------------------------------- making and converting


@TABLE.primitive("clone")
def clone(world: World, this: Value) -> Value:
    """A new number of the same value, whose only prototype is this number; 0 for Float itself."""
    if this is world.float_proto:
        return 0.0 + 0.0
    return FloatObject(world, [this], this) if this.__class__ is float else this.clone()


@TABLE.primitive("asFloat")
def as_float(world: World, this: float) -> float:
    """Returns this number itself."""
    return this


@TABLE.primitive("asString", "asPrintable", "asToplevelPrintable")
def as_string(world: World, this: float) -> str:
    """All digits if the number is integral and fits into 64 bits, else six significant digits."""
    return float_text(this)


@TABLE.primitive("hex")
def hexadecimal(world: World, this: float) -> str:
    """The hexadecimal digits of this integer."""
    return f"{integer(world, this, None, 'format') & 0xFFFFFFFFFFFFFFFF:x}"


@TABLE.primitive("inf")
def inf(world: World, this: Value) -> float:
    """Infinity, greater than all other numbers."""
    return math.inf + 0.0


@TABLE.primitive("nan")
def nan(world: World, this: Value) -> float:
    """Not a number: it is not equal to any value, including itself."""
    return math.nan + 0.0


@TABLE.primitive("pi")
def pi(world: World, this: Value) -> float:
    """The number pi, about 3.14159."""
    return math.pi + 0.0
