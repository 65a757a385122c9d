"""What may be wrong where the parser met something unexpected: a misspelt keyword, or a missing separator.

The parser says what it did not expect; that is often behind the mistake.  Only once there is an error, the tokens
before it are read again, so this costs correct programs nothing.
"""

from __future__ import annotations

import difflib
from typing import Final

from urbihw.kernel.syntax.lexer import Lexer
from urbihw.kernel.syntax.location import Position, Span
from urbihw.kernel.syntax.tokens import KEYWORDS, Token

LONGEST: Final = 10_000
"""Nothing is said about longer statements, in characters: to read them again would take too long."""
SHORT: Final = 3
"""Keywords of so many letters are near to many names: they are meant by a word of just the same letters only."""
LIKENESS: Final = 0.75
"""How alike two words must be, from 0 to 1 as ``difflib`` counts."""

_ENDS_VALUE: Final = frozenset(["NAME", "FLOAT", "TIME", "STRING", ")", "]", "}", "this", "call"])
_BEGINS_VALUE: Final = frozenset(["NAME", "FLOAT", "TIME", "STRING", "this", "call", "new", "function", "closure"])
_BEGINS_STATEMENT: Final = _BEGINS_VALUE | frozenset(
    [
        "assert", "at", "break", "class", "const", "continue", "do", "enum", "every", "for", "freezeif", "if", "loop",
        "return", "stopif", "switch", "throw", "timeout", "try", "var", "waituntil", "whenever", "while",
    ]  # fmt: skip
)
LATER: Final = {
    "import": "import of Urbi 3 is not here: write the object before the name, as in Math.cos",
    "package": "package of Urbi 3 is not here: write class Global.NAME { }",
    "sync": "`at sync' of Urbi 3 is not here: emit by syncEmit, which waits for what it begins",
}
"""What later versions have and this one has not, by the word that says so, and what to write."""
_CLOSED_BY: Final = {")": "(", "]": "[", "}": "{"}


def hint(text: str, span: Span, base: Position) -> str:
    """What to add to the message "unexpected ..." about a stretch of a statement; empty if nothing is known.

    ``text`` is the statement, which begins at ``base``; the span is relative to that.
    """
    if len(text) > LONGEST:
        return ""
    tokens = _tokens_up_to(text, span)
    if not tokens or tokens[-1].span[:2] != span[:2]:
        return ""
    word = _later(tokens) or _misspelt(tokens)
    if word:
        return word
    sign = _missing(tokens)
    if not sign:
        return ""
    end = tokens[-2].span
    return f" (missing {sign} at {Position(end.end_line, end.end_column).after(base)})"


def _tokens_up_to(text: str, span: Span) -> list[Token]:
    """The tokens up to the one that was not expected."""
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


def _later(tokens: list[Token]) -> str:
    """What to write instead of something of a later version, or nothing."""
    words = [token.value for token in tokens[-2:]]
    if tokens[-1].kind != "NAME":
        return ""
    found = words[0] if words[0] in ("import", "package") else "sync" if words == ["at", "sync"] else ""
    return f" ({LATER[found]})" if found else ""


def _misspelt(tokens: list[Token]) -> str:
    """Which word may be a misspelt keyword: the unexpected one, the one before, or that before a group beside it."""
    unexpected = len(tokens) - 1
    places = [unexpected, unexpected - 1]
    opened = _opened(tokens, unexpected)
    if opened >= 0:
        places.append(opened - 1)
    if unexpected and tokens[unexpected - 1].kind == ")":
        places.append(_opened(tokens, unexpected - 1) - 1)
    for place in places:
        if place >= 0 and tokens[place].kind == "NAME":
            keyword = _near_keyword(tokens[place].text)
            if keyword:
                return f" ({tokens[place].text}: possible misspelling of {keyword})"
    return ""


def _near_keyword(word: str) -> str:
    """The keyword that a word may be meant to be, or nothing."""
    for keyword in sorted(KEYWORDS):
        if len(keyword) <= SHORT and set(keyword) == set(word) and abs(len(keyword) - len(word)) <= 1:
            return keyword
    long = (keyword for keyword in sorted(KEYWORDS) if len(keyword) > SHORT)
    return next(iter(difflib.get_close_matches(word, long, 1, LIKENESS)), "")


def _missing(tokens: list[Token]) -> str:
    """The separator that is missing before the last token, or nothing if both stand on one line: that says where."""
    if len(tokens) < 2 or tokens[-2].kind not in _ENDS_VALUE or tokens[-2].span.end_line == tokens[-1].span.line:
        return ""
    opened = _opened(tokens, len(tokens) - 1)
    if opened < 0 or tokens[opened].kind == "{":
        return ";" if tokens[-1].kind in _BEGINS_STATEMENT else ""
    return "," if tokens[-1].kind in _BEGINS_VALUE else ""


def _opened(tokens: list[Token], place: int) -> int:
    """Where the innermost bracket around a token was opened, -1 for none."""
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
