"""The sabotages of ``tests/mutants`` fit the sources; `make mutants` plays them."""

from __future__ import annotations

from dataclasses import replace

from mutants import table


def test_every_sabotage_can_be_played() -> None:
    rows = table.load()
    assert [problem for row in rows for problem in table.problems(row)] == []
    assert len(rows) >= 100
    assert len({row.name for row in rows}) == len(rows)


def test_a_row_that_does_not_fit_is_told() -> None:
    row = table.load()[0]
    for wrong, why in (
        (replace(row, text="no such text"), "occurs 0 times"),
        (replace(row, text="\n"), "not once"),
        (replace(row, put=row.text), "nothing is changed"),
        (replace(row, put="def ("), "invalid syntax"),
        (replace(row, tests=("tests/test_mutants.py::test_of_nothing",)), "there is no test"),
        (replace(row, tests=()), "no tests"),
    ):
        assert any(why in problem for problem in table.problems(wrong)), why
