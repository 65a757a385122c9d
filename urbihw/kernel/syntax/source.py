"""The characters of one stream: positions, beginnings of statements, blanks, comments and synclines.

``SourceText`` buffers the input that has not been read yet, whatever the boundaries of packets, and knows the
position of the next character.  The lexer derives from it.  Long comments are released piece by piece, so that they
take time in proportion to their length.

Facts of the server protocol (section 2): columns count bytes; CR LF, LF CR, CR and LF are one line each; in a string
CR and LF are two lines; only ``\\n`` ends a ``//`` comment; comments nest.  Synclines: see the manual.

Text is a str with one character per byte (latin-1).
"""

from __future__ import annotations

import re
from typing import Final

from urbihw.kernel.syntax.location import Position, Span

_new: Final = tuple.__new__
_BLANKS = re.compile(r"[ \t\r\n]*")
_LINE_END = re.compile(r"\r\n|\n\r|\r|\n")
_COMMENT_PART = re.compile(r"/\*|\*/")
_WORD_CHARACTERS = re.compile(r"[A-Za-z0-9_]+\Z")
_SYNCLINE = re.compile(r'//#(?:(line|push)[ \t]+([0-9]{1,9})[ \t]+"([^"]*)"|(pop))[ \t\r]*\Z')
# Maximum length of a comment that can be a syncline.
_SYNCLINE_SIZE = 4096


class SourceText:
    """One stream of characters, fed packet by packet.

    ``begin`` skips to the first character of a statement, ``take_text`` ends it and returns its text.  Spans are
    relative to the first character of the statement; ``base`` is where that is, and ``synclines`` whether lines were
    renumbered inside it.
    """

    def __init__(self, file: str | None = None) -> None:
        self.base = Position(1, 1, file)
        self.synclines = False
        self._buffer = ""
        self._at = 0
        self._closed = False
        # Packets that only extend a long word: the word is not scanned again before its end has arrived.
        self._waiting: list[str] = []
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
        # The token that the next character is inside of: "", or a block or line comment; the lexer adds others.
        self._mode = ""
        self._depth = 0
        self._comment: list[str] = []
        self._comment_left = 0

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
        """End the input: an unfinished token ends here."""
        self.feed("")
        self._closed = True

    @property
    def closed(self) -> bool:
        """Whether the input has ended."""
        return self._closed

    @property
    def unfinished(self) -> bool:
        """Whether the input stops inside a string, a comment or a binary."""
        return self._mode not in ("", "line")

    @property
    def position(self) -> Position:
        """The position of the next character."""
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
    def is_at_start(self) -> bool:
        """Whether the statement has begun and nothing of it was read yet."""
        return self._at == self._text_at and not self._text and not self._mode

    def take_text(self) -> str:
        """End the statement; its text, from ``base`` to the last character read."""
        self._text.append(self._buffer[self._text_at : self._at])
        text = "".join(self._text)
        self._text = []
        self._inside = False
        return text

    @property
    def text(self) -> str:
        """The text of the current statement, as far as it was read."""
        return "".join((*self._text, self._buffer[self._text_at : self._at]))

    @property
    def ends_line(self) -> bool:
        """Whether the input so far ends a line."""
        return self._buffer.endswith("\n")

    @property
    def is_inside(self) -> bool:
        """Whether a statement has begun and not ended."""
        return self._inside

    def drop_text(self) -> None:
        """Release the text of the current statement so far, which is not needed."""
        self._text.clear()
        self._text_at = self._at
        del self._waiting[1:]

    @property
    def unread_input(self) -> tuple[str, int]:
        """The buffer and the index of the next character in it, to look up a cached statement."""
        return self._buffer, self._at

    def skip(self, size: int, lines: int, end_column: int) -> None:
        """Skip a cached statement of ``size`` characters, which ends ``lines`` lines below its beginning;
        ``end_column`` is the column behind it in its last line."""
        self._at += size
        if lines:
            self._line += lines
            self._origin = self._at - end_column
        self._inside = False

    @property
    def extent(self) -> tuple[int, int]:
        """Where the statement so far ends: the number of lines below its first, and the column behind it."""
        lines = self._relative_line - 1
        return lines, self._at - (self._origin if lines else self._relative_origin)

    def _span(self, begin: int, end: int) -> Span:
        """The span of characters of the current line."""
        line, origin = self._relative_line, self._relative_origin
        return _new(Span, (line, begin - origin, line, end - origin))

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
        if text == "\n" and pairs and end == len(self._buffer) and not self._closed:
            return  # the case behind most statements; it may be half of a pair
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
        """Begin a line at an index of the buffer, ``count`` lines below the current one."""
        self._line += count
        self._relative_line += count
        self._origin = self._relative_origin = begin - 1

    def _begin_comment(self) -> None:
        if self._buffer[self._at + 1] == "*":
            self._mode = "block"
            self._depth = 0
            return
        self._mode = "line"
        self._comment_left = _SYNCLINE_SIZE
        self._comment = []

    def _go_on_comment(self) -> bool:
        return self._go_on_block_comment() if self._mode == "block" else self._go_on_line_comment()

    def _go_on_line_comment(self) -> bool:
        """Read to the end of the line; false if it has not arrived yet."""
        end = self._buffer.find("\n", self._at)
        whole = end >= 0
        if not whole:
            end = len(self._buffer)
        if self._comment_left > 0:
            text = self._buffer[self._at : end]
            self._comment.append(text)
            self._comment_left -= len(text)
        self._at = end
        if not whole and not self._closed:
            return False
        self._mode = ""
        if self._comment_left > 0 and whole:
            self._syncline("".join(self._comment))
        return True

    def _syncline(self, comment: str) -> None:
        """Apply ``//#line``, ``//#push`` and ``//#pop``, which set the position of the next line."""
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
        # The line end behind the comment has not been counted yet.
        self._relative_line += line - 1 - self._line
        self._line = line - 1

    def _go_on_block_comment(self) -> bool:
        """Read to the end of the comment, which may contain others; false if it has not arrived yet."""
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
