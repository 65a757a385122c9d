"""Parses the values that a server prints: text and Binaries of a line in, Python values out, no sockets.

Numbers, strings, lists, dictionaries (``["k" => 1]``, empty ``[=>]``), ``BIN``, ``nil`` and ``void``, ``true`` and
``false``, and bare names of objects (server protocol, section 4; remote UObject protocol, section 2).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Any, Final, NamedTuple

from urbihw.client.lines import Binary, Line

MAX_DEPTH: Final = 64
"""Maximum nesting depth of lists."""

_NUMBER: Final = re.compile(rb"[-+]?(?:0x[0-9a-fA-F]+|(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|(?:inf|nan)(?![\w.]))")
_STRING: Final = re.compile(rb'"((?:[^"\\\n]|\\.)*)"', re.DOTALL)
_WORD: Final = re.compile(rb"[A-Za-z_][\w.]*")
_BINARY: Final = re.compile(rb"BIN \d+[^\n]*\n")
_BLANKS: Final = re.compile(rb"[ \t\r]*")
_ESCAPE: Final = re.compile(rb"\\(x[0-9a-fA-F]{2}|[0-7]{1,3}|.)", re.DOTALL)
_ESCAPES: Final = {b"n": b"\n", b"t": b"\t", b"r": b"\r", b"a": b"\a", b"b": b"\b", b"f": b"\f", b"v": b"\v"}
_CONSTANTS: Final = {b"nil": None, b"void": None, b"true": True, b"false": False}


class Written(NamedTuple):
    """What a device tells of a written value.

    Attributes:
        applied: the value after the limits, in the unit of the slot; nan while the device is off, None for a slot whose
            device does not tell it.
        limited_by: the name of the limit that acts, "" for none.
    """

    applied: float | None
    limited_by: str


class NotAValue(ValueError):
    """The text is not a value."""


def value_of(
    line: Line, binary: Callable[[Binary], Any] = lambda found: found, name: Callable[[str], Any] = lambda found: found
) -> Any:
    """The value at the beginning of the text of a line; the text behind it is ignored.

    ``binary`` and ``name`` make the Python values of a Binary and of the bare name of an object.  Strings have one
    character per byte.  Raises NotAValue.
    """
    return _Reader(line, binary, name).value(0)


def written_of(paths: Iterable[str], told: Any) -> dict[str, Written]:
    """The answer to a write of several slots.  Raises ValueError or TypeError for any other answer."""
    rows = zip(paths, told, strict=True)
    return {path: Written(applied, limit or "") for path, (applied, limit) in rows}


class _Reader:
    """Reads one text from left to right."""

    __slots__ = ("_at", "_binaries", "_binary", "_name", "_text")

    def __init__(self, line: Line, binary: Callable[[Binary], Any], name: Callable[[str], Any]) -> None:
        self._text = line.raw
        self._binaries = iter(line.binaries)
        self._binary = binary
        self._name = name
        self._at = line.begin

    def value(self, deep: int) -> Any:
        self._at = _BLANKS.match(self._text, self._at).end()  # type: ignore[union-attr]
        text, at = self._text, self._at
        first = text[at : at + 1]
        if first == b'"':
            return self._string()
        if first == b"[":
            self._at += 1
            return self._list(deep)
        if number := _NUMBER.match(text, at):
            self._at = number.end()
            try:
                return float(int(number[0], 16)) if b"x" in number[0] else float(number[0])
            except OverflowError:
                raise NotAValue("a number that is too great") from None
        if text.startswith(b"BIN ", at):
            return self._next_binary()
        word = _WORD.match(text, at)
        if word is None:
            raise NotAValue(f"no value: {text[at : at + 40]!r}")
        self._at = word.end()
        return _CONSTANTS[word[0]] if word[0] in _CONSTANTS else self._name(word[0].decode("latin-1"))

    def _string(self) -> str:
        found = _STRING.match(self._text, self._at)
        if found is None:
            raise NotAValue("a string without end")
        self._at = found.end()
        content = found[1]
        if b"\\" in content:
            content = _ESCAPE.sub(_unescaped, content)
        return content.decode("latin-1")

    def _next_binary(self) -> Any:
        head, found = _BINARY.match(self._text, self._at), next(self._binaries, None)
        if head is None or found is None:
            raise NotAValue("a Binary without its data")
        self._at = head.end() + len(found.data)
        return self._binary(found)

    def _list(self, deep: int) -> Any:
        """A list, or a dictionary, whose members contain ``=>``."""
        if deep > MAX_DEPTH:
            raise NotAValue(f"lists more than {MAX_DEPTH} deep")
        found: list[Any] = []
        keyed: dict[str, Any] = {}
        text = self._text
        while True:
            at = self._at = _BLANKS.match(text, self._at).end()  # type: ignore[union-attr]
            mark = text[at : at + 2]
            if mark == b"=>":
                self._at += 2
                if not found:
                    return self._no_members()
                keyed[str(found.pop())] = self.value(deep + 1)
            elif mark[:1] == b"]":
                self._at += 1
                return keyed if keyed else found
            elif mark[:1] == b",":
                self._at += 1
            elif not mark:
                raise NotAValue("a list without end")
            else:
                found.append(self.value(deep + 1))

    def _no_members(self) -> dict[str, Any]:
        """The rest of ``[=>]``."""
        self._at = _BLANKS.match(self._text, self._at).end() + 1  # type: ignore[union-attr]
        if self._text[self._at - 1 : self._at] != b"]":
            raise NotAValue("a dictionary without a key")
        return {}


def _unescaped(match: re.Match[bytes]) -> bytes:
    what = match[1]
    if what[:1] == b"x" and len(what) == 3:
        return bytes([int(what[1:], 16)])
    if what.isdigit():
        return bytes([int(what, 8) & 0xFF])
    return _ESCAPES.get(what, what)
