"""From the grammar to the tables that drive the parser, made by lark and kept on disk.

lark reads urbiscript.lark and computes the LALR(1) tables (half a second); this file copies them into plain rows and
rules and saves those as JSON in the user's cache folder (see ``cache_folder``), in a file named after a hash of the
grammar.  A later start reads that file and does not import lark at all.  A damaged file is replaced.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

from urbihw.frozen import frozen
from urbihw.kernel.syntax.cache_folder import read_cached, write_cached

# Increment this when the format of the saved tables changes.
FORMAT = 2

GRAMMAR = Path(__file__).with_name("urbiscript.lark")


@frozen(slots=False)
class GrammarRule:
    """A rule: ``origin`` consists of ``size`` symbols; ``action`` makes its value from the symbols at the indices
    ``kept``.

    Without an action the value is that of the only kept symbol.
    """

    origin: str
    size: int
    action: str | None
    kept: tuple[int, ...]


@frozen(slots=False)
class Tables:
    """``rows[state][symbol]`` is the next state if 0 or more, else ``~n`` to reduce by ``rules[n]``; 0 is the first.

    A symbol is a token kind, ``$END`` for the end of what the grammar covers, or the name of a rule after an ``@``
    (there is a rule ``case`` and a keyword ``case``).
    """

    rows: tuple[dict[str, int], ...]
    rules: tuple[GrammarRule, ...]
    passed: dict[tuple[int, int, str], int] = field(default_factory=dict, compare=False, repr=False)

    @cached_property
    def passing(self) -> list[str | None]:
        """By rule: the symbol to which it only passes on a value, from one level of precedence to the next; None for
        others."""
        return [rule.origin if rule.size == 1 and rule.action is None else None for rule in self.rules]

    @cached_property
    def final(self) -> frozenset[int]:
        """The states in which a statement is complete."""
        return frozenset(number for number, row in enumerate(self.rows) if "$END" in row)

    @cached_property
    def after_brace(self) -> frozenset[int]:
        """The states behind a closing brace."""
        return frozenset(row["}"] for row in self.rows if row.get("}", -1) >= 0)

    def pass_on(self, way: tuple[int, int, str]) -> int:
        """Compute, and cache in ``passed``, the state in which a symbol is not passed on any further.  ``way`` is the
        state below it, its own state, and the token that follows."""
        below, end, kind = way
        while (act := self.rows[end].get(kind, 0)) < 0 and (origin := self.passing[~act]) is not None:
            end = self.rows[below][origin]
        self.passed[way] = end
        return end


@lru_cache(maxsize=1)
def load_tables() -> Tables:
    """The tables of the grammar, from the cache if it has them."""
    grammar = GRAMMAR.read_text("utf-8")
    name = f"syntax-{FORMAT}-{hashlib.sha256(grammar.encode()).hexdigest()[:24]}.json"
    saved = read_cached(name)
    tables = None if saved is None else _unpack(saved)
    if tables is None:
        tables = build_tables(grammar)
        write_cached(name, _pack(tables))
    return tables


def _unpack(saved: bytes) -> Tables | None:
    try:
        data = json.loads(saved)
        rules = tuple(GrammarRule(origin, size, action, tuple(kept)) for origin, size, action, kept in data["rules"])
        return Tables(tuple(data["rows"]), rules)
    except (ValueError, KeyError, TypeError):
        return None


def _pack(tables: Tables) -> bytes:
    rules = [[rule.origin, rule.size, rule.action, rule.kept] for rule in tables.rules]
    return json.dumps({"rows": tables.rows, "rules": rules}, separators=(",", ":")).encode()


def build_tables(grammar: str) -> Tables:
    """Let lark compute the tables of a grammar."""
    from lark import Lark
    from lark.lexer import Lexer
    from lark.lexer import Token as LarkToken
    from lark.parsers.lalr_analysis import Shift

    class IncrementalLexer(Lexer):
        """Tells lark not to make a lexer: ours is incremental and feeds the tables itself."""

        def __init__(self, _conf: Any) -> None:
            pass

        def lex(self, _state: Any, _parser: Any) -> Iterator[LarkToken]:
            raise NotImplementedError

    lark = Lark(grammar, parser="lalr", lexer=IncrementalLexer, maybe_placeholders=False)
    table = lark.parse_interactive().parser_state.parse_conf.parse_table
    # lark has its own names for the literals of a grammar; here a keyword or sign is its own name.
    texts = {terminal.name: terminal.pattern.value for terminal in lark.terminals}
    start = table.start_states["start"]
    # lark numbers its states differently each time: number them in the order in which they can be reached.
    numbers = {start: 0}
    rules: dict[Any, int] = {}
    rows: list[dict[str, int]] = []
    for state in (reached := [start]):
        row: dict[str, int] = {}
        for name, (action, argument) in sorted(table.states[state].items()):
            # Token kinds are upper case in lark, names of rules lower case.
            symbol = texts.get(name, str(name)) if name.isupper() or name in texts else f"@{name}"
            if action is not Shift:
                row[symbol] = ~rules.setdefault(argument, len(rules))
                continue
            if argument not in numbers:
                numbers[argument] = len(numbers)
                reached.append(argument)
            row[symbol] = numbers[argument]
        rows.append(row)
    return Tables(tuple(rows), tuple(_rule(rule) for rule in rules))


def _rule(rule: Any) -> GrammarRule:
    """Convert a rule of lark; it keeps the symbols that lark's own trees would keep."""
    kept = tuple(place for place, symbol in enumerate(rule.expansion) if not getattr(symbol, "filter_out", False))
    passing = rule.options.expand1 and not rule.alias and len(kept) == 1
    origin = str(rule.origin.name)
    return GrammarRule(f"@{origin}", len(rule.expansion), None if passing else str(rule.alias or origin), kept)
