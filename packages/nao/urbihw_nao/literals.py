"""A call as it is written in a url, of literals only: ``mathematics.add(2, 'two', [true])``.  Nothing is evaluated."""

from __future__ import annotations

import math
import re
from typing import Any, Final

LONGEST: Final = 4096
"""Characters of a call."""
DEEPEST: Final = 8
"""Lists in each other."""
_CALL: Final = re.compile(r"\s*([A-Za-z_]\w*)\s*\.\s*([A-Za-z_]\w*)\s*\(")
_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?"
_STRING: Final = r"'(?:[^'\\]|\\['\\])*'"
_TOKEN: Final = re.compile(rf"\s*([\[\](),]|{_NUMBER}|{_STRING}|true|false)")
_ESCAPE: Final = re.compile(r"\\(.)")


def parse_call(text: str) -> tuple[str, str, list[Any]]:
    """Module, method and arguments.  Raises ValueError for anything else."""
    if len(text) > LONGEST:
        raise ValueError(f"a call of {len(text)} characters; {LONGEST} are taken at most")
    head = _CALL.match(text)
    if head is None:
        raise ValueError("write Module.method(arguments)")
    reader = _LiteralReader(text, head.end())
    arguments = reader.read_values(")", 0)
    if text[reader.at :].strip(" ;\t\r\n"):
        raise ValueError(f"something follows the call: {text[reader.at :][:20]!r}")
    return head[1], head[2], arguments


class _LiteralReader:
    """Reads literals; ``at`` is where the next one begins."""

    def __init__(self, text: str, at: int) -> None:
        self._text = text
        self.at = at

    def read_values(self, end: str, depth: int) -> list[Any]:
        """Values with commas between them, up to the token that ends them."""
        if depth > DEEPEST:
            raise ValueError("lists too deep in each other")
        found: list[Any] = []
        token = self._next()
        while token != end:
            found.append(self._value(token, depth))
            token = self._next()
            if token == ",":
                token = self._next()
            elif token != end:
                raise ValueError(f"{token!r} where a comma or {end!r} should be")
        return found

    def _value(self, token: str, depth: int) -> Any:
        if token == "[":
            return self.read_values("]", depth + 1)
        if token in ("true", "false"):
            return token == "true"
        if token.startswith("'"):
            return _ESCAPE.sub(r"\1", token[1:-1])
        if token in "](),":
            raise ValueError(f"{token!r} where a value should be")
        number = float(token)
        if math.isinf(number):
            raise ValueError(f"{token} is too large")
        return number

    def _next(self) -> str:
        found = _TOKEN.match(self._text, self.at)
        if found is None:
            rest = self._text[self.at :].strip()[:20]
            what = f"no number, 'string', true, false or [list]: {rest!r}" if rest else "the call does not end"
            raise ValueError(what)
        self.at = found.end()
        return found[1]
