"""The runner of the transcripts: those in ``meta`` must fail, each unit for the reason it names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from . import run
from .transcript import Player, compare, read

HERE = Path(__file__).parent
META = sorted((HERE / "meta").glob("*.chk"))


@pytest.mark.parametrize("path", META, ids=lambda path: path.stem)
def test_meta_transcripts_fail_for_the_reason_they_name(path: Path) -> None:
    outcomes = Player(effort=1.0).play(read(path))
    wanted = [re.findall(r"^//#because (.*)$", outcome.unit.text, re.MULTILINE) for outcome in outcomes]
    named = [(outcome, *reasons) for outcome, reasons in zip(outcomes, wanted, strict=True) if reasons]
    assert named
    for outcome, reason in named:
        assert reason in outcome.problem, outcome.unit.title


def test_what_is_typed_keeps_its_lines() -> None:
    (unit,) = read(Path("a.chk"), "//-- t\n1;\n[00000000] 1\n2;\n[00000000] 2\n").units
    assert (unit.title, unit.line) == ("t", 1)
    assert unit.typed == "//-- t\n1;\n\n2;\n\n"
    assert unit.expected == ("[00000000] 1", "[00000000] 2")


def test_units_know_where_they_begin() -> None:
    units = read(Path("a.chk"), "1;\n//-- t\n\n2;\n//-- u\n3;").units
    assert [(unit.title, unit.line) for unit in units] == [("(before the first title)", 1), ("t", 2), ("u", 5)]


def test_an_answer_goes_on() -> None:
    (unit,) = read(Path("a.chk"), "1;\n[00000000] a\n[:]b\n[00000000] c\\\n[:]d\n").units
    assert unit.expected == ("[00000000] a", "b", "[00000000] cd")


def test_an_answer_that_goes_on_from_nothing_is_a_mistake() -> None:
    with pytest.raises(ValueError, match=r"^line 2: \[:\]"):
        read(Path("a.chk"), "1;\n[:]b\n")


def test_a_list_is_typed_not_answered() -> None:
    (unit,) = read(Path("a.chk"), "[1, 2];\n[0];\n[00000000] [1, 2]\n").units
    assert unit.typed == "[1, 2];\n[0];\n\n"
    assert unit.expected == ("[00000000] [1, 2]",)


def test_headers() -> None:
    transcript = read(Path("a.chk"), "//#timed\n//#needs Regexp\n//#skip-if 1 == 2\n1;\n")
    assert (transcript.timed, transcript.needs, transcript.skip_if) == (True, ("Regexp",), ("1 == 2",))


@pytest.mark.parametrize(
    ("expected", "timed", "equal"),
    [("[00000000] a", False, True), ("[00000000] a", True, False), ("[00001234] a", False, True)],
)
def test_stamps_of_zero_are_compared_in_a_timed_file_only(expected: str, timed: bool, equal: bool) -> None:
    assert (compare((expected,), ("[00001234] a",), timed) == "") is equal


@pytest.mark.parametrize(
    ("header", "reason"),
    [("//#needs Nowhere", "needs Nowhere"), ("//#needs Object", ""), ("//#skip-if 1 < 2", "skipped if 1 < 2")],
)
def test_a_file_is_skipped_where_it_cannot_run(header: str, reason: str) -> None:
    assert Player().reason_to_skip(read(Path("a.chk"), f"{header}\n1;\n")) == reason


WRONG = """//#timed
//-- typed and answered in turns
1;
[00000000] 2
echo("b");

//-- nothing yet
sleep(1); nowhere;
//-- right
2;
[00001000] 2
"""

RIGHT = """//#timed
//-- typed and answered in turns
1;
echo("b");
[00000000] 1
[00000000] *** b

//-- nothing yet
sleep(1); nowhere;
[00001000:error] !!! 9.11-17: lookup failed: nowhere
//-- right
2;
[00001000] 2
"""


def test_the_command_writes_what_was_answered(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "a.chk"
    path.write_text(WRONG)
    assert run.main([str(path)]) == 1
    assert path.read_text() == WRONG
    shown = capsys.readouterr().out
    assert "-[00000000] 2\n" in shown and "+[00000000] 1\n" in shown
    assert run.main(["--write", str(path)]) == 1
    assert path.read_text() == RIGHT
    assert run.main([str(path)]) == 0
