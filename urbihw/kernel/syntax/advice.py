"""Advice to beginners about statements that cannot be parsed: the correct form of a frequent mistake.

``hints`` adds a likely cause to the message itself; advice is longer, and a line of its own behind the message.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from urbihw.kernel.syntax.hints import MAX_LENGTH, tokens_up_to
from urbihw.kernel.syntax.location import Span
from urbihw.kernel.syntax.tokens import Token

WANTS_PARENTHESIS: Final = frozenset(["at", "every", "if", "switch", "timeout", "waituntil", "whenever", "while"])
FUNCTION_WORDS: Final = frozenset(["def", "fn", "fun", "func"])
VARIABLE_WORDS: Final = frozenset(["auto", "bool", "double", "float", "int", "let", "local", "long", "string"])

_TYPOGRAPHIC: Final = re.compile("invalid character: `\\\\xe2\\\\x80\\\\x9[89a-f]'")
_RESERVED: Final = re.compile(r"reserved symbol: `(\w+)'")


def advice(message: str, text: str, span: Span) -> str:
    """The advice for a syntax error about a span of a statement; empty if there is none."""
    if _TYPOGRAPHIC.match(message):
        return 'a String stands between straight quotes: "hi"'
    reserved = _RESERVED.match(message)
    if reserved:
        return _variable_advice(reserved[1])
    tokens = tokens_up_to(text, span) if len(text) <= MAX_LENGTH else []
    if not tokens or tokens[-1].span[:2] != span[:2]:
        return ""
    return next(filter(None, (find(tokens) for find in _FINDERS)), "")


def _variable_advice(word: str) -> str:
    return "a variable is declared with var: var x = 1" if word in VARIABLE_WORDS else ""


def _of_else(tokens: list[Token]) -> str:
    return "there is no ; before else: if (c) 1 else 2" if len(tokens) == 1 and tokens[0].kind == "else" else ""


def _of_signs(tokens: list[Token]) -> str:
    sign = tokens[-1].kind
    return f"the sign stands behind the name: x{sign}" if sign in ("++", "--") else ""


def _of_pairs(tokens: list[Token]) -> str:
    kinds = [token.kind for token in tokens[-2:]]
    if kinds == [":", "="]:
        return "a value is assigned by =, as in x = 3"
    return "an event is emitted by a !, as in e!(1)" if kinds == [".", "emit"] else ""


def _of_words(tokens: list[Token]) -> str:
    before, last = (tokens[-2] if len(tokens) > 1 else None), tokens[-1]
    if before is None:
        return ""
    if before.kind == "for" and last.kind == "NAME":
        return "the variable is declared in parentheses: for (var i in list) echo(i)"
    if before.kind in WANTS_PARENTHESIS and last.kind != "(":
        inside = "1s" if before.kind == "every" else "..."
        return f"what follows {before.kind} stands in parentheses: {before.kind} ({inside})"
    if before.kind == "NAME" and len(tokens) == 2 and last.kind in ("STRING", "FLOAT", "TIME"):
        return f"arguments stand in parentheses: {before.text}(...)"
    if last.kind != "NAME":
        return ""
    if last.text == "extends":
        return "the prototype stands behind a colon: class A : B { }"
    if last.text == "except":
        return "errors are caught by catch: try { f } catch (var e) { echo(e) }"
    if last.text in ("elif", "elseif", "elsif"):
        return "the next condition follows else: if (a) 1 else if (b) 2"
    if before.kind != "NAME":
        return ""
    if before.text in FUNCTION_WORDS:
        return "a function is declared like this: function f(x) { x + 1 }"
    return _variable_advice(before.text)


_FINDERS: Final[tuple[Callable[[list[Token]], str], ...]] = (_of_else, _of_signs, _of_pairs, _of_words)
