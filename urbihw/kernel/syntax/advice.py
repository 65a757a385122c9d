"""Advice to beginners about statements that cannot be parsed: the correct form of a frequent mistake.

``hints`` adds a likely cause to the message itself; advice is longer, and a line of its own behind the message.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Final

from urbihw.kernel.syntax.hints import MAX_LENGTH, opening_bracket, tokens_up_to
from urbihw.kernel.syntax.location import Span
from urbihw.kernel.syntax.tokens import ANGLES, DURATIONS, Token

WANTS_PARENTHESIS: Final = frozenset(["at", "every", "if", "switch", "timeout", "waituntil", "whenever", "while"])
FUNCTION_WORDS: Final = frozenset(["def", "fn", "fun", "func"])
VARIABLE_WORDS: Final = frozenset(
    ["auto", "bool", "double", "float", "int", "let", "local", "long", "string", "Number", "String"]
)
UNITS: Final = frozenset([*DURATIONS, *ANGLES])

_BRACES: Final = "what belongs together stands in braces: if (c) { ... }"
_CHOICE: Final = "a choice is written if (c) 1 else 2"
_FUNCTION: Final = "a function is written like this: function (x) { x + 1 }"
_NAMED: Final = "a function is declared like this: function f(x) { x + 1 }"
_STRING: Final = 'a String stands between double quotes: "hi"'
_UNIT: Final = "a unit stands at its number: 2s, 90deg; there are ms, s, min, h, d, rad, deg and grad"
_COUNTED: Final = "so many times is for (3) { ... }"
_CONDITION: Final = "the next condition follows else: if (a) 1 else if (b) 2"

_CHARACTERS: Final = (
    (re.compile(r"\\xe2\\x80\\x9[89a-f]"), 'a String stands between straight quotes: "hi"'),
    (re.compile("#"), "a comment begins with //"),
    (re.compile("`"), _STRING),
    (re.compile(r"\\xc2"), _UNIT),
    (re.compile(r"\\x|[$@]"), "a name has letters from a to z, digits and _"),
)
"""Advice for characters that no program has."""
_AS_CALLS: Final = {
    **dict.fromkeys(("elif", "elseif", "elsif"), _CONDITION),
    "unless": "the opposite of a condition is !: if (!c) { ... }",
    "until": "a loop with an end is while (!c) { ... }",
    **dict.fromkeys(("repeat", "loop"), _COUNTED),
    "when": "each time that c becomes true is at (c) { ... }, all the time that it is true whenever (c) { ... }",
}
"""Advice for words of other languages that are used like ``if (c) ...``."""
_BETWEEN: Final = {
    "is": "two values are compared by ==",
    **dict.fromkeys(("AND", "And"), "and is written &&"),
    **dict.fromkeys(("OR", "Or"), "or is written ||"),
    **dict.fromkeys(
        ("exit", "quit", "bye"), "the statement before it is not complete: end it with ;, then write quit;"
    ),
    "extends": "the prototype stands behind a colon: class A : B { }",
    "except": "errors are caught by catch: try { f } catch (var e) { echo(e) }",
    **dict.fromkeys(("elif", "elseif", "elsif"), _CONDITION),
}
"""Advice for words of other languages behind a value."""
_BEFORE: Final = {
    "then": "there is no then: if (c) 1 else 2",
    "from": "there is nothing to import: write the object before the name, as in Math.cos",
    "stop": "a tag is stopped by its slot stop: t.stop",
    "lambda": _FUNCTION,
    **dict.fromkeys(FUNCTION_WORDS, _NAMED),
}
"""Advice for words of other languages before a name."""


def advice(message: str, text: str, span: Span) -> str:
    """The advice for a syntax error about a span of a statement; empty if there is none."""
    kind, _, what = message.partition(": `")
    if kind == "invalid character":
        return next((told for pattern, told in _CHARACTERS if pattern.match(what)), "")
    if kind == "invalid token":
        return _UNIT if re.fullmatch(r"[\d.]+[a-zA-Z]+'", what) else "a number has digits and at most one point: 1000.5"
    if kind == "reserved symbol":
        return _of_reserved(what.rstrip("'"), text)
    if message == "unterminated quoted identifier":
        return _STRING
    if message.startswith("`break'"):
        return "a case of a switch ends by itself, without break" if "switch" in text else ""
    tokens = tokens_up_to(text, span) if len(text) <= MAX_LENGTH else []
    if not tokens or tokens[-1].span[:2] != span[:2]:
        return ""
    return next(filter(None, (find(tokens) for find in _FINDERS)), "")


def _of_reserved(word: str, text: str) -> str:
    if word in ("int", "float") and re.search(rf"\b{word}\s*\(", text):
        return 'a number is made by asFloat: "5".asFloat'
    return _variable_advice(word)


def _variable_advice(word: str) -> str:
    return "a variable is declared with var: var x = 1" if word in VARIABLE_WORDS else ""


def _of_alternatives(tokens: list[Token]) -> str:
    first, last = tokens[0].kind, tokens[-1].kind
    if last == "else":
        if len(tokens) == 1:
            return "there is no ; before else: if (c) 1 else 2"
        return "at has onleave in place of else: at (c) 1 onleave 2" if first == "at" else ""
    if last == "onleave" and first == "whenever":
        return "whenever has else in place of onleave: whenever (c) 1 else 2"
    return _CHOICE if last in ("?", "if") and len(tokens) > 1 else ""


def _of_signs(tokens: list[Token]) -> str:
    kinds = [token.kind for token in tokens[-2:]]
    sign = kinds[-1]
    if sign in ("++", "--"):
        return f"the sign stands behind the name: x{sign}"
    if sign == "=>":
        return _FUNCTION
    if kinds == ["<", ">"]:
        return "not equal is written !="
    if kinds == [":", "="]:
        return "a value is assigned by =, as in x = 3"
    return "an event is emitted by a !, as in e!(1)" if kinds == [".", "emit"] else ""


def _of_colons(tokens: list[Token]) -> str:
    """Advice for a colon that is not expected."""
    if tokens[-1].kind != ":" or len(tokens) < 2:
        return ""
    before = tokens[-2].kind
    if before == ":":
        return "a name of an object stands behind a point: Math.cos"
    opened = opening_bracket(tokens, len(tokens) - 1)
    if opened >= 0 and tokens[opened].kind == "[":
        is_key = before == "STRING"
        return 'a Dictionary is written ["a" => 1]' if is_key else "a part of a List is list.range(1, 3)"
    return _BRACES if before in (")", "loop", "else", "try", "do", "finally") else ""


def _of_braces(tokens: list[Token]) -> str:
    kinds = [token.kind for token in tokens[-2:]]
    if kinds == [")", "return"]:
        return _NAMED
    return "a loop is written while (c) { ... }" if kinds == ["do", "{"] else ""


def _of_calls(tokens: list[Token]) -> str:
    """Advice for a word of another language that is used like ``if (c) ...``."""
    opened = opening_bracket(tokens, len(tokens) - 2) if len(tokens) > 2 and tokens[-2].kind == ")" else 0
    word = tokens[opened - 1] if opened > 0 else None
    return _AS_CALLS.get(str(word.value), "") if word is not None and word.kind in ("NAME", "loop") else ""


def _of_words(tokens: list[Token]) -> str:
    before, last = (tokens[-2] if len(tokens) > 1 else None), tokens[-1]
    if before is None:
        return ""
    if before.kind == "for" and last.kind == "NAME":
        return "the variable is declared in parentheses: for (var i in list) echo(i)"
    if before.kind in WANTS_PARENTHESIS and last.kind != "(":
        inside = "1s" if before.kind == "every" else "..."
        return f"what follows {before.kind} stands in parentheses: {before.kind} ({inside})"
    if before.kind == "const" and last.kind == "NAME":
        return "a constant is declared with const var: const var x = 1"
    if last.kind == "NAME" and last.text in _BETWEEN:
        return _BETWEEN[last.text]
    if before.kind == "NAME" and before.text in _BEFORE:
        return _BEFORE[before.text]
    kinds = [token.kind for token in tokens[-4:]]
    if kinds == ["catch", "(", "NAME", "NAME"]:
        return "errors of a kind are caught by catch (var e if e.isA(Exception))"
    return _variable_advice(before.text) if before.kind == last.kind == "NAME" else ""


def _of_values(tokens: list[Token]) -> str:
    """Advice for a value that stands directly behind another one."""
    last, before = tokens[-1], tokens[-2] if len(tokens) > 1 else None
    if before is None:
        return ""
    behind = tokens[-3].kind if len(tokens) > 2 else ""
    if before.kind == "FLOAT" and last.kind == "NAME" or behind == "FLOAT" and before.value in UNITS:
        return _UNIT
    if last.kind == "=" and before.kind == "NAME" and behind in ("FLOAT", "TIME", "NAME"):
        return f"an attribute of a movement stands before a colon: {before.text}:2s"
    if last.kind not in ("STRING", "FLOAT", "TIME", "NAME"):
        return ""
    if last.kind == "STRING" and before.kind == ".":
        return 'texts are joined by +: "a" + "b"'
    if before.kind == "NAME" and last.kind != "NAME":
        if before.text == "raise":
            return "an error is thrown by throw"
        if behind == ".":
            return "a value is assigned by =, as in x = 3"
        return f"arguments stand in parentheses: {before.text}(...)" if len(tokens) == 2 else ""
    if before.kind not in ("STRING", "FLOAT", "TIME", ")"):
        return ""
    opened = opening_bracket(tokens, len(tokens) - 1)
    if opened >= 0 and tokens[opened].kind != "{":
        return "values are separated by a comma: f(1, 2), [1, 2]"
    return "statements are separated by ;" if before.kind == ")" else ""


_FINDERS: Final[tuple[Callable[[list[Token]], str], ...]] = (
    _of_alternatives, _of_signs, _of_colons, _of_braces, _of_calls, _of_words, _of_values,
)  # fmt: skip
