"""Values and messages of QiMessaging, as NAOqi writes them: typed by signatures, little-endian."""

from __future__ import annotations

import struct
from typing import Any, NamedTuple

MAGIC = b"\x42\xde\xad\x42"
HEAD = struct.Struct("<4sIIHBBIII")
MOST = 50_000_000
FORMATS = {
    "c": "b", "C": "B", "w": "h", "W": "H", "i": "i", "I": "I", "l": "q", "L": "Q", "f": "f", "d": "d", "b": "?",
}  # fmt: skip
CALL, REPLY, ERROR, POST, EVENT, CAPABILITY, CANCEL, CANCELLED = range(1, 9)
META = (
    "({I(Issss[(ss)<MetaMethodParameter,name,description>]s)<MetaMethod,uid,returnSignature,name,parametersSignature,"
    "description,parameters,returnDescription>}{I(Iss)<MetaSignal,uid,name,signature>}"
    "{I(Iss)<MetaProperty,uid,name,signature>}s)<MetaObject,methods,signals,properties,description>"
)


class BadMessage(Exception):
    """The client sent what is no message, or no value."""


class Target(NamedTuple):
    """What a message is for: a member of an object of a service."""

    service: int
    thing: int
    action: int


class Message(NamedTuple):
    """A message as it came."""

    number: int
    kind: int
    service: int
    thing: int
    action: int
    payload: bytes

    @property
    def target(self) -> Target:
        """What it is for."""
        return Target(self.service, self.thing, self.action)


def frame(kind: int, number: int, target: Target, payload: bytes = b"") -> bytes:
    """The bytes of a message."""
    return HEAD.pack(MAGIC, number, len(payload), 0, kind, 0, *target) + payload


class Splitter:
    """Splits a stream into messages."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[Message]:
        """The messages that are complete with these bytes.  Raises BadMessage."""
        self._rest += data
        found = []
        while len(self._rest) >= HEAD.size:
            magic, number, size, _, kind, _, service, thing, action = HEAD.unpack_from(self._rest)
            if magic != MAGIC or size > MOST:
                raise BadMessage
            if len(self._rest) < HEAD.size + size:
                break
            found.append(Message(number, kind, service, thing, action, self._rest[HEAD.size : HEAD.size + size]))
            self._rest = self._rest[HEAD.size + size :]
        return found


def split(signature: str) -> list[str]:
    """The types that stand one after the other in a text."""
    found = []
    at = 0
    while at < len(signature):
        start = at
        depth = 0
        while True:
            depth += {"[": 1, "(": 1, "{": 1, "]": -1, ")": -1, "}": -1}.get(signature[at], 0)
            at += 1
            if not depth:
                break
        if signature[at : at + 1] == "<":
            at = signature.index(">", at) + 1
        found.append(signature[start:at])
    return found


def inner(signature: str) -> list[str]:
    """The types between the brackets of a list, map or tuple."""
    closing = {"[": "]", "(": ")", "{": "}"}[signature[0]]
    return split(signature[1 : signature.rindex(closing)])


class Reader:
    """Reads values out of bytes."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = 0

    def _bytes(self, size: int) -> bytes:
        if size > len(self._data) - self._at:
            raise BadMessage
        self._at += size
        return self._data[self._at - size : self._at]

    def _size(self) -> int:
        size = int(struct.unpack("<I", self._bytes(4))[0])
        if size > len(self._data):
            raise BadMessage
        return size

    def read(self, signature: str) -> Any:
        """The next value.  Raises BadMessage."""
        kind = signature[0]
        if kind in FORMATS:
            form = "<" + FORMATS[kind]
            return struct.unpack(form, self._bytes(struct.calcsize(form)))[0]
        if kind == "s":
            return self._bytes(self._size()).decode("utf-8", "replace")
        if kind == "r":
            return self._bytes(self._size())
        if kind == "m":
            return self.read(self.read("s"))
        if kind == "v":
            return None
        if kind == "[":
            (part,) = inner(signature)
            return [self.read(part) for _ in range(self._size())]
        if kind == "{":
            key, value = inner(signature)
            return {self.read(key): self.read(value) for _ in range(self._size())}
        if kind == "(":
            return tuple(self.read(part) for part in inner(signature))
        raise BadMessage


def decode(signature: str, data: bytes) -> Any:
    """The value of a payload.  Raises BadMessage."""
    try:
        return Reader(data).read(signature)
    except (IndexError, KeyError, ValueError, TypeError, RecursionError) as error:
        raise BadMessage from error


def encode(signature: str, value: Any) -> bytes:
    """The bytes of a value."""
    kind = signature[0]
    if kind in FORMATS:
        return struct.pack("<" + FORMATS[kind], value)
    if kind in "sr":
        data = value.encode() if isinstance(value, str) else bytes(value)
        return struct.pack("<I", len(data)) + data
    if kind == "m":
        own = signature_of(value)
        return encode("s", own) + encode(own, value)
    if kind == "v":
        return b""
    if kind == "[":
        (part,) = inner(signature)
        return struct.pack("<I", len(value)) + b"".join(encode(part, each) for each in value)
    if kind == "{":
        key, what = inner(signature)
        return struct.pack("<I", len(value)) + b"".join(encode(key, k) + encode(what, v) for k, v in value.items())
    if kind == "(":
        return b"".join(encode(part, each) for part, each in zip(inner(signature), value, strict=True))
    if kind == "o":
        meta, service, thing = value
        return encode(META, meta) + struct.pack("<II", service, thing)
    raise ValueError(signature)


def signature_of(value: Any) -> str:
    """What a value is as a dynamic one: floats have 32 bits, as NAOqi's own."""
    if value is None:
        return "v"
    if type(value) is int and not -(1 << 31) <= value < 1 << 31:
        return "l"
    for kind, letter in ((bool, "b"), (int, "i"), (float, "f"), (str, "s"), (bytes, "r"), (dict, "{mm}")):
        if isinstance(value, kind):
            return letter
    return "[m]"
