"""Values and descriptions between us and libqi's Python: what it spoils is refused, what it renames is put right."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw_nao.qimessaging.signatures import DEEPEST, Type, parse
from urbihw_nao.qimessaging.values import signature_of

DYNAMIC: Final = parse("m")


def meta_value(meta: Mapping[str, Any]) -> tuple[Any, ...]:
    """What libqi tells of an object, in the form that it has on the wire."""
    methods: dict[int, Any] = {
        uid: (uid, row["returnSignature"], row["name"], row["parametersSignature"], row["description"], [], "")
        for uid, row in meta["methods"].items()
    }
    signals, properties = (
        {uid: (uid, row["name"], row["signature"]) for uid, row in meta[kind].items()}
        for kind in ("signals", "properties")
    )
    return methods, signals, properties, ""


def from_libqi(kind: Type, value: Any) -> Any:
    """A value as our own session gives it: raw data are bytes, structures are tuples of their fields."""
    if isinstance(value, bytearray):
        return bytes(value)
    if kind.kind == "(" and isinstance(value, dict | tuple):
        # libqi makes a dictionary of a structure with names, in the order of the fields.
        fields = value.values() if isinstance(value, dict) else value
        return tuple([from_libqi(part, each) for part, each in zip(kind.parts, fields, strict=False)])
    if isinstance(value, list | tuple):
        part = kind.parts[0] if kind.kind == "[" else DYNAMIC
        return type(value)([from_libqi(part, each) for each in value])
    if isinstance(value, dict):
        part = kind.parts[1] if kind.kind == "{" else DYNAMIC
        return {key: from_libqi(part, each) for key, each in value.items()}
    return value


def to_libqi(kind: Type, value: Any, depth: int) -> Any:
    """An argument as libqi sends it rightly; it already fits its type.  Raises BadValue for what it would spoil."""
    if depth > DEEPEST:
        raise BadValue("a value that is too deep")
    match kind.kind:
        case "m":
            return _to_dynamic(value, depth)
        case "[":
            return [to_libqi(kind.parts[0], each, depth + 1) for each in value]
        case "(":
            rows = zip(kind.parts, value, strict=True)
            return tuple([to_libqi(part, each, depth + 1) for part, each in rows])
        case "{":
            key_kind, kind = kind.parts
            return {to_libqi(key_kind, key, depth + 1): to_libqi(kind, each, depth + 1) for key, each in value.items()}
        case "f" | "d":
            return float(value)
        case "s" | "r" | "v":
            return value
        case "b":
            return bool(value)
        case _:
            return int(value)


def _to_dynamic(value: Any, depth: int) -> Any:
    if depth > DEEPEST:
        raise BadValue("a value that is too deep")
    match value:
        case bytes() | bytearray():
            raise BadValue("libqi makes text of bytes in a dynamic value (m); qi:// sends them")
        case list() | tuple():
            return [_to_dynamic(each, depth + 1) for each in value]
        case dict():
            pairs = value.items()
            return {_to_dynamic(key, depth + 1): _to_dynamic(each, depth + 1) for key, each in pairs}
    signature_of(value)
    return value
