"""The reader of a connection: bytes in, statements and syntax errors out.

A statement comes out as soon as its ``;`` or ``,`` has been read, however the bytes were cut into packets.  What is
wrong with a statement comes out when the statement is complete, and then the statement does not (server protocol,
section 2).  Texts read before are remembered with their nodes: a program that sends the same command again and again
is answered without lexing it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import NamedTuple

from urbihw.kernel.syntax.ast import Node
from urbihw.kernel.syntax.lexer import Lexer
from urbihw.kernel.syntax.location import Location, Position
from urbihw.kernel.syntax.parser import Parser
from urbihw.kernel.syntax.tokens import Token


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

    def feed(self, data: bytes) -> list[Item]:
        """The statements and errors that these bytes complete."""
        self._lexer.feed(data.decode("latin-1"))
        items: list[Item] = []
        self._read(items)
        return items

    def finish(self) -> list[Item]:
        """No more bytes: a last statement without separator counts, an unfinished one is an error."""
        self._lexer.close()
        items: list[Item] = []
        self._read(items)
        lexer, parser = self._lexer, self._parser
        if not lexer.begin() and not lexer.unfinished:
            return items
        end = lexer.end()
        parser.push(Token("END", "", end))
        if lexer.unfinished and not parser.problems:
            parser.problem("unexpected end of command", end)
        self._complete(items)
        return items

    def _read(self, items: list[Item]) -> None:
        lexer, parser = self._lexer, self._parser
        while lexer.begin():
            if self._cache is not None and lexer.fresh and self._find(self._cache, items):
                continue
            while (token := lexer.next()) is not None:
                if parser.push(token) or token.kind == "BINARY" and self._end_binary():
                    self._complete(items)
                    break
            else:
                return

    def _end_binary(self) -> bool:
        """A binary of the old form ends its statement: its data may be followed by anything."""
        return self._parser.accepts(";") and self._parser.push(Token(";", ";", self._lexer.end()))

    def _complete(self, items: list[Item]) -> None:
        """Hand out the statement that the parser has complete, or what is wrong with it."""
        lexer, parser = self._lexer, self._parser
        node, ending = parser.take()
        lines, end_column = lexer.extent
        text, base = lexer.take(), lexer.base
        broken = False
        for problem in parser.problems:
            items.append(SyntaxProblem(problem.message, Location.of(problem.span, base), problem.warning))
            broken = broken or not problem.warning
        if node is not None and not broken:
            separator = "" if ending.kind == "END" else ending.kind
            items.append(Statement(node, separator, base, text))
            if self._cache is not None and separator and not parser.problems and not lexer.synclines:
                self._cache.put(text, _Known(node, separator, lines, end_column))
        parser.problems.clear()

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
