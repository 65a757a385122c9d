"""What a syntax error adds: the keyword that was meant, and where a separator is missing."""

from __future__ import annotations

import pytest

from urbihw.kernel.syntax.hints import MAX_LENGTH
from urbihw.kernel.syntax.reader import SyntaxProblem, parse_program

MISSPELT = {
    "fucntion f() { 1 };": "fucntion: possible misspelling of function",
    "whille (true) { 1 };": "whille: possible misspelling of while",
    "if (true) 1 esle 2;": "esle: possible misspelling of else",
    "classe A { };": "classe: possible misspelling of class",
    "{ 1; retrun 3 };": "retrun: possible misspelling of return",
    "forr (var i : 3) { 1 };": "forr: possible misspelling of for",
    "evry (1s) { 1 },": "evry: possible misspelling of every",
    "vra z = 3;": "vra: possible misspelling of var",
    "tyr { 1 } catch { 2 };": "tyr: possible misspelling of try",
    "try { 1 } cath (var e) { 2 };": "cath: possible misspelling of catch",
    "swich (f(1)) { case 1: 2 };": "swich: possible misspelling of switch",
}

MISSING = {
    "var x = 1\nvar y = 2;": "missing ; at 1.10",
    "1;\n  f(1) // why\n\n  f(2);": "missing ; at 2.7",
    "{\n  echo(1)\n  echo(2)\n};": "missing ; at 2.10",
    "for (var i : [1]) {\n}\nif (true) {};": "missing ; at 2.2",
    "var l = [1,\n  2\n  3];": "missing , at 2.4",
    "f(1\n  x);": "missing , at 1.4",
}

SILENT = ["1 2;", "foo bar;", "foo { 1 };", "f(1 2);", "1 +;", "function f(a b) {};", "x ? 1\n : 2;"]


def complaints(text: str) -> list[str]:
    return [item.message for item in parse_program(text, None) if isinstance(item, SyntaxProblem)]


@pytest.mark.parametrize("text", MISSPELT)
def test_a_misspelt_keyword_is_named(text: str) -> None:
    (message,) = complaints(text)
    assert message.startswith("unexpected ") and message.endswith(f" ({MISSPELT[text]})")


@pytest.mark.parametrize("text", MISSING)
def test_a_missing_separator_is_pointed_at(text: str) -> None:
    (message,) = complaints(text)
    assert message.startswith("unexpected ") and message.endswith(f" ({MISSING[text]})")


@pytest.mark.parametrize("text", SILENT)
def test_what_is_not_known_is_not_guessed(text: str) -> None:
    assert complaints(text)
    assert not any("(" in message for message in complaints(text))


def test_the_name_of_the_file_is_said() -> None:
    (problem,) = (item for item in parse_program("f\ng;", "a.u") if isinstance(item, SyntaxProblem))
    assert problem.message == "unexpected identifier (missing ; at a.u:1.2)"


def test_long_statements_are_not_read_again() -> None:
    text = "[" + "1, " * MAX_LENGTH + "1\n1];"
    assert complaints(text) == ["unexpected float"]
