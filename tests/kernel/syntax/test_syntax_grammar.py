"""The grammar as a whole: its rules, its tables, their cache."""

from __future__ import annotations

from pathlib import Path

import pytest
from syntax_reading import EXAMPLES, typed

from urbihw.kernel.syntax import expressions, statements, tables
from urbihw.kernel.syntax.cache_folder import write_cached
from urbihw.kernel.syntax.lexer import Lexer
from urbihw.kernel.syntax.pace import StepPace
from urbihw.kernel.syntax.parser import Parser
from urbihw.kernel.syntax.tables import GRAMMAR, Tables, build_tables, load_tables
from urbihw.kernel.syntax.tokens import (
    ANGLES,
    CONTEXTUAL,
    CONTEXTUAL_INSIDE,
    DURATIONS,
    IGNORED,
    KEYWORDS,
    RESERVED,
    SIGNS,
    SYNONYMS,
)


class Watched(Parser):
    """A parser that remembers which rules it used."""

    def __init__(self) -> None:
        super().__init__()
        self.used: set[int] = set()

    def _reduce(self, act: int) -> None:
        self.used.add(~act)
        super()._reduce(act)


def test_every_rule_has_an_example() -> None:
    parser = Watched()
    for text in [*EXAMPLES, "1 2", "{1 2}", "(1 2)"]:
        lexer = Lexer(parser.problems)
        lexer.feed(text + ";;")
        while lexer.begin() and (token := lexer.next()) is not None:
            if parser.push(token):
                lexer.take_text()
                parser.take_command(StepPace())
        parser.problems.clear()
        parser = _renewed(parser)
    # Rules that only pass a symbol on from one level of precedence to the next are not counted.
    rules = load_tables().rules
    unused = {
        (rule.origin, rule.size, rule.action)
        for number, rule in enumerate(rules)
        if number not in parser.used and not (rule.size == 1 and rule.action is None)
    }
    assert unused == set()


def test_every_rule_has_a_function_and_every_function_a_rule() -> None:
    named = [name for part in (expressions, statements) for name in (*part.RULES.makers, *part.RULES.reporters)]
    assert sorted(named) == sorted({rule.action for rule in load_tables().rules if rule.action is not None})


def _renewed(parser: Watched) -> Watched:
    """Another parser, since the last statement may lack its end."""
    other = Watched()
    other.used = parser.used
    return other


@pytest.mark.parametrize("text", EXAMPLES)
def test_an_example_is_right(text: str) -> None:
    known_warning = ["new Obj(1);", "new a.b;"]
    assert [line for line in typed(text) if line.startswith("error")] == []
    assert len([line for line in typed(text) if line.startswith("warning")]) == (text in known_warning)


def test_what_the_grammar_names_is_what_the_lexer_makes() -> None:
    symbols = {symbol for row in load_tables().rows for symbol in row if not symbol.startswith(("@", "$"))}
    kinds = KEYWORDS | SIGNS | {"NAME", "FLOAT", "TIME", "STRING", "BINARY", "END"}
    assert symbols - kinds == {"ERROR"} | CONTEXTUAL | CONTEXTUAL_INSIDE
    # Signs that no construct uses are still read whole: `a &= b` is wrong at `&=`, not behind `&`.
    assert kinds - symbols == {"&=", "|="}


def test_the_tables_of_words_agree() -> None:
    assert set(SYNONYMS.values()) <= KEYWORDS | SIGNS
    groups = [KEYWORDS, frozenset(SYNONYMS), RESERVED, IGNORED]
    assert len(frozenset().union(*groups)) == sum(len(group) for group in groups)
    assert not DURATIONS.keys() & ANGLES.keys()


def in_directory(monkeypatch: pytest.MonkeyPatch, path: Path) -> Tables:
    """The tables as a fresh process with this cache directory has them."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(path))
    return load_tables.__wrapped__()


def test_tables_come_from_the_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    built = in_directory(monkeypatch, tmp_path)
    (file,) = (tmp_path / "urbihw").iterdir()

    def no_lark(_grammar: str) -> Tables:
        raise AssertionError("the cache was not used")

    monkeypatch.setattr(tables, "build_tables", no_lark)
    assert in_directory(monkeypatch, tmp_path) == built
    assert file.name.startswith("syntax-")


@pytest.mark.parametrize("damage", ["", "[]", '{"rows": [], "rules": [[1]]}', "\xff"])
def test_a_damaged_cache_is_made_anew(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, damage: str) -> None:
    built = load_tables()
    monkeypatch.setattr(tables, "build_tables", lambda _grammar: built)
    in_directory(monkeypatch, tmp_path)
    (file,) = (tmp_path / "urbihw").iterdir()
    whole = file.read_bytes()
    write_cached(file.name, damage.encode("latin-1"))  # with the right digest
    assert in_directory(monkeypatch, tmp_path) == built
    assert file.read_bytes() == whole


def test_a_cache_that_cannot_be_written_is_done_without(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    built = load_tables()
    monkeypatch.setattr(tables, "build_tables", lambda _grammar: built)
    (tmp_path / "file").write_text("")
    assert in_directory(monkeypatch, tmp_path / "file") == built


def test_the_same_grammar_gives_the_same_tables() -> None:
    grammar = GRAMMAR.read_text("utf-8")
    assert build_tables(grammar) == build_tables(grammar)
