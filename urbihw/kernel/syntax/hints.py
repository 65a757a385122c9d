"""Likely causes of an unexpected token: a misspelt keyword, a missing separator, or syntax of a later version.

The parser reports the unexpected token, which often stands behind the mistake.  The tokens before it are read again
only after an error, so this costs correct programs nothing.
"""

from __future__ import annotations

import difflib
from typing import Final

from urbihw.kernel.syntax.lexer import Lexer
from urbihw.kernel.syntax.location import Position, Span
from urbihw.kernel.syntax.tokens import KEYWORDS, Token

MAX_LENGTH: Final = 10_000
"""Maximum length of a statement that is read again, in characters: longer ones would take too long."""
SHORT_KEYWORD: Final = 3
"""Keywords of at most so many letters resemble many names: only a word of exactly the same letters counts as a
misspelling."""
MIN_SIMILARITY: Final = 0.75
"""Minimum similarity of two words, from 0 to 1 as ``difflib`` computes it."""

_ENDS_VALUE: Final = frozenset(["NAME", "FLOAT", "TIME", "STRING", ")", "]", "}", "this", "call"])
_BEGINS_VALUE: Final = frozenset(["NAME", "FLOAT", "TIME", "STRING", "this", "call", "new", "function", "closure"])
_BEGINS_STATEMENT: Final = _BEGINS_VALUE | frozenset(
    [
        "assert", "at", "break", "class", "const", "continue", "do", "enum", "every", "for", "freezeif", "if", "loop",
        "return", "stopif", "switch", "throw", "timeout", "try", "var", "waituntil", "whenever", "while",
    ]  # fmt: skip
)
LATER_FEATURES: Final = {
    "import": "import of Urbi 3 is not here: write the object before the name, as in Math.cos",
    "package": "package of Urbi 3 is not here: write class Global.NAME { }",
}
"""Syntax of later versions, by the word that begins it, and what to write instead."""
_CLOSED_BY: Final = {")": "(", "]": "[", "}": "{"}


def hint(text: str, span: Span, base: Position) -> str:
    """The text to add to the message "unexpected ..." about a span of a statement; empty if no cause is known.

    ``text`` is the statement, which begins at ``base``; the span is relative to that.
    """
    if len(text) > MAX_LENGTH:
        return ""
    tokens = tokens_up_to(text, span)
    if not tokens or tokens[-1].span[:2] != span[:2]:
        return ""
    word = _later_feature(tokens) or _misspelt_keyword(tokens)
    if word:
        return word
    sign = _missing_separator(tokens)
    if not sign:
        return ""
    end = tokens[-2].span
    return f" (missing {sign} at {Position(end.end_line, end.end_column).after(base)})"


def tokens_up_to(text: str, span: Span) -> list[Token]:
    """The tokens up to the unexpected one."""
    lexer = Lexer([])
    lexer.feed(text)
    lexer.close()
    tokens: list[Token] = []
    if lexer.begin():
        while (token := lexer.next()) is not None:
            tokens.append(token)
            if token.span[:2] >= span[:2]:
                break
    return tokens


def _later_feature(tokens: list[Token]) -> str:
    """What to write instead of syntax of a later version; empty if there is none."""
    two_names = len(tokens) > 1 and tokens[-1].kind == tokens[-2].kind == "NAME"
    found = LATER_FEATURES.get(tokens[-2].text) if two_names else None
    return f" ({found})" if found else ""


def _misspelt_keyword(tokens: list[Token]) -> str:
    """The word that may be a misspelt keyword: the unexpected one, the one before it, or the one before an adjacent
    group."""
    unexpected = len(tokens) - 1
    places = [unexpected, unexpected - 1]
    opened = opening_bracket(tokens, unexpected)
    if opened >= 0:
        places.append(opened - 1)
    if unexpected and tokens[unexpected - 1].kind == ")":
        places.append(opening_bracket(tokens, unexpected - 1) - 1)
    for place in places:
        if place >= 0 and tokens[place].kind == "NAME":
            keyword = _near_keyword(tokens[place].text)
            if keyword:
                return f" ({tokens[place].text}: possible misspelling of {keyword})"
    return ""


def _near_keyword(word: str) -> str:
    """The keyword that a word may be a misspelling of; empty for none."""
    for keyword in sorted(KEYWORDS):
        if len(keyword) <= SHORT_KEYWORD and set(keyword) == set(word) and abs(len(keyword) - len(word)) <= 1:
            return keyword
    long = (keyword for keyword in sorted(KEYWORDS) if len(keyword) > SHORT_KEYWORD)
    return next(iter(difflib.get_close_matches(word, long, 1, MIN_SIMILARITY)), "")


def _missing_separator(tokens: list[Token]) -> str:
    """The separator missing before the last token; empty if both tokens stand on one line, since the position suffices
    then."""
    if len(tokens) < 2 or tokens[-2].kind not in _ENDS_VALUE or tokens[-2].span.end_line == tokens[-1].span.line:
        return ""
    opened = opening_bracket(tokens, len(tokens) - 1)
    if opened < 0 or tokens[opened].kind == "{":
        return ";" if tokens[-1].kind in _BEGINS_STATEMENT else ""
    return "," if tokens[-1].kind in _BEGINS_VALUE else ""


def opening_bracket(tokens: list[Token], place: int) -> int:
    """The index of the innermost bracket that is open at a token; -1 for none."""
    closed: list[str] = []
    while place > 0:
        place -= 1
        kind = tokens[place].kind
        if kind in _CLOSED_BY:
            closed.append(_CLOSED_BY[kind])
        elif kind in ("(", "[", "{"):
            if not closed:
                return place
            closed.pop()
    return -1
