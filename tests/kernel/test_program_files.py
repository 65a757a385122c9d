"""Files that are loaded again: their code comes from the cache folder, and does what the text says all the same."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby import shell
from urbihw.kernel.lobby.program_files import MAX_STATEMENT_LENGTH, MIN_TEXT_LENGTH
from urbihw.kernel.sched.clock import SimClock

Play = Callable[..., list[str]]
PADDING = "// " + "x" * MIN_TEXT_LENGTH + "\n"


@pytest.fixture
def play(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Play:
    """Load a file in a fresh kernel that has run a text before: what the lobby said."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    file = tmp_path / "program.u"

    def load(text: str, before: str = "", name: str = "program.u") -> list[str]:
        file.write_text(PADDING + text)
        kernel = Kernel(SimClock())
        try:
            lobby = kernel.open_lobby()
            return (
                kernel.run_text(lobby, f'{before}\nload("{file.with_name(name)}");\n')
                .replace(str(tmp_path), "")
                .splitlines()
            )
        finally:
            kernel.close()

    return load


@pytest.fixture
def compiled(play: Play, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The statements of loaded files that are compiled from now on."""
    play("1;")  # the library is in the cache
    found: list[str] = []
    compile_statement = shell.Programs.compile_statement

    def compile_noted(programs: shell.Programs, statement: Any) -> Any:
        found.append(statement.text.strip())
        return compile_statement(programs, statement)

    monkeypatch.setattr(shell.Programs, "compile_statement", compile_noted)
    return found


PROGRAM = """var Global.a = [1, "two"];
function Global.f(x) { if (x < 1) x.foo else f(x - 1) };
class Global.C { var y = 3; function get() { y } };
echo("side"), echo(C.new.get);
{ var n = 0; for (var i : a) n += 1; a << n };
assert { a.size == 3 };
f(2);
"""


def loaded_statements(compiled: list[str]) -> list[str]:
    """Without what is typed."""
    return [text for text in compiled if not text.startswith(("load(", "var Global.change"))]


def test_a_file_is_compiled_once(play: Play, compiled: list[str]) -> None:
    first = play(PROGRAM)
    assert len(loaded_statements(compiled)) == 8
    assert any("program.u:8" in line for line in first), first
    compiled.clear()
    assert play(PROGRAM) == first
    assert loaded_statements(compiled) == []


def test_a_changed_file_is_compiled_anew(play: Play) -> None:
    play("echo(1);")
    assert "[00000000] *** 2" in play("echo(2);")


def test_statements_heed_what_was_done_before_them(play: Play, compiled: list[str]) -> None:
    text = "if (change) Float.'+' = function(other) { 42 } | {};\necho(1 + 1);\necho(3);\n"
    assert "[00000000] *** 2" in play(text, "var Global.change = false|;")
    assert "[00000000] *** 42" in play(text, "var Global.change = true|;")
    compiled.clear()
    assert "[00000000] *** 42" in play(text, "var Global.change = true|;")
    assert loaded_statements(compiled) == []
    assert "[00000000] *** 2" in play(text, "var Global.change = false|;")


def test_a_syntax_error_is_told_each_time(play: Play) -> None:
    first = play("echo(1);\necho(;\n")
    assert any("syntax error" in line for line in first) and not any("***" in line for line in first)
    assert play("echo(1);\necho(;\n") == first


def test_a_warning_is_told_each_time(play: Play) -> None:
    text = "echo(1);\nnew Object;\n"
    assert play(text) == play(text)


def test_long_functions_are_kept_in_their_pieces(play: Play, compiled: list[str]) -> None:
    text = "{ var n = 0; " + "".join(f"n += {number}; " for number in range(500)) + "echo(n) };\n"
    assert len(text) < MAX_STATEMENT_LENGTH
    assert "[00000000] *** 124750" in play(text)
    compiled.clear()
    assert "[00000000] *** 124750" in play(text)
    assert loaded_statements(compiled) == []


@pytest.mark.parametrize(
    "damage", [lambda whole: whole[: len(whole) // 2], lambda whole: b"", lambda whole: b"\xff" * 9]
)
def test_a_damaged_file_is_made_anew(
    play: Play, tmp_path: Path, compiled: list[str], damage: Callable[[bytes], bytes]
) -> None:
    folder = tmp_path / "cache" / "urbihw"
    before = set(folder.iterdir())
    play("echo(1);\necho(2);\n")
    (kept,) = set(folder.iterdir()) - before
    whole = kept.read_bytes()
    kept.write_bytes(damage(whole))
    assert "[00000000] *** 2" in play("echo(1);\necho(2);\n")
    assert kept.read_bytes() == whole
