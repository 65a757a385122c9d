"""The reader: packets, positions, synclines, remembered statements, sizes, and bytes at random."""

from __future__ import annotations

import random
from pathlib import Path
from typing import SupportsIndex

import pytest
from syntax_reading import EXAMPLES, in_pieces, told, typed

from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax import reader as reader_module
from urbihw.kernel.syntax.lexer import Lexer
from urbihw.kernel.syntax.location import Position, Span
from urbihw.kernel.syntax.reader import (
    MOST_ADVISED,
    Item,
    Statement,
    StatementCache,
    StatementReader,
    SyntaxProblem,
    parse_program,
)
from urbihw.kernel.syntax.source import SourceText
from urbihw.kernel.syntax.tokens import KEYWORDS, SIGNS

STREAMS = [
    b'"\\B(3)(a"b)";\r\n1;\n\r2;\r3;\r\r\n4;',
    b'//#push 5 "y.u"\nfoo;\n//#pop\r\nfoo 1; //#line 9 "z.u"\n"a;b";',
    b"BIN 10;0123456789\nBIN 3 jpeg;abc; x = BIN 2\nk;a;;5; BIN; BINARY 3; BIN + 1;",
    b'"a\r\nb\\q\x41\\1012" "x\\B(2)(abc)" 1; 2 /* a /* b \r\n*/ c */ 3;/**/4;',
    b"1e+5;1e-15 + 1;1e+;1.5;1.;1=~=2;1=~2;not 1; a not in b; // c\r3;\n4; a.b->c; a<-b; a<<=b; 0x1F;1s 2min;",
    b"'a\\'b';'\\n' 1; \x00\xff\x80; 1 # 2;\xef\xbb\xbf8;",
    b"if (1 2;3;4; [1;2];3; {{1 2;3};4};5; while (1 {2;3}; 4;",
    "\n".join(EXAMPLES).encode(),
]


@pytest.mark.parametrize("data", STREAMS)
@pytest.mark.parametrize("size", [1, 2, 3, 7])
def test_packets_do_not_matter(data: bytes, size: int) -> None:
    assert in_pieces(data, size) == in_pieces(data, len(data))


@pytest.mark.parametrize("data", STREAMS)
def test_remembering_does_not_matter(data: bytes) -> None:
    cache = StatementCache()
    for size in (1, 5, len(data)):
        assert in_pieces(data, size, cache) == in_pieces(data, len(data))


class Watched(str):
    """A text that measures the copies made of its parts."""

    longest = 0

    def __getitem__(self, key: SupportsIndex | slice) -> str:
        part = super().__getitem__(key)
        Watched.longest = max(Watched.longest, len(part))
        return part


def test_the_rest_of_the_input_is_not_copied_for_each_invalid_character() -> None:
    lexer = Lexer([])
    lexer.feed("\x80" * 1000 + "\xe2")
    lexer._buffer = Watched(lexer._buffer)
    assert lexer.begin() and lexer.next() is None
    assert Watched.longest == 1
    assert lexer.unread_input[0][lexer.unread_input[1] :] == "\xe2"  # may become a typographic quote


def bases(items: list[Item]) -> list[str]:
    return [str(item.base) for item in items if isinstance(item, Statement)]


def test_a_statement_comes_as_soon_as_its_separator() -> None:
    reader = StatementReader()
    assert reader.feed(b"1") == []
    assert told(reader.feed(b";2")) == ["1;"]
    assert told(reader.feed(b",{3;")) == ["2,"]
    assert told(reader.feed(b"}")) == []
    assert told(reader.feed(b"; garbage (")) == ["{3;};"]


def test_empty_statements_are_nothing() -> None:
    assert typed(";;; , ;/* a */; // b\n;") == []
    assert typed("1,;21;") == ["1,", "21;"]


def test_the_separator_is_told() -> None:
    items = parse_program("1; 2, 3")
    assert [item.separator for item in items if isinstance(item, Statement)] == [";", ",", ""]


def test_positions_count_from_the_start_of_the_connection() -> None:
    # As recorded: CR LF, LF CR, CR and LF are one line each, a tab is one column.
    reader = StatementReader()
    typed_one_by_one = [
        b"foo_;\n",
        b"foo_;\r\n",
        b"foo_;\n\r",
        b"foo_;\r",
        b"\tfoo_;",
        b'"a\nb"; foo_;',
        b"/* \n\n */ foo_;foo_;",
    ]
    seen = [bases(reader.feed(data)) for data in typed_one_by_one]
    assert seen == [["1.1"], ["2.1"], ["3.1"], ["4.1"], ["5.2"], ["5.7", "6.5"], ["8.5", "8.10"]]


def test_a_raw_cr_lf_in_a_string_is_two_lines() -> None:
    assert bases(StatementReader().feed(b'"a\r\nb"; 1;')) == ["1.1", "3.5"]


def test_a_blob_counts_no_lines() -> None:
    assert bases(StatementReader().feed(b'"\\B(2)(\n\n)"; 1;')) == ["1.1", "1.14"]


def test_synclines() -> None:
    # As recorded on the original.
    reader = StatementReader()
    assert bases(reader.feed(b'1; //#line 100 "x.u"\nfoo_;')) == ["1.1", "x.u:100.1"]
    assert bases(reader.feed(b"foo_;\n")) == ["x.u:100.6"]
    assert bases(reader.feed(b'//#push 5 "y.u"\nfoo_;\n//#pop\nfoo_;\n')) == ["y.u:5.1", "x.u:101.1"]
    assert told(reader.feed(b"\xe9 foo_;")) == [r"error x.u:102.1: invalid character: `\xe9'"]


@pytest.mark.parametrize(
    "comment", ['//#line 3 "f" x', "//#line 3", '//#line x "f"', "//#pop", "//#line3", '// #line 3 "f"', '//#push 3 "f']
)
def test_what_is_not_quite_a_syncline_is_a_comment(comment: str) -> None:
    assert bases(StatementReader().feed(comment.encode() + b"\n1;")) == ["2.1"]


def test_a_syncline_inside_a_statement_moves_its_lines() -> None:
    (item,) = StatementReader("a.u").feed(b'1 +\n//#line 10 "a.u"\n2 3;')
    assert isinstance(item, SyntaxProblem)
    assert str(item.location) == "a.u:10.3"


def test_the_name_of_a_file_is_in_positions() -> None:
    assert told(parse_program("1;\n2 3", "dir/a.u")) == ["1;", "error dir/a.u:2.3: unexpected float"]


def test_a_known_statement_is_the_same_node() -> None:
    cache = StatementCache()
    first, second = StatementReader(cache=cache), StatementReader(cache=cache)
    (one,) = first.feed(b"{ a;\n  b };")
    (two,) = second.feed(b"\n  { a;\n  b };")
    assert isinstance(one, Statement) and isinstance(two, Statement)
    assert one.node is two.node
    assert (one.base, two.base) == (Position(1, 1), Position(2, 3))
    assert bases(second.feed(b" 1;")) == ["3.8"]


def test_a_known_beginning_is_not_enough() -> None:
    cache = StatementCache()
    assert told(StatementReader(cache=cache).feed(b"a, a;")) == ["a,", "a;"]
    assert told(StatementReader(cache=cache).feed(b"aa, [a, a]; f(a;1); a,"))[:2] == ["aa,", "[a, a];"]


def test_wrong_statements_and_synclines_are_not_remembered() -> None:
    cache = StatementCache()
    StatementReader(cache=cache).feed(b'1 2; # 3; new a; {\n//#line 9 "x"\n1};')
    assert len(cache) == 0


def test_the_cache_is_bounded() -> None:
    cache = StatementCache(size=3, longest=10)
    reader = StatementReader(cache=cache)
    for text in (b"1;", b"2;", b"3;", b"1;", b"4;", b"a_long_name_here;"):
        reader.feed(text)
    assert len(cache) == 3
    assert [cache.get(text) is not None for text in ("1;", "2;", "3;", "4;")] == [True, False, True, True]


def test_a_megabyte_in_small_packets() -> None:
    data = b'"' + b"a" * 1_000_000 + b'"; ' + b"b" * 20_000 + b"; /*" + b"c" * 20_000 + b"*/ 1;"
    string, word, one = in_pieces(data, 10)
    assert isinstance(string, Statement) and isinstance(string.node, ast.StringLiteral)
    assert len(string.node.value) == 1_000_000
    assert isinstance(word, Statement) and word.node == ast.Call(None, "b" * 20_000)
    assert isinstance(one, Statement) and one.text == "1;"


@pytest.mark.parametrize(
    ("text", "kind"),
    [
        ("(" * 2000 + "1" + ")" * 2000, ast.Float),
        ("{" * 2000 + "}" * 2000, ast.Scope),
        ("[" * 2000 + "]" * 2000, ast.ListLit),
        ("1" + "+1" * 8000, ast.Call),
        ("-" * 1 + " -" * 5000 + "1", ast.Call),
        ("f(" * 2000 + ")" * 2000, ast.Call),
        ("[" + "1, " * 100_001 + "]", ast.ListLit),
        ("if (1) " * 2000 + "{ var x }", ast.If),
        ("function () {" * 2000 + "return" + "}" * 2000, ast.Function),
        ("1" + "|1" * 20_000, ast.Pipe),
        ('"a"' * 20_000, ast.StringLiteral),
    ],
)
def test_size_and_depth_are_no_limit(text: str, kind: type[ast.Node]) -> None:
    (item,) = StatementReader().feed(text.encode() + b";")
    assert isinstance(item, Statement)
    assert isinstance(item.node, kind)


def test_deep_nesting_that_is_wrong_is_an_error() -> None:
    assert told(parse_program("(" * 5000 + ";")) == ["error 1.5001: unexpected ;"]
    assert typed("f(" * 5000 + ";") == ["error 1.10001: unexpected ;"]
    assert len(typed("#" * 5000 + ";")) == 5000


def test_a_cause_is_looked_for_in_a_few_of_many_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look reads the statement again: for all errors of a statement that took a minute."""
    looked: list[str] = []

    def advice(message: str, text: str, span: Span) -> str:
        looked.append(message)
        return ""

    monkeypatch.setattr(reader_module, "advice", advice)
    typed("#" * 1000 + ";")
    assert 0 < len(looked) < 20


@pytest.fixture
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """A statement may have few words, and few of them open."""
    monkeypatch.setattr(reader_module, "MAX_TOKENS", 12)
    monkeypatch.setattr(reader_module, "MAX_OPEN", 6)


LONG = "statement too long (more than 12 words and signs): make several of it"
DEEP = "statement too deeply nested"
REFUSED = {
    "1+1+1+1+1+1; 2;": ["1+1+1+1+1+1;", "2;"],
    "1+1+1+1+1+1+1; 2;": [f"error 1.1-13: {LONG}", "2;"],
    "1, 1+1+1+1+1+1+1, 2;": ["1,", f"error 1.4-16: {LONG}", "2;"],
    "[1, 2, 3, 4, 5, 6, 7, 8, 9]; 2;": [f"error 1.1-18: {LONG}", "2;"],
    '[1, 2, 3, 4, 5, 6, "7]; 8", /*]; 9*/ 0]; 2;': [f"error 1.1-18: {LONG}", "2;"],
    "[1, 2, 3, 4, 5, 6, {7; 8, 9; [10, 11]}, 12; 13]; 2;": [f"error 1.1-18: {LONG}", "2;"],
    "((((((((1)))))))); 2;": [f"error 1.1-6: {DEEP}", "2;"],
    "[[[[[[[[1; 2]; 3]]; 4, 5]]]]]; 2;": [f"error 1.1-6: {DEEP}", "2;"],
    "((((((((1)))))))))); 2;": [f"error 1.1-6: {DEEP}", "2;"],
}


@pytest.mark.parametrize("text", REFUSED)
@pytest.mark.parametrize("size", [1, 3, 100])
def test_what_is_too_long_is_refused_up_to_its_end(narrow: None, text: str, size: int) -> None:
    assert told(in_pieces(text.encode(), size)) == REFUSED[text]


def test_too_many_errors_are_one(narrow: None) -> None:
    (error,) = told(in_pieces(b"#" * 20 + b" 1 1;", 1))
    assert error.endswith(LONG)


def test_it_is_refused_before_its_end_has_come(narrow: None) -> None:
    reader = StatementReader()
    assert told(reader.feed(b"[1, 2, 3, 4, 5, 6, 7, ")) == [f"error 1.1-18: {LONG}"]
    assert reader.feed(b"8]") == []
    assert reader.finish() == []


WORDS = [*b";,{}()[]\"'\\+-=!?~|&:.\n\r \t\0\xff#/*", *range(48, 52)]
PIECES = [
    *(bytes([word]) for word in WORDS),
    *(word.encode() for word in sorted(KEYWORDS | SIGNS)),
    *(word.encode() + b" " for word in sorted(KEYWORDS)),
    b"x ",
    b"1s",
    b"0x",
    b"BIN 3 ;",
    b"\\B(2)(",
    b'//#push 3 "f"\n',
    b"//#pop\n",
]


def test_bytes_at_random_never_raise() -> None:
    dice = random.Random(2010)
    for _ in range(2000):
        data = b"".join(dice.choice(PIECES) for _ in range(dice.randrange(1, 25)))
        whole = in_pieces(data, len(data))
        assert in_pieces(data, dice.randrange(1, 4)) == whole, data
    for _ in range(300):
        data = dice.randbytes(60)
        assert in_pieces(data, 1) == in_pieces(data, 60), data


def test_no_file_of_the_grammar_is_read_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    StatementReader()
    monkeypatch.setattr(Path, "read_text", None)
    assert told(StatementReader().feed(b"1;")) == ["1;"]


def test_an_error_is_told_at_the_end_of_its_line_though_a_bracket_is_open() -> None:
    reader = StatementReader()
    assert reader.feed(b"echo((1 2;") == []
    (problem,) = reader.feed(b"\n")
    assert isinstance(problem, SyntaxProblem) and problem.message == "unexpected float"
    # What follows is skipped until the bracket is closed; it is told once.
    assert reader.feed(b"1;\n") == []
    assert reader.feed(b"); 2;\n")[1:] == []
    (statement,) = reader.feed(b"3;")
    assert isinstance(statement, Statement)


def test_behind_the_errors_that_are_advised_the_text_is_not_joined_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """The text of a statement may have 16 MB, and each line of it may have an error."""
    joined: list[SourceText] = []

    def text(source: SourceText) -> str:
        joined.append(source)
        return "int x"

    monkeypatch.setattr(SourceText, "text", property(text))
    reader = StatementReader()
    reader.feed(b"{\n")
    found = sum(len(reader.feed(b"int x\n")) for _ in range(100))
    assert found >= 100
    assert 1 <= len(joined) <= MOST_ADVISED
