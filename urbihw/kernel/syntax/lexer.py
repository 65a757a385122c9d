"""Characters in, tokens out, whatever the boundaries of packets.

The lexer stops in front of a token that more characters might make longer (a name, a number, ``<`` before ``=``).
Long strings and binary blobs are removed from the buffer piece by piece, so that a statement takes time in proportion
to its length even when it arrives byte by byte.

Facts of the server protocol (sections 2 and 4): in a string CR and LF both become a line feed; a blob counts no
lines; NUL, control characters and bytes from 0x80 on are errors outside strings and comments, one each.
"""

from __future__ import annotations

import re
from typing import Final

from urbihw.kernel.syntax.location import Span
from urbihw.kernel.syntax.rules import Problem
from urbihw.kernel.syntax.source import SourceText
from urbihw.kernel.syntax.tokens import (
    ANGLES,
    DURATIONS,
    ESCAPES,
    IGNORED,
    KEYWORDS,
    RESERVED,
    SIGNS,
    SYNONYMS,
    Token,
    escaped,
)

_new: Final = tuple.__new__
KNOWN: Final = {**{text: text for text in (*KEYWORDS, *SIGNS)}, **SYNONYMS}
"""The kinds of the tokens that keywords, signs, and their other spellings are."""
ODD_WORDS: Final = RESERVED | IGNORED | {"BIN"}

_SIGN = "|".join(re.escape(sign) for sign in sorted(SIGNS, key=len, reverse=True))
_TOKEN = re.compile(
    rf"""
    [ \t]* (?:
      (?P<word> [A-Za-z_][A-Za-z0-9_]* )
    | (?P<number> (?: (?P<hex> 0x[0-9A-Fa-f]+) | (?P<decimal> [0-9]+ (?:\.[0-9]+)? (?:[eE][-+]?[0-9]+)? ) )
                  (?P<unit> [A-Za-z0-9_]* ) )
    | (?P<comment> /[/*] )
    | (?P<sign> {_SIGN} )
    | (?P<quote> ["'] )
    )
    """,
    re.VERBOSE,
)
# Beginnings of signs and comments that more characters may make longer.
_UNFINISHED_SIGNS = {sign[:size] for sign in {*SIGNS, "//", "/*"} for size in range(1, len(sign))}
# A word of more characters is not scanned again before its end has arrived.
_LONG_WORD = 64
_UNFINISHED_NUMBER = re.compile(r"[0-9][A-Za-z0-9_]*(?:\.[A-Za-z0-9_]*)?(?:(?<=[eE])[-+][0-9A-Za-z_]*)?\Z")

_STRING_PART = {'"': re.compile(r'[^"\\]+'), "'": re.compile(r"[^'\\\n]+")}
_ESCAPE = re.compile(r"\\(?:([0-7]{1,3})|x([0-9A-Fa-f]{2})|B\(([0-9]{1,15})\)\(|([\\\"'abfnrtv]))", re.DOTALL)
_UNFINISHED_ESCAPE = re.compile(r"\\(?:[0-7]{1,2}|x[0-9A-Fa-f]?|B(?:\((?:[0-9]{1,15}\)?)?)?)?\Z")

# The old literal `BIN size keywords;data`.  The keywords are limited, or each packet would scan them again.
_BINARY = re.compile(r"BIN[ \t\r\n]+([0-9]{1,15})([^;]{0,1000});")
_UNFINISHED_BINARY = re.compile(r"BIN(?:[ \t\r\n]+(?:[0-9]{1,15}[^;]{0,1000})?)?\Z")
_TYPOGRAPHIC_QUOTE = re.compile("\xe2\x80[\x98-\x9f]")
_UNFINISHED_QUOTE = re.compile(r"\xe2\x80?\Z")


class Lexer(SourceText):
    """Splits one stream into tokens; invalid characters are reported to ``problems``.

    After ``begin`` has skipped to the first character of a statement, ``next`` returns its tokens one by one.
    """

    def __init__(self, problems: list[Problem], file: str | None = None) -> None:
        super().__init__(file)
        self._problems = problems
        # The state of the token that ``_mode`` names: a string, a blob in a string, its closing parenthesis, data of a
        # binary.
        self._parts: list[str] = []
        self._quote = ""
        self._missing = 0
        self._started = (1, 1)
        self._keywords = ""
        self._met_quote = False
        """Whether the current statement has a typographic quote."""

    def take_text(self) -> str:
        """End the statement; its text, from ``base`` to the last character read."""
        self._met_quote = False
        return super().take_text()

    def next(self) -> Token | None:
        """The next token; None if the input so far has no further complete one."""
        while True:
            if self._mode:
                token = self._continue()
                if token is not None:
                    return token
                if self._mode:
                    return None
            buffer, begin = self._buffer, self._at
            match = _TOKEN.match(buffer, begin)
            if match is None:
                if not self._skip_blanks():
                    return None
                if self._at == begin and not self._invalid_character():
                    return None
                continue
            kind = match.lastgroup
            assert kind is not None
            at, end = match.span(kind)
            if end + 2 > len(buffer) and not self._closed:
                self._at = at
                if self._may_grow(kind, at, end):
                    return None
            text = match[kind]
            known = KNOWN.get(text)
            if known is not None or kind == "word" and text not in ODD_WORDS:
                self._at = end
                return _new(Token, (known or "NAME", known or text, self._span(at, end)))
            token = self._scan_other(match, kind, at, end)
            if token is not None:
                return token
            if self._at == at and not self._mode:
                return None

    def _scan_other(self, match: re.Match[str], kind: str, at: int, end: int) -> Token | None:
        """Scan a number or an unusual word, or begin a string or a comment."""
        if kind == "number":
            self._at = end
            return self._number(match, self._span(at, end))
        self._at = at
        if kind == "word":
            return self._scan_odd_word(match[kind], at, end)
        if kind == "comment":
            self._begin_comment()
            return None
        self._quote = match[kind]
        self._started = (self._relative_line, at - self._relative_origin)
        self._at = end
        self._mode = "string"
        self._parts = []
        return None

    def drop_text(self) -> None:
        """Release the text of the current statement so far, and the content of an unfinished string or binary."""
        super().drop_text()
        self._parts.clear()

    def _may_grow(self, kind: str | None, at: int, end: int) -> bool:
        """Whether the token at the end of the buffer may become longer."""
        rest = self._buffer[at:]
        if kind not in ("word", "number"):
            return rest in _UNFINISHED_SIGNS
        if kind == "word" and end < len(self._buffer) or kind == "number" and not _UNFINISHED_NUMBER.match(rest):
            return False
        if len(rest) > _LONG_WORD:
            self._waiting.append("")
        return True

    def _span_from_start(self) -> Span:
        """The span from the beginning of the current string or binary to the next character."""
        return Span(*self._started, self._relative_line, self._at - self._relative_origin)

    def _problem(self, message: str, span: Span) -> None:
        self._problems.append(Problem(message, span))

    def _scan_odd_word(self, word: str, at: int, end: int) -> Token | None:
        """Scan a word that begins a binary, or that is neither a name nor a keyword."""
        if word == "BIN":
            if not self._begin_binary(at):
                return None
            if self._mode:
                return self._continue()
        self._at = end
        span = self._span(at, end)
        if word in RESERVED:
            self._problem(f"reserved symbol: `{word}'", span)
        elif word in IGNORED:
            return None
        return Token("NAME", word, span)

    def _number(self, match: re.Match[str], span: Span) -> Token | None:
        if match["hex"]:
            if not match["unit"]:
                return Token("FLOAT", float(int(match["hex"], 16)), span)
        else:
            unit = match["unit"]
            value = float(match["decimal"])
            if not unit:
                return Token("FLOAT", value, span)
            if unit in DURATIONS:
                return Token("TIME", value * DURATIONS[unit], span)
            if unit in ANGLES:
                return Token("FLOAT", value / ANGLES[unit], span)
        self._problem(f"invalid token: `{match['number']}'", span)
        return None

    def _invalid_character(self) -> bool:
        """Report the character at the present place.  Returns False if it is not complete yet.

        A statement with several typographic quotes gets one report.
        """
        quote = _TYPOGRAPHIC_QUOTE.match(self._buffer, self._at)
        if quote is None and not self._closed and _UNFINISHED_QUOTE.match(self._buffer, self._at):
            return False
        characters = self._buffer[self._at] if quote is None else quote[0]
        shown = "" if characters == "\0" else escaped(characters)
        span = self._span(self._at, self._at + len(characters))
        self._at += len(characters)
        if quote is None or not self._met_quote:
            self._problem(f"invalid character: `{shown}'", span)
        self._met_quote = self._met_quote or quote is not None
        return True

    # ------------------------------------------------------------ strings and binaries

    def _continue(self) -> Token | None:
        """Continue inside a comment, a string or a binary.  Returns a token if that ends one."""
        while True:
            match self._mode:
                case "block" | "line":
                    self._go_on_comment()
                    return None
                case "string":
                    token = self._go_on_string()
                    if self._mode == "string" or not self._mode:
                        return token
                case "blob" | "data":
                    if not self._go_on_blob():
                        return None
                    if self._mode == "data":
                        self._mode = ""
                        return Token("BINARY", (self._keywords, "".join(self._parts)), self._span_from_start())
                    self._mode = "close"
                case "close":
                    if not self._close_blob():
                        return None

    def _go_on_string(self) -> Token | None:
        """Read to the end of the string, or to a blob in it.  Returns the token if the string ends."""
        buffer = self._buffer
        part = _STRING_PART[self._quote]
        while self._at < len(buffer):
            plain = part.match(buffer, self._at)
            if plain is not None:
                self._parts.append(plain[0].replace("\r", "\n"))
                self._advance_lines(plain.end(), pairs=False)
                continue
            if buffer[self._at] == self._quote:
                self._at += 1
                self._mode = ""
                kind = "STRING" if self._quote == '"' else "NAME"
                return Token(kind, "".join(self._parts), self._span_from_start())
            if buffer[self._at] == "\n":  # a stray apostrophe must not swallow what is typed on the next lines
                self._mode = ""
                self._problem("unterminated quoted identifier", self._span_from_start())
                return Token("NAME", "".join(self._parts), self._span_from_start())
            if not self._escape() or self._mode != "string":
                return None
        return None

    def _escape(self) -> bool:
        """Read one escape; false if it is not complete yet."""
        match = _ESCAPE.match(self._buffer, self._at)
        rest = self._buffer[self._at : self._at + 24]
        if not self._closed and _UNFINISHED_ESCAPE.match(rest):
            return False
        if match is None:
            self._at += len(rest[:2])
            shown = escaped(rest[1:2])
            self._problem(rf"invalid character after \-escape: `{shown}'", self._span_from_start())
            return True
        octal, hexadecimal, size, letter = match.groups()
        self._at = match.end()
        if octal:
            self._parts.append(chr(int(octal, 8) & 0xFF))
        elif hexadecimal:
            self._parts.append(chr(int(hexadecimal, 16)))
        elif letter:
            self._parts.append(ESCAPES[letter])
        else:
            self._missing = int(size)
            self._mode = "blob"
        return True

    def _go_on_blob(self) -> bool:
        """Read raw bytes, in which no lines are counted; false if some are missing."""
        data = self._buffer[self._at : self._at + self._missing]
        self._parts.append(data)
        self._at += len(data)
        self._missing -= len(data)
        return not self._missing

    def _close_blob(self) -> bool:
        """Read the parenthesis behind a blob; false if it has not arrived yet."""
        if self._at == len(self._buffer):
            return False
        character = self._buffer[self._at]
        self._mode = "string"
        if character == ")":
            self._at += 1
            return True
        message = rf"unexpected '{escaped(character)}' for closing \B, expected ')'"
        self._problem(message, self._span_from_start())
        return True

    def _begin_binary(self, at: int) -> bool:
        """Begin a binary at the word BIN, if it is one; false if that cannot be decided yet."""
        match = _BINARY.match(self._buffer, at)
        if match is None:
            return self._closed or _UNFINISHED_BINARY.match(self._buffer, at) is None
        self._started = (self._relative_line, at - self._relative_origin)
        self._advance_lines(match.end())
        self._keywords = match[2].strip()
        self._missing = int(match[1])
        self._parts = []
        self._mode = "data"
        return True
