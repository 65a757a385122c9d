"""The reader of a connection: bytes in, statements and syntax errors out.

A statement comes out as soon as its ``;`` or ``,`` has been read, however the bytes were cut into packets.  What is
wrong with a statement comes out when the statement is complete, and then the statement does not (server protocol,
section 2).  Texts read before are remembered with their nodes: a program that sends the same command again and again
is answered without lexing it.

A statement may be as long as ``MOST_TOKENS`` and its siblings say.  One that is longer is refused as soon as that is
known, and what follows of it is skipped up to its end: nothing of it runs, and nothing of it is kept.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

from urbihw.kernel.errors import TOO_DEEP
from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.hints import hint
from urbihw.kernel.syntax.lexer import Lexer
from urbihw.kernel.syntax.location import Location, Position
from urbihw.kernel.syntax.pace import Pace
from urbihw.kernel.syntax.parser import UNEXPECTED, Parser
from urbihw.kernel.syntax.tokens import Token

MOST_TOKENS = 250_000
"""How many words and signs a statement may have, each error counted as one.

As many take 100 to 300 MB to read and to compile, and 25 ms to be let go of.
"""
MOST_OPEN = 20_000
"""How much of a statement may be begun and not ended, in brackets and operators."""
MOST_BYTES = 64 * 1024 * 1024
"""How long a statement may be, with its strings, comments and binaries."""

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


@dataclass(frozen=True, slots=True)
class SyntaxProblem:
    """A syntax error, or a warning; the message has no ``syntax error:`` in front."""

    message: str
    location: Location
    warning: bool = False


Item = Statement | SyntaxProblem


class _Known(NamedTuple):
    """A statement read before, and where it ends: so many lines below its beginning, before that column."""

    node: Node
    separator: str
    lines: int
    end_column: int


class StatementCache:
    """The statements read lately, by text; several readers may share one.

    ``size`` is how many are kept, ``longest`` the greatest length of a text.  A text is found again only if a
    statement begins with it, up to one of its first separators, so nothing needs to be read ahead.
    """

    def __init__(self, size: int = 2048, longest: int = 1000) -> None:
        self.size = size
        self.longest = longest
        self._known: dict[str, _Known] = {}

    def get(self, text: str) -> _Known | None:
        """What is known of a text; it then counts as the latest."""
        known = self._known.pop(text, None)
        if known is not None:
            self._known[text] = known
        return known

    def put(self, text: str, known: _Known) -> None:
        """Remember a statement, in place of the one not seen for the longest time."""
        if len(text) > self.longest:
            return
        if len(self._known) >= self.size:
            del self._known[next(iter(self._known))]
        self._known[text] = known

    def __len__(self) -> int:
        return len(self._known)


# A remembered statement is looked for at this many separators.
_TRIES = 4
_SEPARATOR = re.compile("[;,]")


class Reader:
    """Reads one stream; ``file`` is its name in positions, None for a connection."""

    def __init__(self, file: str | None = None, cache: StatementCache | None = None) -> None:
        self._cache = cache
        self._parser = Parser()
        self._lexer = Lexer(self._parser.problems, file)
        self.total = 0
        """How many words and signs have been read in all, but for those of remembered statements."""
        self._tokens = 0
        self._bytes = 0
        # Inside a statement that was refused: how many of its brackets are open; else None.
        self._open: int | None = None

    @property
    def pending(self) -> int:
        """How many bytes have come of a statement that is not whole yet."""
        return self._bytes

    def feed(self, data: bytes, pace: Pace | None = None) -> list[Item]:
        """The statements and errors that these bytes complete.

        Each word or sign is a step, and so is each node of a statement that is whole.  If a pause raises, the reader is
        of no use any more.
        """
        self._bytes += len(data)
        self._lexer.feed(data.decode("latin-1"))
        items: list[Item] = []
        self._read(items, Pace() if pace is None else pace)
        return items

    def finish(self, pace: Pace | None = None) -> list[Item]:
        """No more bytes: a last statement without separator counts, an unfinished one is an error."""
        pace = Pace() if pace is None else pace
        self._lexer.close()
        items: list[Item] = []
        self._read(items, pace)
        lexer, parser = self._lexer, self._parser
        if self._open is not None or not lexer.begin() and not lexer.unfinished:
            return items
        end = lexer.end()
        parser.push(Token("END", "", end))
        if lexer.unfinished and not parser.problems:
            parser.problem("unexpected end of command", end)
        self._complete(items, pace)
        return items

    def _read(self, items: list[Item], pace: Pace) -> None:
        lexer, parser = self._lexer, self._parser
        while lexer.begin():
            if self._open is not None:
                if not self._skip(pace):
                    return
                continue
            if self._cache is not None and lexer.fresh and self._find(self._cache, items):
                continue
            tokens = self._tokens
            while (token := lexer.next()) is not None:
                self._tokens = tokens = tokens + 1
                pace.step()
                if parser.push(token) or token.kind == "BINARY" and self._end_binary():
                    self._complete(items, pace)
                    break
                if tokens >= MOST_OPEN and (too_much := self._too_much(tokens)):
                    self._refuse(too_much, items)
                    break
            else:
                too_much = self._too_much(tokens)
                if not too_much:
                    return
                self._refuse(too_much, items)
        if not lexer.inside:
            self._bytes = 0

    def _too_much(self, tokens: int) -> str:
        """What there is too much of in the present statement, in words; empty if it is fine."""
        if tokens + len(self._parser.problems) > MOST_TOKENS:
            return f"statement too long (more than {MOST_TOKENS} words and signs): make several of it"
        if self._parser.depth > MOST_OPEN:
            return TOO_DEEP
        if self._bytes > MOST_BYTES:
            return f"statement too long (more than {MOST_BYTES} bytes): make several of it"
        return ""

    def _refuse(self, message: str, items: list[Item]) -> None:
        """Say that the present statement is too long, and skip the rest of it."""
        items.append(SyntaxProblem(message, Location(self._lexer.base, self._lexer.position)))
        self._open = self._parser.open_brackets()
        self._parser.give_up()
        self._lexer.forget()

    def _skip(self, pace: Pace) -> bool:
        """Go on skipping a statement that was refused; whether its end has come."""
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
        lexer.forget()
        self._parser.problems.clear()
        if token is None:
            self._open = opened
            return False
        self._open = None
        lexer.take()
        self._next()
        return True

    def _next(self) -> None:
        """A statement is over."""
        buffer, at = self._lexer.rest
        self.total += self._tokens
        self._tokens = 0
        self._bytes = len(buffer) - at

    def _end_binary(self) -> bool:
        """A binary of the old form ends its statement: its data may be followed by anything."""
        return self._parser.accepts(";") and self._parser.push(Token(";", ";", self._lexer.end()))

    def _complete(self, items: list[Item], pace: Pace) -> None:
        """Hand out the statement that the parser has complete, or what is wrong with it."""
        lexer, parser = self._lexer, self._parser
        node, ending = parser.take(pace)
        lines, end_column = lexer.extent
        text, base = lexer.take(), lexer.base
        broken = False
        for problem in parser.problems:
            pace.step()
            message = problem.message
            if message.startswith(UNEXPECTED):
                message += hint(text, problem.span, base)
            items.append(SyntaxProblem(message, Location.of(problem.span, base), problem.warning))
            broken = broken or not problem.warning
        if node is not None and not broken:
            separator = "" if ending.kind == "END" else ending.kind
            items.append(Statement(node, separator, base, text))
            if self._cache is not None and separator and not parser.problems and not lexer.synclines:
                self._cache.put(text, _Known(node, separator, lines, end_column))
        parser.problems.clear()
        self._next()

    def _find(self, cache: StatementCache, items: list[Item]) -> bool:
        """Hand out the statement that begins here if it is a known one."""
        buffer, at = self._lexer.rest
        limit = at + cache.longest
        tried = at
        for _ in range(_TRIES):
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
        items.append(Statement(known.node, known.separator, self._lexer.base, text))
        self._lexer.skip(len(text), known.lines, known.end_column)
        return True


def parse_program(text: str, file: str | None = None) -> list[Item]:
    """All of a program, one character per byte; it should only run if there is no error among the items."""
    reader = Reader(file)
    return reader.feed(text.encode("latin-1")) + reader.finish()
