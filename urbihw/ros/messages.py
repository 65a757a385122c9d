"""Messages as dictionaries, and their bytes.

A number is a float or an int, a ``bool`` a bool, a ``string`` a str, ``uint8[]`` and ``char[]`` are bytes, other arrays
lists, messages dictionaries, ``time`` and ``duration`` dictionaries with ``secs`` and ``nsecs``.  A wrong value raises
MessageError, which names the field.  Definitions, md5 sums and the codec are those of the library rosbags.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping
from typing import Any, Final

from urbihw.ros.definitions import NAME, find_definition
from urbihw.ros.errors import MessageError, RosError
from urbihw.ros.framing import MAX_FRAME_BYTES
from urbihw.ros.sizes import MAX_DEPTH, NO_FIELD, TypeSizes

MAX_TYPES: Final = 2000
"""Maximum number of types that peers and files may add."""
MAX_FLOAT32: Final = 3.4028234663852886e38
_RANGES: Final = {
    "int8": (-(2**7), 2**7 - 1), "uint8": (0, 2**8 - 1), "byte": (-(2**7), 2**7 - 1), "char": (0, 2**8 - 1),
    "int16": (-(2**15), 2**15 - 1), "uint16": (0, 2**16 - 1), "int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1),
    "int64": (-(2**63), 2**63 - 1), "uint64": (0, 2**64 - 1),
}  # fmt: skip
_BYTES: Final = ("uint8", "char", "octet")
_TIMES: Final = {"builtin_interfaces/msg/Time": "uint32", "builtin_interfaces/msg/Duration": "int32"}
_SEPARATOR: Final = re.compile(r"^={80}$", re.MULTILINE)


class MessageType:
    """One type of messages.

    Attributes:
        name: such as ``std_msgs/String``.
        md5: the sum that both sides of a connection compare.
        definition: its text with those of the types in it, as a publisher sends it.
    """

    def __init__(self, types: MessageTypes, name: str) -> None:
        self.name = name
        self._types = types
        self._inner = inner_name(name)
        self.definition, self.md5 = types.store.generate_msgdef(self._inner, ros_version=1)

    def template(self) -> dict[str, Any]:
        """A message with a default value in each field."""
        made: dict[str, Any] = self._types.default_of(self._inner)
        return made

    def encode(self, message: Mapping[str, Any]) -> bytes:
        """The bytes of a message.  Raises MessageError."""
        return bytes(self._types.store.serialize_ros1(self._types.packed(self._inner, message, "", 0), self._inner))

    def decode(self, data: bytes) -> dict[str, Any]:
        """The message of some bytes.  Raises MessageError."""
        from rosbags.serde import SerdeError

        try:
            found: Any = self._types.store.deserialize_ros1(data, self._inner)
        except (SerdeError, ValueError, MemoryError) as error:
            raise MessageError(f"{len(data)} bytes that are no {self.name}") from error
        made: dict[str, Any] = self._types.unpacked(self._inner, found)
        return made


class ServiceType:
    """One type of services: the types of its request and its response, and the sum that both sides compare."""

    def __init__(self, name: str, request: MessageType, response: MessageType, md5: str) -> None:
        self.name, self.request, self.response, self.md5 = name, request, response, md5


class MessageTypes:
    """The types that are known: those of ROS Noetic, those found on this machine, those told by peers."""

    def __init__(self) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.store: Any = get_typestore(Stores.ROS1_NOETIC)
        self.store.max_sequence_length = MAX_FRAME_BYTES
        self._known: dict[str, MessageType] = {}
        self._added = 0

    def find(self, name: str) -> MessageType:
        """A type by its name.  Raises RosError if it is unknown."""
        found = self._known.get(name)
        if found is None:
            self._define(name, 0)
            found = self._known[name] = MessageType(self, name)
        return found

    def find_or_learn(self, name: str, md5: str, definition: str) -> MessageType:
        """The type that a peer sends; its ``definition`` is taken if the type is unknown here.

        Raises RosError if the sums differ.
        """
        try:
            found = self.find(name)
        except RosError:
            if not definition:
                raise
            self._learn(name, definition)
            found = self.find(name)
        if md5 not in ("*", found.md5):
            raise RosError(f"type {name} has md5 sum {found.md5} here, and {md5} there: another version of it")
        return found

    def service(self, name: str, md5: str = "*") -> ServiceType:
        """A type of services by its name.  Raises RosError if it is unknown, or has another sum."""
        text = find_definition(name, "srv")
        if text is None:
            raise RosError(f"service type {name} is not known here: add its folder to ROS_PACKAGE_PATH")
        parts = []
        for suffix, part in zip(("Request", "Response"), _split_service(text), strict=True):
            if inner_name(name + suffix) not in self.store.fielddefs:
                self._register(name + suffix, part, 0)
            parts.append(self.find(name + suffix))
        made = _service_md5(*(self._hashed(part.name) for part in parts))
        if md5 not in ("*", made):
            raise RosError(f"service type {name} has md5 sum {made} here, and {md5} there: another version of it")
        return ServiceType(name, parts[0], parts[1], made)

    # ---------------------------------------------------------------- definitions

    def _define(self, name: str, depth: int) -> None:
        """Make sure that a type and all types in it are known.  Raises RosError."""
        if NAME.fullmatch(name) is None:
            raise RosError(f"{name!r} is no type: write PACKAGE/NAME, such as std_msgs/String")
        if depth > MAX_DEPTH:
            raise RosError(f"type {name} contains itself, or nests more than {MAX_DEPTH} deep")
        if inner_name(name) in self.store.fielddefs:
            return
        text = find_definition(name, "msg")
        if text is None:
            raise RosError(f"message type {name} is not known here: add its folder to ROS_PACKAGE_PATH")
        self._register(name, text, depth)

    def _register(self, name: str, text: str, depth: int) -> None:
        parsed = self._parsed(name, text)
        for inner in _types_in(parsed[inner_name(name)][1]):
            self._define(inner.replace("/msg/", "/"), depth + 1)
        self._add(name, parsed)

    def _learn(self, name: str, definition: str) -> None:
        """Add a type from the text that a publisher sends, with the types in it that are new."""
        parts = [part.strip("\n") for part in _SEPARATOR.split(definition)]
        texts = {name: parts[0]}
        for part in parts[1:]:
            head, _, text = part.partition("\n")
            texts[head.removeprefix("MSG:").strip()] = text
        parsed = {}
        for each, text in texts.items():
            if NAME.fullmatch(each) is None:
                raise RosError(f"the definition of {name} contains {each[:80]!r}, which is no type")
            if inner_name(each) not in self.store.fielddefs:
                parsed.update(self._parsed(each, text))
        self._add(name, parsed)

    def _parsed(self, name: str, text: str) -> dict[str, Any]:
        from rosbags.typesys import get_types_from_msg

        try:
            return dict(get_types_from_msg(text, inner_name(name)))
        except Exception as error:  # those of the library's parser have no common class
            raise RosError(f"the definition of {name} cannot be read: {error}".splitlines()[0]) from error

    def _add(self, name: str, parsed: dict[str, Any]) -> None:
        """Add types, of which one contains the others.  Raises RosError before memory is taken for a huge one."""
        TypeSizes(name, {**self.store.fielddefs, **parsed}).of(inner_name(name), ())
        self._added += len(parsed)
        if self._added > MAX_TYPES:
            raise RosError(f"more than {MAX_TYPES} new types: restart to forget them")
        self.store.register(parsed)

    def _hashed(self, name: str) -> str:
        """The text of which the md5 sum is made."""
        text: str = self.store.generate_msgdef(inner_name(name), ros_version=1)[0]
        lines = []
        for line in _SEPARATOR.split(text)[0].strip().splitlines():
            kind, _, rest = line.partition(" ")
            base, bracket, _ = kind.partition("[")
            if "/" in base:
                lines.append(f"{self.find(base).md5} {rest}")
            else:
                lines.append(f"{base}{bracket}{kind[len(base) + len(bracket):]} {rest}")
        return "\n".join(lines)

    # ---------------------------------------------------------------- values

    def fields_of(self, inner: str) -> list[tuple[str, Any]]:
        """The fields of a type, with the library's description of each."""
        return [(name, kind) for name, kind in self.store.fielddefs[inner][1] if name != NO_FIELD]

    def default_of(self, inner: str) -> Any:
        """A message of default values."""
        if inner in _TIMES:
            return {"secs": 0, "nsecs": 0}
        return {name: self._default(kind) for name, kind in self.fields_of(inner)}

    def _default(self, kind: Any) -> Any:
        node, of = kind
        if node.name == "BASE":
            return {"string": "", "bool": False}.get(of[0], 0.0 if of[0].startswith("float") else 0)
        if node.name == "NAME":
            return self.default_of(of)
        element, size = of
        count = size if node.name == "ARRAY" else 0
        if element[0].name == "BASE" and element[1][0] in _BYTES:
            return bytes(count)
        return [self._default(element) for _ in range(count)]

    def packed(self, inner: str, value: Any, place: str, depth: int) -> Any:
        """A dictionary as an object of the library.  Raises MessageError, which names the ``place``."""
        if not isinstance(value, Mapping):
            raise MessageError(f"{place or 'a message'} must be a dictionary, not {_shown(value)}")
        if inner in _TIMES:
            kind = ("BASE", _TIMES[inner])
            _check_keys(value, ("secs", "nsecs"), place)
            pair = [_integer(value[key], kind[1], f"{place}.{key}") for key in ("secs", "nsecs")]
            return self.store.types[inner](*pair)
        fields = self.fields_of(inner)
        _check_keys(value, [name for name, _ in fields], place)
        made = {
            name: self._packed_field(kind, value[name], f"{place}.{name}" if place else name, depth + 1)
            for name, kind in fields
        }
        return self.store.types[inner](**made) if fields else self.store.types[inner]()

    def _packed_field(self, kind: Any, value: Any, place: str, depth: int) -> Any:
        node, of = kind
        if node.name == "BASE":
            return _base(of[0], value, place)
        if node.name == "NAME":
            return self.packed(of, value, place, depth)
        element, size = of
        count = size if node.name == "ARRAY" else None
        if element[0].name == "BASE" and element[1][0] != "string":
            return _numbers(element[1][0], value, count, place)
        if not isinstance(value, list | tuple):
            raise MessageError(f"{place} must be a list, not {_shown(value)}")
        _check_count(value, count, place)
        return [self._packed_field(element, each, f"{place}[{i}]", depth + 1) for i, each in enumerate(value)]

    def unpacked(self, inner: str, found: Any) -> dict[str, Any]:
        """An object of the library as a dictionary."""
        if inner in _TIMES:
            return {"secs": found.sec, "nsecs": found.nanosec}
        return {name: self._unpacked_field(kind, getattr(found, name)) for name, kind in self.fields_of(inner)}

    def _unpacked_field(self, kind: Any, value: Any) -> Any:
        node, of = kind
        if node.name == "BASE":
            return bool(value) if of[0] == "bool" else value
        if node.name == "NAME":
            return self.unpacked(of, value)
        element = of[0]
        if element[0].name == "BASE" and element[1][0] != "string":
            return value.tobytes() if element[1][0] in _BYTES else value.tolist()
        return [self._unpacked_field(element, each) for each in value]


def inner_name(name: str) -> str:
    """The library's name of a type: ``std_msgs/msg/String``."""
    return name.replace("/", "/msg/")


def _split_service(text: str) -> tuple[str, str]:
    lines = text.splitlines()
    at = next((i for i, line in enumerate(lines) if line.strip() == "---"), len(lines))
    return "\n".join(lines[:at]) + "\n", "\n".join(lines[at + 1 :]) + "\n"


def _service_md5(request: str, response: str) -> str:
    return hashlib.md5((request + response).encode(), usedforsecurity=False).hexdigest()


def _types_in(fields: Any) -> list[str]:
    """The messages among the types of fields, by the library's names."""
    found = []
    for _, (node, of) in fields:
        inner = (node, of) if node.name in ("BASE", "NAME") else of[0]
        if inner[0].name == "NAME":
            found.append(inner[1])
    return found


def _check_keys(value: Mapping[str, Any], names: Any, place: str) -> None:
    before = f"{place}." if place else ""
    missing = [name for name in names if name not in value]
    if missing:
        raise MessageError(f"missing field: {before}{missing[0]}")
    extra = [str(name) for name in value if name not in names]
    if extra:
        raise MessageError(f"no such field: {before}{extra[0][:80]}; there are: {', '.join(names) or 'none'}")


def _check_count(value: Any, count: int | None, place: str) -> None:
    if count is not None and len(value) != count:
        raise MessageError(f"{place} must have {count} elements, not {len(value)}")


def _base(kind: str, value: Any, place: str) -> Any:
    """A value of a type without parts."""
    if kind == "string":
        if not isinstance(value, str):
            raise MessageError(f"{place} must be a string, not {_shown(value)}")
        try:
            value.encode()
        except UnicodeEncodeError as error:
            raise MessageError(f"{place} is not UTF-8 text") from error
        return value
    if kind == "bool":
        if value not in (True, False):
            raise MessageError(f"{place} must be true or false, not {_shown(value)}")
        return bool(value)
    if kind.startswith("float"):
        return _number(value, place, MAX_FLOAT32 if kind == "float32" else math.inf)
    return _integer(value, kind, place)


def _number(value: Any, place: str, limit: float = math.inf) -> float:
    """A number of at most this size, or an infinite one."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise MessageError(f"{place} must be a number, not {_shown(value)}")
    try:
        number = float(value)
    except OverflowError as error:
        raise MessageError(f"{place} is too large: {_shown(value)}") from error
    if math.isfinite(number) and abs(number) > limit:
        raise MessageError(f"{place} must be in [{-limit:g}, {limit:g}], not {_shown(value)}")
    return number


def _integer(value: Any, kind: str, place: str) -> int:
    number = value if isinstance(value, int) and not isinstance(value, bool) else _number(value, place)
    low, high = _RANGES[kind]
    if isinstance(number, float) and not (math.isfinite(number) and number.is_integer()):
        raise MessageError(f"{place} must be a whole number ({kind}), not {_shown(value)}")
    if not low <= number <= high:
        raise MessageError(f"{place} must be in [{low}, {high}] ({kind}), not {_shown(value)}")
    return int(number)


def _numbers(kind: str, value: Any, count: int | None, place: str) -> Any:
    """An array of numbers, as the library wants it."""
    import numpy

    if isinstance(value, str) and kind in _BYTES:
        value = value.encode("latin-1", "replace")
    if isinstance(value, bytes | bytearray | memoryview) and kind in _BYTES:
        _check_count(value, count, place)
        return numpy.frombuffer(value, numpy.uint8)
    if not isinstance(value, list | tuple):
        raise MessageError(f"{place} must be {'a Binary' if kind in _BYTES else 'a list'}, not {_shown(value)}")
    _check_count(value, count, place)
    checked = [_base(kind, each, f"{place}[{i}]") for i, each in enumerate(value)]
    return numpy.array(checked, {"byte": "int8", "char": "uint8", "octet": "uint8"}.get(kind, kind))


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
