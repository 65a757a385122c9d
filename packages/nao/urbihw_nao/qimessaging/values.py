"""Values to bytes and back, little-endian: see the table of ``signatures`` for the types.

A string or raw value is its length (u32) and its bytes, a list or map its count (u32) and its elements, a struct its
fields one after the other, a dynamic value its signature as a string and then the value.

What comes from the other side is never trusted: no length may exceed the bytes that are there, and no count either, so
that nothing is allocated for a number alone; and the levels of nesting are bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Any, Final

from urbihw.buses.errors import BadFrame, BadValue
from urbihw_nao.qimessaging.metatype import META_OBJECT
from urbihw_nao.qimessaging.signatures import DEEPEST, Type, parse

_NUMBERS: Final = {
    "c": Struct("<b"), "C": Struct("<B"), "w": Struct("<h"), "W": Struct("<H"), "i": Struct("<i"), "I": Struct("<I"),
    "l": Struct("<q"), "L": Struct("<Q"), "f": Struct("<f"), "d": Struct("<d"),
}  # fmt: skip
_BITS: Final = {"c": 8, "w": 16, "i": 32, "l": 64}
_COUNT: Final = Struct("<I")
_OBJECT: Final = parse(f"({META_OBJECT}II)")
"""An object of the other side: what it offers, its service and its number there."""


# ---------------------------------------------------------------- reading


class QiValueReader:
    """Reads values from the bytes of a message; ``at`` is where the next one begins."""

    def __init__(self, data: bytes, elements: int | None = None) -> None:
        """``elements`` bounds those of all lists and maps together, the fields of structs that take no bytes, and the
        letters of dynamic signatures; None for the bytes of the message."""
        self.data = data
        self.at = 0
        self._most = self._left = len(data) if elements is None else elements

    def read(self, kind: Type, depth: int = 0) -> Any:
        """The next value, of this type.  Raises BadFrame."""
        letter = kind.kind
        if (number := _NUMBERS.get(letter)) is not None:
            return number.unpack(self._bytes(number.size))[0]
        if depth > DEEPEST:
            raise BadFrame("values too deep in each other")
        match letter:
            case "m":
                signature = self._text()
                # As ``_spend`` does; most values of a robot come this way.
                self._left -= len(signature)
                if self._left < 0:
                    raise self._too_many()
                return self.read(parse(signature), depth + 1)
            case "s":
                return self._text()
            case "[":
                (part,) = kind.parts
                return [self.read(part, depth + 1) for _ in range(self._count())]
            case "(":
                began = self.at
                fields = tuple([self.read(part, depth + 1) for part in kind.parts])
                self._spend(max(0, len(fields) - (self.at - began)))
                return fields
            case "{":
                key, value = kind.parts
                rows = range(self._count())
                return {_key(self.read(key, depth + 1)): self.read(value, depth + 1) for _ in rows}
            case "b":
                return self._bytes(1) != b"\0"
            case "r":
                return self._bytes(self._length())
            case "o":
                return self.read(_OBJECT, depth + 1)
            case "v":
                return None
            case _:
                raise BadFrame("a value of an unknown type")

    def _bytes(self, size: int) -> bytes:
        end = self.at + size
        if end > len(self.data):
            raise BadFrame(f"a value ends {end - len(self.data)} bytes behind its message")
        found = self.data[self.at : end]
        self.at = end
        return found

    def _length(self) -> int:
        found: int = _COUNT.unpack(self._bytes(4))[0]
        return found

    def _count(self) -> int:
        found = self._length()
        self._spend(found)
        return found

    def _spend(self, elements: int) -> None:
        self._left -= elements
        if self._left < 0:
            raise self._too_many()

    def _too_many(self) -> BadFrame:
        return BadFrame(f"more than {self._most} elements in a message of {len(self.data)} bytes")

    def _text(self) -> str:
        return self._bytes(self._length()).decode("utf-8", "replace")


def _key(value: Any) -> Any:
    try:
        hash(value)
    except TypeError as error:
        raise BadFrame("a map with keys that are no keys") from error
    return value


def decode(signature: str, data: bytes, elements: int | None = None) -> Any:
    """The value of a message of at most so many elements (see ``QiValueReader``).  Bytes behind it are left alone:
    newer servers add fields.  Raises BadFrame."""
    return QiValueReader(data, elements).read(parse(signature))


# ---------------------------------------------------------------- writing


def encode(signature: str, value: Any) -> bytes:
    """The bytes of a value.  Raises BadValue when it is not of this type."""
    parts: list[bytes] = []
    _write(parse(signature), value, parts, 0)
    return b"".join(parts)


def _write(kind: Type, value: Any, parts: list[bytes], depth: int) -> None:
    if depth > DEEPEST:
        raise BadValue("a value that is too deep")
    if mismatch(kind, value) is None:
        raise BadValue(f"{value!r:.60} is no value of type {kind}")
    letter = kind.kind
    if (number := _NUMBERS.get(letter)) is not None:
        parts.append(number.pack(value if letter in "fd" else int(value)))
        return
    match letter:
        case "m":
            inner = signature_of(value)
            _write_bytes(inner.encode(), parts)
            _write(parse(inner), value, parts, depth + 1)
        case "s":
            _write_bytes(value.encode("utf-8"), parts)
        case "r":
            _write_bytes(bytes(value), parts)
        case "b":
            parts.append(b"\1" if value else b"\0")
        case "[":
            parts.append(_COUNT.pack(len(value)))
            for each in value:
                _write(kind.parts[0], each, parts, depth + 1)
        case "{":
            parts.append(_COUNT.pack(len(value)))
            for key, each in value.items():
                _write(kind.parts[0], key, parts, depth + 1)
                _write(kind.parts[1], each, parts, depth + 1)
        case "(":
            for part, each in zip(kind.parts, value, strict=True):
                _write(part, each, parts, depth + 1)


def _write_bytes(data: bytes, parts: list[bytes]) -> None:
    parts.append(_COUNT.pack(len(data)))
    parts.append(data)


def signature_of(value: Any) -> str:
    """The signature under which a value travels as a dynamic one.  Raises BadValue."""
    match value:
        case None:
            return "v"
        case bool():
            return "b"
        case int():
            return "i" if -(1 << 31) <= value < 1 << 31 else "l"
        case float():
            return "d"
        case str():
            return "s"
        case bytes() | bytearray():
            return "r"
        case dict():
            return f"{{{_common(list(value))}{_common(list(value.values()))}}}"
        case list() | tuple():
            return f"[{_common(value)}]"
    raise BadValue(f"a {type(value).__name__} cannot be sent")


def _common(values: Sequence[Any]) -> str:
    """The signature that all values share, or that of a dynamic one."""
    kinds = {type(value) for value in values}
    if len(kinds) == 1 and kinds <= {bool, float, str}:
        return signature_of(values[0])
    return "m"


def mismatch(kind: Type, value: Any) -> float | None:
    """How badly a value fits a type, for the choice of an overload: 0 exactly, None not at all."""
    letter = kind.kind
    match letter:
        case "m":
            return 3.0
        case "b":
            if value.__class__ is bool:
                return 0.0
            return _found(2.0, isinstance(value, int | float) and value in (0, 1))
        case "f" | "d":
            if value.__class__ is float:
                return 0.0
            return _found(1.0, value.__class__ is int and abs(value) < 1 << 53)
        case "s":
            return _found(0.0, isinstance(value, str))
        case "r":
            return _found(0.0, isinstance(value, bytes | bytearray))
        case "v":
            return _found(0.0, value is None)
        case "[":
            if not isinstance(value, list | tuple):
                return None
            return _worst(mismatch(kind.parts[0], each) for each in value)
        case "{":
            if not isinstance(value, dict):
                return None
            sides = ((kind.parts[0], key) for key in value), ((kind.parts[1], each) for each in value.values())
            return _worst(mismatch(part, each) for side in sides for part, each in side)
        case "(":
            if not isinstance(value, list | tuple) or len(value) != len(kind.parts):
                return None
            return _worst(mismatch(part, each) for part, each in zip(kind.parts, value, strict=True))
    if letter.lower() in _BITS and value.__class__ in (int, float) and value == value // 1:
        bits = _BITS[letter.lower()]
        low, high = (0, 1 << bits) if letter.isupper() else (-(1 << bits - 1), 1 << bits - 1)
        # Programs in urbiscript have no other numbers than floats.
        return _found(0.0 if value.__class__ is int else 2.0, low <= value < high)
    return None


def _found(cost: float, fits: bool) -> float | None:
    return cost if fits else None


def _worst(costs: Any) -> float | None:
    worst = 0.0
    for cost in costs:
        if cost is None:
            return None
        worst = max(worst, cost)
    return worst
