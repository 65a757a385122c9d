"""The reader of a connection: bytes in, statements and syntax errors out.

A statement is returned as soon as its ``;`` or ``,`` has been read, whatever the boundaries of packets.  One with an
error is not returned (server protocol, section 2), but its errors are: when it is complete, or when the input so far
ends a line.  So who has forgotten a bracket hears of it, although all is skipped until it is closed.  Texts are cached
with their nodes: a command that a program sends again and again is not lexed again.

``MAX_TOKENS``, ``MAX_OPEN`` and ``MAX_BYTES`` limit a statement.  A longer one is refused as soon as that is known, and
the rest of it is skipped: nothing of it runs or is kept.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from urbihw.frozen import frozen
from urbihw.kernel.errors import TOO_DEEP
from urbihw.kernel.syntax.advice import advice
from urbihw.kernel.syntax.ast import Empty, Node
from urbihw.kernel.syntax.chains import PIECE, LongChain, is_long, may_go_on
from urbihw.kernel.syntax.hints import hint
from urbihw.kernel.syntax.lexer import Lexer
from urbihw.kernel.syntax.location import Location, Position
from urbihw.kernel.syntax.pace import StepPace
from urbihw.kernel.syntax.parser import UNEXPECTED, Parser
from urbihw.kernel.syntax.tokens import Token

MAX_TOKENS = 250_000
"""Maximum number of words and signs of a statement; each error counts as one. A statement of this size takes 100 to 300
MB to read and to compile, and 25 ms to free.
"""
TOKENS_OF_A_PIECE = 2
"""What a piece of a long chain counts as: it takes no more memory than two words."""
MAX_OPEN = 20_000
"""Maximum number of unfinished brackets and operators of a statement."""
MAX_BYTES = 16 * 1024 * 1024
"""Maximum length of a statement in bytes, with its strings, comments and binaries."""

MOST_ADVISED = 8
"""Number of errors of a statement whose cause is looked for; each takes as long as to read the statement again."""

_OPENING = frozenset("([{")
_CLOSING = frozenset(")]}")


class Statement(NamedTuple):
    """A whole statement; the spans of its nodes are relative to ``base``.

    ``separator`` is ``;`` or ``,``, or empty for a last statement that the end of input ended.  ``text`` runs from
    the first character of the statement to its separator.
    """

    node: Node
    separator: str
    base: Position
    text: str


@frozen
class SyntaxProblem:
    """A syntax error, or a warning; the message has no ``syntax error:`` in front, ``advice`` is for beginners.

    ``follows``: the same statement has an earlier error with advice, of which this one may be a consequence.
    """

    message: str
    location: Location
    warning: bool = False
    advice: str = ""
    follows: bool = False


Item = Statement | SyntaxProblem


class _Known(NamedTuple):
    """A cached statement and its end: the number of lines below its beginning, and the column."""

    node: Node
    separator: str
    lines: int
    end_column: int


class StatementCache:
    """The statements read lately, by text; several readers may share one.

    ``size`` is the maximum number of statements, ``longest`` the maximum length of a text.  A lookup compares the text
    up to one of the first separators of the input, so nothing needs to be read ahead.
    """

    def __init__(self, size: int = 2048, longest: int = 1000) -> None:
        self.size = size
        self.longest = longest
        self._known: dict[str, _Known] = {}

    def get(self, text: str) -> _Known | None:
        """The statement of a text, which becomes the most recently used one; None if it is not cached."""
        known = self._known.pop(text, None)
        if known is not None:
            self._known[text] = known
        return known

    def put(self, text: str, known: _Known) -> None:
        """Store a statement; the least recently used one is removed if the cache is full."""
        if len(text) > self.longest:
            return
        if len(self._known) >= self.size:
            del self._known[next(iter(self._known))]
        self._known[text] = known

    def __len__(self) -> int:
        return len(self._known)


# Maximum number of separators at which a cached statement is looked up.
_MAX_LOOKUPS = 4
_SEPARATOR = re.compile("[;,]")


class StatementReader:
    """Reads one stream; ``file`` is its name in positions, None for a connection."""

    def __init__(self, file: str | None = None, cache: StatementCache | None = None) -> None:
        self._cache = cache
        self._parser = Parser()
        self._lexer = Lexer(self._parser.problems, file)
        self.total = 0
        """Total number of words and signs read, except those of cached statements."""
        self._tokens = 0
        self._broken = False
        """Whether the current statement has errors that were returned already."""
        self._advised = False
        """Whether one of these has advice."""
        self._looked_into = 0
        """Number of its errors whose cause was looked for."""
        self._bytes = 0
        self._pieces: list[Statement] = []
        """What has been cut of a long chain whose end has not been read yet."""
        # Inside a refused statement: the number of its open brackets; else None.
        self._open: int | None = None

    @property
    def pending(self) -> int:
        """Number of bytes of the incomplete statement."""
        return self._bytes

    def describe_rest(self) -> str:
        """What the incomplete statement needs to be complete, in words; empty without one."""
        if not self._lexer.is_inside:
            return ""
        end = "end the statement with ;"
        if self._lexer.unfinished:
            return f"a String, a name between quotes or a comment is open: close it, and {end}"
        opened = self._parser.open_brackets() if self._open is None else self._open
        return f"a bracket is open: close it, and {end}" if opened > 0 else end

    def feed(self, data: bytes, pace: StepPace | None = None) -> list[Item]:
        """The statements and errors that these bytes complete.

        Each word or sign is a step of ``pace``, and so is each node of a complete statement.  If a pause raises, the
        reader cannot be used any more.
        """
        self._bytes += len(data)
        self._lexer.feed(data.decode("latin-1"))
        items: list[Item] = []
        self._read(items, StepPace() if pace is None else pace)
        return items

    def finish(self, pace: StepPace | None = None) -> list[Item]:
        """End the input.  A last statement without separator is returned, an incomplete one is an error."""
        pace = StepPace() if pace is None else pace
        self._lexer.close()
        items: list[Item] = []
        self._read(items, pace)
        lexer, parser = self._lexer, self._parser
        if self._open is not None or not lexer.begin() and not lexer.unfinished:
            return items
        end = lexer.end()
        parser.push(Token("END", "", end))
        if lexer.unfinished and not parser.problems and not self._broken:
            parser.problem("unexpected end of command", end)
        self._complete(items, pace)
        return items

    def _read(self, items: list[Item], pace: StepPace) -> None:
        lexer, parser = self._lexer, self._parser
        while lexer.begin():
            if self._open is not None:
                if not self._skip(pace):
                    return
                continue
            if self._cache is not None and lexer.is_at_start:
                cut = self._cut_piece(self._cache, items, pace)
                if cut is None:
                    return
                if cut or self._find_known(self._cache, items):
                    continue
            tokens = self._tokens
            while (token := lexer.next()) is not None:
                self._tokens = tokens = tokens + 1
                pace.step()
                if parser.push(token) or token.kind == "BINARY" and self._end_binary():
                    self._complete(items, pace)
                    break
                if tokens >= MAX_OPEN and (too_much := self._too_much(tokens)):
                    self._refuse(too_much, items)
                    break
            else:
                too_much = self._too_much(tokens)
                if not too_much:
                    if parser.problems and lexer.ends_line:
                        text = lexer.text if self._looked_into < MOST_ADVISED else ""  # it may be long
                        self._tell(items, text, lexer.base, pace)
                    return
                self._refuse(too_much, items)
        if not lexer.is_inside and not self._pieces:
            self._bytes = 0

    def _too_much(self, tokens: int) -> str:
        """The limit that the current statement exceeds, in words; empty if it exceeds none."""
        if tokens + len(self._parser.problems) > MAX_TOKENS:
            return f"statement too long (more than {MAX_TOKENS} words and signs): make several of it"
        if self._parser.depth > MAX_OPEN:
            return TOO_DEEP
        if self._bytes > MAX_BYTES:
            return f"statement too long (more than {MAX_BYTES} bytes): make several of it"
        return ""

    def _refuse(self, message: str, items: list[Item]) -> None:
        """Report that the current statement is too long, and skip the rest of it."""
        items.append(SyntaxProblem(message, Location(self._lexer.base, self._lexer.position)))
        self._open = self._parser.open_brackets()
        self._parser.discard()
        self._pieces.clear()
        self._lexer.drop_text()

    def _skip(self, pace: StepPace) -> bool:
        """Continue to skip a refused statement; true if its end has arrived."""
        lexer, opened = self._lexer, self._open
        assert opened is not None
        while (token := lexer.next()) is not None:
            pace.step()
            if token.kind in _OPENING:
                opened += 1
            elif token.kind in _CLOSING:
                opened = max(0, opened - 1)
            elif token.kind in (";", ",", "BINARY") and not opened:
                break
        lexer.drop_text()
        self._parser.problems.clear()
        if token is None:
            self._open = opened
            return False
        self._open = None
        lexer.take_text()
        self._finish_statement()
        return True

    def _finish_statement(self) -> None:
        """Prepare for the next statement."""
        buffer, at = self._lexer.unread_input
        self.total += self._tokens
        self._tokens = 0
        self._broken = self._advised = False
        self._looked_into = 0
        self._bytes = len(buffer) - at

    def _end_binary(self) -> bool:
        """End the statement behind a binary of the old form: any text may follow its data."""
        return self._parser.accepts(";") and self._parser.push(Token(";", ";", self._lexer.end()))

    def _complete(self, items: list[Item], pace: StepPace) -> None:
        """Return the statement that the parser has completed, or its errors."""
        lexer, parser = self._lexer, self._parser
        node, ending = parser.take_command(pace)
        lines, end_column = lexer.extent
        text, base = lexer.take_text(), lexer.base
        warned = bool(parser.problems)
        self._tell(items, text, base, pace)
        if self._broken:
            self._pieces.clear()
        elif node is not None or self._pieces:
            separator = "" if ending.kind == "END" else ending.kind
            self._add(Statement(node or Empty(), separator, base, text), items)
            if node and self._cache is not None and separator and not warned and not lexer.synclines:
                self._cache.put(text, _Known(node, separator, lines, end_column))
        self._finish_statement()

    def _tell(self, items: list[Item], text: str, base: Position, pace: StepPace) -> None:
        """Return the errors and warnings of the current statement that were not returned yet."""
        problems = self._parser.problems
        for problem in problems:
            pace.step()
            message, told = problem.message, ""
            if self._looked_into < MOST_ADVISED:
                self._looked_into += 1
                if message.startswith(UNEXPECTED):
                    message += hint(text, problem.span, base)
                told = advice(problem.message, text, problem.span)
            place = Location.of(problem.span, base)
            items.append(SyntaxProblem(message, place, problem.warning, told, self._advised))
            self._advised = self._advised or bool(told)
            self._broken = self._broken or not problem.warning
        problems.clear()

    def _cut_piece(self, cache: StatementCache, items: list[Item], pace: StepPace) -> bool | None:
        """Take one piece of a long chain; False if none begins here, None if that depends on what comes."""
        lexer = self._lexer
        buffer, at = lexer.unread_input
        if not self._pieces:
            joint = buffer.find("|", at)
            if joint < 0 or buffer.startswith(";", joint + 1):  # the end of most statements of programs
                return False
        match = PIECE.match(buffer, at) if self._pieces or is_long(buffer, at) else None
        if match is None:
            return None if not lexer.closed and may_go_on(buffer, at) else False
        text = match[1] + ";"
        known = cache.get(text) or self._parsed_piece(cache, text)
        if known is None:
            return False
        pace.step()
        self._pieces.append(Statement(known.node, known.separator, lexer.base, text))
        self._tokens += TOKENS_OF_A_PIECE
        lexer.skip(match.end() - at, 0, 0)
        if too_much := self._too_much(self._tokens):
            self._refuse(too_much, items)
        return True

    def _parsed_piece(self, cache: StatementCache, text: str) -> _Known | None:
        """The cache entry of a piece that is not cached; None if it is no statement of its own."""
        items = parse_program(text)
        if len(items) != 1 or not isinstance(items[0], Statement):
            return None
        known = _Known(items[0].node, ";", 0, len(text) + 1)
        cache.put(text, known)
        return known

    def _add(self, statement: Statement, items: list[Item]) -> None:
        """Return a statement, which may be the rest of a long chain: ``|`` binds weakest in it, weaker than ``&``."""
        pieces, self._pieces = self._pieces, []
        if pieces:
            self.total += self._tokens
            self._tokens = 0
            base = pieces[0].base
            pieces.append(statement)
            statement = Statement(LongChain(pieces), statement.separator, base, "")
        items.append(statement)

    def _find_known(self, cache: StatementCache, items: list[Item]) -> bool:
        """Return the statement that begins here if it is cached."""
        buffer, at = self._lexer.unread_input
        limit = at + cache.longest
        tried = at
        for _ in range(_MAX_LOOKUPS):
            separator = _SEPARATOR.search(buffer, tried, limit)
            if separator is None:
                return False
            tried = separator.end()
            if self._hand_out(cache, buffer[at:tried], items):
                return True
        # Often a packet is one statement, with any number of separators in it.
        return len(buffer) <= limit and self._hand_out(cache, buffer[at:].rstrip(), items)

    def _hand_out(self, cache: StatementCache, text: str, items: list[Item]) -> bool:
        known = cache.get(text)
        if known is None:
            return False
        self._add(Statement(known.node, known.separator, self._lexer.base, text), items)
        self._lexer.skip(len(text), known.lines, known.end_column)
        return True


def parse_program(text: str, file: str | None = None) -> list[Item]:
    """Parse a whole program, one character per byte.  Run it only if there is no error among the items."""
    reader = StatementReader(file)
    return reader.feed(text.encode("latin-1")) + reader.finish()
