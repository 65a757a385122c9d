"""Syntax errors: wording, position, and what is skipped behind them.

Most of these were seen on the original server; the tables give what is typed on one connection and what it answers.
"""

from __future__ import annotations

import pytest
from syntax_reading import in_pieces, told, typed

from urbihw.kernel.syntax.reader import parse_program

WORDING = [
    ("1 + ;", "1.5: unexpected ;"),
    ("* 3;", "1.1: unexpected *"),
    ("1 + * 2;", "1.5: unexpected *"),
    ("1 2;", "1.3: unexpected float"),
    ('"a" 3;', "1.5: unexpected float"),
    ("1 2s;", "1.3-4: unexpected duration"),
    ("foo bar;", "1.5-7: unexpected identifier"),
    ('foo "a";', "1.5-7: unexpected string"),
    ("var if = 3;", "1.5-6: unexpected if"),
    ("var class = 1;", "1.5-9: unexpected class"),
    ("var x.return = 2;", "1.7-12: unexpected return"),
    ("else 3;", "1.1-4: unexpected else"),
    ("if (1) 2 ; else 3", "1.12-15: unexpected else"),
    ("catch (var e) { 1 };", "1.1-5: unexpected catch"),
    ("finally { 1 };", "1.1-7: unexpected finally"),
    ("case 3: 1;", "1.1-4: unexpected case"),
    ("++x;", "1.1-2: unexpected ++"),
    ("1 ? 2 : 3;", "1.3: unexpected ?"),
    ("var;", "1.4: unexpected ;"),
    ("var = 3;", "1.5: unexpected ="),
    ("var x = ;", "1.9: unexpected ;"),
    ("var a + 1;", "1.7: unexpected +"),
    ("switch (1) { 1: 2 };", "1.14: unexpected float, expecting case or default or }"),
    ("switch (1) { case: 2 };", "1.18: unexpected :"),
    ("switch 1 { };", "1.8: unexpected float, expecting ("),
    ("if;", "1.3: unexpected ;, expecting ("),
    ("1 <> 2;", "1.4: unexpected >"),
    ("1 =< 2;", "1.4: unexpected <"),
    ("1 => 2;", "1.3-4: unexpected =>"),
    ("a := 3;", "1.4: unexpected ="),
    ("1 === = 2;", "1.7: unexpected ="),
    ("*/;", "1.1: unexpected *"),
    ("1 */ 2;", "1.4: unexpected /"),
    ("(, 1);", '1.2: unexpected ","'),
    ("[1 : 2];", "1.4: unexpected :"),
    ('["a" => 1, 2];', "1.13: unexpected ]"),
    ("[=> 1];", "1.5: unexpected float, expecting ]"),
    ("function f(1) { };", "1.12: unexpected float, expecting ) or var or identifier"),
    ('function f(a, "b") { };', "1.15-17: unexpected string, expecting ) or var or identifier"),
    ("try { throw 1 };", "1.16: unexpected ;, expecting catch or finally"),
    ("1 + if (true) 2 else 3;", "1.5-6: unexpected if"),
    ("[for (2) 1];", "1.2-4: unexpected for"),
    ("f(while (true) 1);", "1.3-7: unexpected while"),
    ("1 < 2 < 3;", "1.7: unexpected <"),
    ("1 == 1 == 1;", "1.8-9: unexpected =="),
    ("1 not 2;", "1.7: unexpected float"),
    ("a &= b;", "1.3-4: unexpected &="),
    ("1.;", "1.3: unexpected ;"),
    (".5;", "1.1: unexpected ."),
    ('"text"(1);', "1.7: unexpected ("),
    ('getSlot("f")();', "1.13: unexpected ("),
    ("f(1)->x;", "1.5-6: unexpected ->"),
    ("f(1) += 2;", "1.6-7: unexpected +="),
    ("1++;", "1.2-3: unexpected ++"),
    ("a[0] = 1 time: 1s;", "1.10-13: unexpected identifier"),
    ("|;", "1.1: unexpected |"),
    ("];", "1.1: unexpected ]"),
    ("1 };", '1.3: unexpected }, expecting end of command or "," or ;'),
    ("1 ];", '1.3: unexpected ], expecting end of command or "," or ;'),
    ("external foo x;", "1.10-12: unexpected `foo', expecting `object'"),
    ("external foo (1) X.e from X;", "1.10-12: unexpected `foo', expecting `event'"),
    ("external var X.v of X;", "1.18-19: unexpected `of', expecting `from'"),
    ("external function (0) X.g;", "1.26: unexpected ;"),
]

TOKENS = [
    ("#;", ["error 1.1: invalid character: `#'"]),
    ("\\;", ["error 1.1: invalid character: `\\\\'"]),
    ("1\0;", ["error 1.2: invalid character: `'"]),
    ("\x7f7;", [r"error 1.1: invalid character: `\x7f'"]),
    (
        "\xff\xf4\xff\xfd\x063;",
        [rf"error 1.{n + 1}: invalid character: `\x{c:02x}'" for n, c in enumerate(b"\xff\xf4\xff\xfd\x06")],
    ),
    (
        "var \xc3\xa9 = 1;",
        [r"error 1.5: invalid character: `\xc3'", r"error 1.6: invalid character: `\xa9'", "error 1.8: unexpected ="],
    ),
    ("\x1b[A;6;", [r"error 1.1: invalid character: `\x1b'", "error 1.4: unexpected ;", "6;"]),
    ("var 3x = 1;", ["error 1.5-6: invalid token: `3x'", "error 1.8: unexpected ="]),
    ("3x;", ["error 1.1-2: invalid token: `3x'"]),
    ("12.3foo;", ["error 1.1-7: invalid token: `12.3foo'"]),
    ("0xabcdefg;", ["error 1.1-9: invalid token: `0xabcdefg'"]),
    ("0XFF;", ["error 1.1-4: invalid token: `0XFF'"]),
    ("0x;", ["error 1.1-2: invalid token: `0x'"]),
    ("1e;", ["error 1.1-2: invalid token: `1e'"]),
    ("2min30s;", ["error 1.1-7: invalid token: `2min30s'"]),
    ("int;", ["error 1.1-3: reserved symbol: `int'"]),
    ("delete;", ["error 1.1-6: reserved symbol: `delete'"]),
    (r'"\q";', [r"error 1.1-3: invalid character after \-escape: `q'"]),
    (r'"\xg1";', [r"error 1.1-3: invalid character after \-escape: `x'"]),
    (r'"\B(x)(a)";', [r"error 1.1-3: invalid character after \-escape: `B'"]),
    (r'"\B(2) (ab)";', [r"error 1.1-3: invalid character after \-escape: `B'"]),
    (r'"\B(2)(abc)";1;', [r"error 1.1-9: unexpected 'c' for closing \B, expected ')'", "1;"]),
    ("1 # 2; 3;", ["error 1.3: invalid character: `#'", "error 1.5: unexpected float", "3;"]),
]

# The table of the server protocol sheet, section 2, "Syntax errors: what is skipped".
SKIPPED = [
    ("{1;2 3;5};4;", ["error 1.6: unexpected float", "4;"]),
    ("{ ) ; 5};6;", ["error 1.3: unexpected )", "6;"]),
    ("(1 2;7;8);9;", ["error 1.4: unexpected float", "9;"]),
    ("(1;2);3;", ["error 1.3: unexpected ;", "3;"]),
    ("{{1 2;3};4};5;", ["error 1.5: unexpected float", "5;"]),
    ("1 2, 3; 4;", ["error 1.3: unexpected float", "3;", "4;"]),
    ("1 2| 3; 4;", ["error 1.3: unexpected float", "4;"]),
    ("if (1 2;3;4;", ["error 1.7: unexpected float", "3;", "4;"]),
    ("[1;2];3;", ["error 1.3: unexpected ;", 'error 1.5: unexpected ], expecting end of command or "," or ;', "3;"]),
    ("f(1;2);3;", ["error 1.4: unexpected ;", 'error 1.6: unexpected ), expecting end of command or "," or ;', "3;"]),
    (
        "while (1 {2;3}; 4;",
        ["error 1.10: unexpected {", 'error 1.14: unexpected }, expecting end of command or "," or ;', "4;"],
    ),
    ("1+;2;", ["error 1.3: unexpected ;", "2;"]),
    ("};5;", ["error 1.1: unexpected }", "5;"]),
    ("}}}};31;", ["error 1.1: unexpected }", "31;"]),
    ("]6;7;", ["error 1.1: unexpected ]", "7;"]),
    ("class { 8; }; 9;", ["error 1.13: unexpected ;", "9;"]),
    ("f(1,; 28;", ["error 1.5: unexpected ;", "28;"]),
    ("1||;25;", ["error 1.4: unexpected ;", "25;"]),
    ("1 +; 2; 3 */ 4; 5;", ["error 1.4: unexpected ;", "2;", "error 1.12: unexpected /", "5;"]),
    ("{ 1; 2 3; 4 };", ["error 1.8: unexpected float"]),
    ("function f() { 1 + ; 2 };", ["error 1.20: unexpected ;"]),
    ("{1} 2; 3;", ["error 1.5: unexpected float", "3;"]),
    ("{ {1} 2; 3 }; 4;", ["error 1.7: unexpected float", "4;"]),
    ("(1) 2; (3); 4;", ["error 1.5: unexpected float", "(3);", "4;"]),
    ("while (1) {2} 3; 4;", ["error 1.15: unexpected float", "4;"]),
    # Until three tokens are accepted again, further errors are not reported.
    ("{1 2} 3;", ["error 1.4: unexpected float"]),
    ("{1 2} + 1 + 3 4;", ["error 1.4: unexpected float", "error 1.15: unexpected float"]),
]

# Right for the grammar, wrong all the same.
OUT_OF_PLACE = [
    ("nil = 3;", ["1.1-3: `nil' is a constant, no variable"]),
    ("true = false;", ["1.1-4: `true' is a constant, no variable"]),
    ("void += 1;", ["1.1-4: `void' is a constant, no variable"]),
    ("false++;", ["1.1-5: `false' is a constant, no variable"]),
    ("this = 3;", ["1.1-4: `this' is the object itself, no variable"]),
    ("this--;", ["1.1-4: `this' is the object itself, no variable"]),
    ("break;", ["1.1-5: `break' not within a loop"]),
    ("continue;", ["1.1-8: `continue' not within a loop"]),
    ("{ break };", ["1.3-7: `break' not within a loop"]),
    ("if (true) break;", ["1.11-15: `break' not within a loop"]),
    ("function f() { break }|;", ["1.16-20: `break' not within a loop"]),
    ("loop { function () { break } };", ["1.22-26: `break' not within a loop"]),
    ("loop at (e?) break;", ["1.14-18: `break' not within a loop"]),
    ("while (break) {};", ["1.8-12: unexpected break"]),
    ("return;", ["1.1-6: return: outside a function"]),
    ("return 3;", ["1.1-8: return: outside a function"]),
    ("call;", ["1.1-4: call: used outside any function"]),
    ("call.message;", ["1.1-4: call: used outside any function"]),
    ("closure () { call };", ["1.14-17: call: used outside any function"]),
    ("throw;", ["1.1-5: throw: argumentless throw outside of a catch block"]),
    ("try { throw } catch { 1 };", ["1.7-11: throw: argumentless throw outside of a catch block"]),
    ("try {} catch { function () { throw } };", ["1.30-34: throw: argumentless throw outside of a catch block"]),
    (
        'try { throw 1 } catch { "all" } catch (1) { "one" };',
        ["1.33-51: catch: exception already caught by a previous clause"],
    ),
    ("{ var x = 1; var x = 2; x };", ["1.14-22: variable redefinition: x"]),
    ("{ var x | var y | var x };", ["1.19-23: variable redefinition: x"]),
    ("{ var f; function f() {} };", ["1.10-24: variable redefinition: f"]),
    ("function (a, var a) {};", ["1.14-18: variable redefinition: a"]),
    ("break; 1; continue, 2;", ["1.1-5: `break' not within a loop", "1.11-18: `continue' not within a loop"]),
]

IN_PLACE = [
    "while (1) { if (2) break; continue };",
    "for (var i : 3) try { break } finally { continue };",
    "every (1s) { break };",
    "loop switch (1) { case 2: break };",
    "function () { return };",
    "closure () { return 1 };",
    "function { closure () { call } };",
    "try {} catch { { throw } };",
    "try {} catch (1) {} catch {};",
    "var x = 1 | var x = 2;",
    "{ var x; { var x }; function () { var x } };",
    "{ if (var x = 1) x else var x; var x };",
    "{ for (var i = 0; i < 2; i++) var i = 3; var i };",
    "{ var this.x; var this.x };",
    "{ var o; do (o) { var x; var x }; class A { var x; var x } };",
    "function (a) { var a };",
    "{ switch (1) { case var x: 1; case var x: 2 }; var x };",
    "{ [var a] = [1]; [var a] = [2] };",
    "{ waituntil (e?(var x)); waituntil (e?(var x)) };",
]


@pytest.mark.parametrize(("text", "error"), WORDING)
def test_wording_and_position(text: str, error: str) -> None:
    assert typed(text)[-1] == f"error {error}" or told(parse_program(text))[-1] == f"error {error}"


@pytest.mark.parametrize(("text", "answers"), TOKENS)
def test_what_is_no_token(text: str, answers: list[str]) -> None:
    assert typed(text) == answers


@pytest.mark.parametrize(("text", "answers"), SKIPPED)
def test_what_is_skipped(text: str, answers: list[str]) -> None:
    assert typed(text) == answers


@pytest.mark.parametrize(("text", "errors"), OUT_OF_PLACE)
def test_words_out_of_place(text: str, errors: list[str]) -> None:
    assert [line for line in typed(text) if line.startswith("error")] == [f"error {error}" for error in errors]


@pytest.mark.parametrize("text", IN_PLACE)
def test_words_in_place(text: str) -> None:
    assert typed(text) == [text]


@pytest.mark.parametrize(("text", "answers"), TOKENS + SKIPPED)
def test_errors_do_not_depend_on_packets(text: str, answers: list[str]) -> None:
    assert told(in_pieces(text.encode("latin-1"), 1)) == answers


@pytest.mark.parametrize(
    ("text", "errors"),
    [
        ("1 +", ["error 1.4-3: unexpected end of command"]),
        ("{ 1;", ["error 1.5-4: unexpected end of command"]),
        ("f(1", ["error 1.4-3: unexpected end of command"]),
        ("{ 1 2", ["error 1.5: unexpected float"]),
        ('"abc', ["error 1.5-4: unexpected end of command"]),
        ('1 + "abc', ["error 1.9-8: unexpected end of command"]),
        (r'"abc\B(9)(x', ["error 1.12-11: unexpected end of command"]),
        ("/* abc", ["error 1.7-6: unexpected end of command"]),
        ("'abc", ["error 1.5-4: unexpected end of command"]),
        ('"\\', [r"error 1.1-2: invalid character after \-escape: `'"]),
        ("}", ["error 1.1: unexpected }"]),
    ],
)
def test_the_end_of_a_program(text: str, errors: list[str]) -> None:
    assert told(parse_program(text)) == errors


def test_new_of_the_first_urbiscript_is_a_warning() -> None:
    assert typed("new Object;") == ["warning 1.1-10: `new Obj(x)' is deprecated, use `Obj.new(x)'", "new Object;"]
