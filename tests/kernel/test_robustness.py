"""What a program can do to a server, and what it cannot: all in one process, on the simulated clock."""

from __future__ import annotations

import logging

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby


class Talk:
    """One connection of a kernel; ``other`` is a neighbour that must never notice."""

    def __init__(self) -> None:
        self.kernel = Kernel(fast=True)
        self.lobby = self.open()
        self.other = self.open()

    def open(self) -> Lobby:
        """One more connection."""
        return self.kernel.open_lobby("127.0.0.1")

    def say(self, text: str | bytes, until: float | None = None, *, lobby: Lobby | None = None) -> list[str]:
        """Send something, let time pass until nothing is left to do; the lines that come back, without time stamps."""
        lobby = self.lobby if lobby is None else lobby
        lobby.feed(text.encode("latin-1") if isinstance(text, str) else text)
        self.kernel.scheduler.run_simulated(until)
        return self.heard(lobby)

    def heard(self, lobby: Lobby) -> list[str]:
        """What a connection was told since the last look, without time stamps."""
        lines = lobby.output.take().decode("latin-1").splitlines()
        return [line[:1] + line[9:] if line[9:10] in ":]" and line[:1] == "[" else line for line in lines]


@pytest.fixture
def talk(caplog: pytest.LogCaptureFixture) -> Talk:
    caplog.set_level(logging.WARNING)
    return Talk()


def check(talk: Talk, caplog: pytest.LogCaptureFixture) -> None:
    """The connection and its neighbour answer, and nothing was our fault."""
    assert talk.say("\n;40 + 2;") == ["[] 42"]
    assert talk.say("6 * 7;", lobby=talk.other) == ["[] 42"]
    assert [record.getMessage() for record in caplog.records if "bug" in record.getMessage()] == []


# ---------------------------------------------------------------- statements that nest deep

NESTED = {
    "parentheses": ("(", "1", ")"),
    "list": ("[", "1", "]"),
    "braces": ("{", "1", "}"),
    "sum": ("1 + ", "1", ""),
    "power": ("1 ** ", "1", ""),
    "not": ("!", "true", ""),
    "minus": ("- ", "1", ""),
    "calls": ("f(", "1", ")"),
    "messages": ("", "Object", ".clone"),
    "subscripts": ("", "x", "[0]"),
    "assignments": ("x = ", "1", ""),
    "dictionary": ('["a" => ', "1", "]"),
    "functions": ("function () {", "1", "}"),
    "tags": ("t: ", "1", ""),
    "ifs": ("if (true) ", "1", ""),
    "elses": ("if (false) 0 else ", "1", ""),
    "loops": ("for| (1) ", "1", ""),
    "whiles": ("while (true) {", "break", "; break}"),
    "tries": ("try {", "1", "} catch { 2 }"),
    "catches": ("try { throw 1 } catch {", "1", "}"),
    "finallies": ("try { 1 } finally {", "1", "}"),
    "ats": ("at (false) ", "1", ""),
    "branches": ("1 & ", "1", ""),
}


@pytest.mark.parametrize("kind", NESTED)
@pytest.mark.parametrize("depth", [5, 100, 4000])
def test_deep_nesting_is_answered_or_refused(
    talk: Talk, caplog: pytest.LogCaptureFixture, kind: str, depth: int
) -> None:
    before, inside, after = NESTED[kind]
    answer = talk.say("var x = [1]|;\n" + before * depth + inside + after * depth + ";", until=1.0)
    if answer and "too deeply nested" in answer[0]:
        assert depth > 9
        assert len(answer) == 1
        assert answer[0].startswith("[:error] !!! 2.1-")
        assert answer[0].endswith(": syntax error: statement too deeply nested")
    else:
        assert depth < 4000 or kind in ("parentheses", "branches")
        assert "error" not in "".join(answer) or kind in ("calls", "subscripts")
    check(talk, caplog)


@pytest.mark.parametrize("kind, depth", [("parentheses", 2000), ("list", 500), ("sum", 800), ("braces", 500)])
def test_sane_nesting_is_answered(talk: Talk, kind: str, depth: int) -> None:
    before, inside, after = NESTED[kind]
    (answer,) = talk.say(before * depth + inside + after * depth + ";")
    expected = {"list": "[" * depth + "1" + "]" * depth, "sum": str(depth + 1)}
    assert answer == "[] " + expected.get(kind, "1")


def test_deep_nesting_in_a_file_or_eval_is_an_exception(talk: Talk) -> None:
    assert talk.say('try { eval("[" * 2000 + "]" * 2000) } catch (var e) { e.message };') == [
        '[] "statement too deeply nested"'
    ]


def test_a_long_statement_of_many_lines_is_fine(talk: Talk) -> None:
    assert talk.say("[" + ",\n".join(["1"] * 3000) + "].size;") == ["[] 3000"]
