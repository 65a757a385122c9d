"""Characters in, tokens out, however they are cut into packets.

The lexer holds what has not been read yet in a buffer and stops in front of a token that more characters might make
longer (a name, a number, ``<`` before ``=``).  Strings, comments and binary blobs may be long and are taken out of
the buffer piece by piece, so that a statement costs time in proportion to its length even when it comes byte by byte.

Facts of the server protocol (sections 2 and 4): columns count bytes; CR LF, LF CR, CR and LF are one line each; in a
string CR and LF are two lines and both become a line feed; a blob counts no lines; only ``\\n`` ends a ``//`` comment;
NUL, control characters and bytes from 0x80 on are errors outside strings and comments, one each.

Text is a str with one character per byte (latin-1).
"""

from __future__ import annotations

import re

from urbihw.kernel.syntax.expressions import Problem
from urbihw.kernel.syntax.location import Position, Span
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

_SIGN = "|".join(re.escape(sign) for sign in sorted(SIGNS, key=len, reverse=True))
_TOKEN = re.compile(
    rf"""
      (?P<word> [A-Za-z_][A-Za-z0-9_]* )
    | (?P<number> (?: (?P<hex> 0x[0-9A-Fa-f]+) | (?P<decimal> [0-9]+ (?:\.[0-9]+)? (?:[eE][-+]?[0-9]+)? ) )
                  (?P<unit> [A-Za-z0-9_]* ) )
    | (?P<comment> /[/*] )
    | (?P<sign> {_SIGN} )
    | (?P<quote> ["'] )
    """,
    re.VERBOSE,
)
_BLANKS = re.compile(r"[ \t\r\n]*")
_LINE_END = re.compile(r"\r\n|\n\r|\r|\n")
_COMMENT_PART = re.compile(r"/\*|\*/")
_WORD_CHARACTERS = re.compile(r"[A-Za-z0-9_]+\Z")
# Beginnings of signs and comments that more characters may make longer.
_UNFINISHED_SIGNS = {sign[:size] for sign in {*SIGNS, "//", "/*"} for size in range(1, len(sign))}
# From this size on a word is not looked at again before its end has come.
_LONG_WORD = 64
_UNFINISHED_NUMBER = re.compile(r"[0-9][A-Za-z0-9_]*(?:\.[A-Za-z0-9_]*)?(?:(?<=[eE])[-+][0-9A-Za-z_]*)?\Z")

_STRING_PART = {quote: re.compile(rf"[^{quote}\\]+") for quote in "\"'"}
_ESCAPE = re.compile(r"\\(?:([0-7]{1,3})|x([0-9A-Fa-f]{2})|B\(([0-9]{1,15})\)\(|([\\\"'abfnrtv]))", re.DOTALL)
_UNFINISHED_ESCAPE = re.compile(r"\\(?:[0-7]{1,2}|x[0-9A-Fa-f]?|B(?:\((?:[0-9]{1,15}\)?)?)?)?\Z")

# The old literal `BIN size keywords;data`; the keywords may not be endless, or each packet would look at them again.
_BINARY = re.compile(r"BIN[ \t\r\n]+([0-9]{1,15})([^;]{0,1000});")
_UNFINISHED_BINARY = re.compile(r"BIN(?:[ \t\r\n]+(?:[0-9]{1,15}[^;]{0,1000})?)?\Z")

_SYNCLINE = re.compile(r'//#(?:(line|push)[ \t]+([0-9]{1,9})[ \t]+"([^"]*)"|(pop))[ \t\r]*\Z')
# The longest comment that is looked at as a syncline.
_SYNCLINE_SIZE = 4096


class Lexer:
    """Cuts one stream into tokens; ``problems`` is where it reports what is no token.

    ``begin`` goes to the first character of a statement, ``next`` gives its tokens one by one, ``take`` ends it and
    gives its text.  Spans of tokens are relative to the first character of the statement, ``base`` is where that is.
    """

    def __init__(self, problems: list[Problem], file: str | None = None) -> None:
        self.base = Position(1, 1, file)
        self.synclines = False
        self._problems = problems
        self._buffer = ""
        self._waiting: list[str] = []  # packets that only make a long word longer
        self._at = 0
        self._closed = False
        self._file = file
        self._pushed: list[tuple[str | None, int]] = []
        # The line of the next character, and the index in the buffer of the column before 1.
        self._line = 1
        self._origin = -1
        # The same relative to the statement, and where its text begins in the buffer; earlier parts of it are kept.
        self._inside = False
        self._relative_line = 1
        self._relative_origin = -1
        self._text_at = 0
        self._text: list[str] = []
        # What the next character is inside of: "" or one of string, blob, close, data, block, line.
        self._mode = ""
        self._parts: list[str] = []
        self._quote = ""
        self._missing = 0
        self._depth = 0
        self._started = (1, 1)
        self._keywords = ""

    # ------------------------------------------------------------ input

    def feed(self, text: str) -> None:
        """Add characters to the input."""
        if self._waiting and _WORD_CHARACTERS.match(text):
            self._waiting.append(text)
            return
        if self._inside and self._at > self._text_at:
            self._text.append(self._buffer[self._text_at : self._at])
        self._text_at = 0
        self._origin -= self._at
        self._relative_origin -= self._at
        self._buffer = "".join([self._buffer[self._at :], *self._waiting, text])
        self._waiting.clear()
        self._at = 0

    def close(self) -> None:
        """No more input will come: what is unfinished is as long as it gets."""
        self.feed("")
        self._closed = True

    @property
    def unfinished(self) -> bool:
        """Whether the input stops inside a string, a comment or a binary."""
        return self._mode not in ("", "line")

    @property
    def position(self) -> Position:
        """Where the next character is."""
        return Position(self._line, self._at - self._origin, self._file)

    # ------------------------------------------------------------ statements

    def begin(self) -> bool:
        """Skip blanks and comments; true if a statement begins behind them, at ``base``."""
        if self._inside:
            return True
        while True:
            if self._mode:
                if not self._go_on_comment():
                    return False
                continue
            if not self._skip_blanks():
                return False
            if not self._buffer.startswith("/", self._at):
                break
            if self._at + 1 == len(self._buffer) and not self._closed:
                return False
            if not self._buffer.startswith(("//", "/*"), self._at):
                break
            self._begin_comment()
        self._open()
        return True

    def _open(self) -> None:
        self.base = self.position
        self._inside = True
        self.synclines = False
        self._relative_line = 1
        self._relative_origin = self._at - 1
        self._text_at = self._at
        self._text = []

    def end(self) -> Span:
        """The empty span at the end of the statement, or of one that begins here."""
        if not self._inside:
            self._open()
        return self._span(self._at, self._at)

    @property
    def fresh(self) -> bool:
        """Whether nothing of the statement that has begun was read yet."""
        return self._at == self._text_at and not self._text and not self._mode

    def take(self) -> str:
        """End the statement; its text, from ``base`` to the last character read."""
        self._text.append(self._buffer[self._text_at : self._at])
        text = "".join(self._text)
        self._text = []
        self._inside = False
        return text

    @property
    def rest(self) -> tuple[str, int]:
        """The buffer and where the next character is in it, for who knows the statement that begins there."""
        return self._buffer, self._at

    def skip(self, size: int, lines: int, end_column: int) -> None:
        """Skip a whole statement of ``size`` characters that is known: how many lines it ends below its beginning,
        and the column behind it relative to its last line."""
        self._at += size
        if lines:
            self._line += lines
            self._origin = self._at - end_column
        self._inside = False

    @property
    def extent(self) -> tuple[int, int]:
        """Of the statement so far: the number of lines below the first, and the column behind it in its last line."""
        lines = self._relative_line - 1
        return lines, self._at - (self._origin if lines else self._relative_origin)

    # ------------------------------------------------------------ tokens

    def next(self) -> Token | None:
        """The next token, or None if the input so far has no more whole ones."""
        while True:
            if self._mode:
                token = self._go_on()
                if token is not None:
                    return token
                if self._mode:
                    return None
            if not self._skip_blanks():
                return None
            buffer, at = self._buffer, self._at
            match = _TOKEN.match(buffer, at)
            if match is None:
                self._invalid_character()
                continue
            kind, end = match.lastgroup, match.end()
            if end + 2 > len(buffer) and not self._closed and self._may_grow(kind, at, end):
                return None
            if kind == "sign":
                self._at = end
                text = match[0]
                return Token(text, text, self._span(at, end))
            if kind == "word":
                token = self._word(match[0], at, end)
            elif kind == "number":
                token = self._number(match)
            elif kind == "quote":
                self._quote = match[0]
                self._started = (self._relative_line, at - self._relative_origin)
                self._at = end
                self._mode = "string"
                self._parts = []
                continue
            else:
                self._begin_comment()
                continue
            if token is not None:
                return token
            if self._at == at:
                return None

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

    def _span(self, begin: int, end: int) -> Span:
        """The span of characters of the present line."""
        line, origin = self._relative_line, self._relative_origin
        return Span(line, begin - origin, line, end - origin)

    def _span_from_start(self) -> Span:
        """From where the present string or binary began to the next character."""
        return Span(*self._started, self._relative_line, self._at - self._relative_origin)

    def _problem(self, message: str, span: Span) -> None:
        self._problems.append(Problem(message, span))

    def _word(self, word: str, at: int, end: int) -> Token | None:
        if word == "BIN" and not self._begin_binary(at):
            return None
        if self._mode:
            return self._go_on()
        self._at = end
        span = self._span(at, end)
        if word in KEYWORDS:
            return Token(word, word, span)
        if word in SYNONYMS:
            return Token(SYNONYMS[word], SYNONYMS[word], span)
        if word in RESERVED:
            self._problem(f"reserved symbol: `{word}'", span)
        elif word in IGNORED:
            return None
        return Token("NAME", word, span)

    def _number(self, match: re.Match[str]) -> Token | None:
        at, end = match.span()
        self._at = end
        span = self._span(at, end)
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
                return Token("FLOAT", value * ANGLES[unit], span)
        self._problem(f"invalid token: `{match[0]}'", span)
        return None

    def _invalid_character(self) -> None:
        character = self._buffer[self._at]
        shown = "" if character == "\0" else escaped(character)
        span = self._span(self._at, self._at + 1)
        self._at += 1
        self._problem(f"invalid character: `{shown}'", span)

    # ------------------------------------------------------------ blanks and comments

    def _skip_blanks(self) -> bool:
        """Go to the next character that is not blank; false if there is none yet."""
        buffer = self._buffer
        end = _BLANKS.match(buffer, self._at).end()  # type: ignore[union-attr]
        if end > self._at:
            self._advance_lines(end)
        return self._at < len(buffer) and buffer[self._at] not in " \t\r\n"

    def _advance_lines(self, end: int, pairs: bool = True) -> None:
        """Go to ``end``, counting the line ends on the way.

        With ``pairs``, CR and LF together are one line; then a lone one at the end of the buffer has to wait.
        """
        text = self._buffer[self._at : end]
        if "\n" not in text and "\r" not in text:
            self._at = end
            return
        line_ends = list(_LINE_END.finditer(text)) if pairs else list(re.finditer(r"[\r\n]", text))
        last = line_ends[-1]
        if pairs and last.end() == len(text) and len(last[0]) == 1 and end == len(self._buffer) and not self._closed:
            end -= 1
            line_ends.pop()
        if line_ends:
            self._new_line(len(line_ends), self._at + line_ends[-1].end())
        self._at = end

    def _new_line(self, count: int, begin: int) -> None:
        """The line that begins at an index of the buffer is ``count`` below the present one."""
        self._line += count
        self._relative_line += count
        self._origin = self._relative_origin = begin - 1

    def _begin_comment(self) -> None:
        if self._buffer[self._at + 1] == "*":
            self._mode = "block"
            self._depth = 0
            return
        self._mode = "line"
        self._missing = _SYNCLINE_SIZE
        self._parts = []

    def _go_on_comment(self) -> bool:
        return self._go_on_block_comment() if self._mode == "block" else self._go_on_line_comment()

    def _go_on_line_comment(self) -> bool:
        """Read to the end of the line; false if it has not come yet."""
        end = self._buffer.find("\n", self._at)
        whole = end >= 0
        if not whole:
            end = len(self._buffer)
        if self._missing > 0:
            text = self._buffer[self._at : end]
            self._parts.append(text)
            self._missing -= len(text)
        self._at = end
        if not whole and not self._closed:
            return False
        self._mode = ""
        if self._missing > 0 and whole:
            self._syncline("".join(self._parts))
        return True

    def _syncline(self, comment: str) -> None:
        """Obey ``//#line``, ``//#push`` and ``//#pop``: they say where the next line is."""
        match = _SYNCLINE.match(comment)
        if match is None or (match[4] and not self._pushed):
            return
        self.synclines = True
        if match[1] == "push":
            self._pushed.append((self._file, self._line))
        line: int
        if match[4]:
            self._file, line = self._pushed.pop()
        else:
            self._file, line = match[3], int(match[2])
        # The line end behind the comment is still to be counted.
        self._relative_line += line - 1 - self._line
        self._line = line - 1

    def _go_on_block_comment(self) -> bool:
        """Read to the end of the comment, which may hold others; false if it has not come yet."""
        while True:
            match = _COMMENT_PART.search(self._buffer, self._at)
            if match is None:
                break
            self._advance_lines(match.end())
            self._depth += 1 if match[0] == "/*" else -1
            if not self._depth:
                self._mode = ""
                return True
        end = len(self._buffer)
        if end > self._at and self._buffer[-1] in "/*" and not self._closed:
            end -= 1
        self._advance_lines(end)
        return False

    # ------------------------------------------------------------ strings and binaries

    def _go_on(self) -> Token | None:
        """Go on inside a comment, a string or a binary; a token if it ends one."""
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
        """Read to the end of the string, or to a blob in it; the token if it ends."""
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
            if not self._escape() or self._mode != "string":
                return None
        return None

    def _escape(self) -> bool:
        """Read one escape; false if it is not whole yet."""
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
        """Read raw bytes, which count no lines; false if some are missing."""
        data = self._buffer[self._at : self._at + self._missing]
        self._parts.append(data)
        self._at += len(data)
        self._missing -= len(data)
        return not self._missing

    def _close_blob(self) -> bool:
        """Read the parenthesis behind a blob; false if it has not come yet."""
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
        """At the word BIN: enter a binary if it is one; false if that cannot be told yet."""
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
