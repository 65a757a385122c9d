"""The table of tests of which `make test` plays some cases only."""

from __future__ import annotations

import ast
from pathlib import Path

from conftest import ONE_OF

TESTS = Path(__file__).parent


def test_every_row_names_a_test() -> None:
    """A row for a test that was renamed would do nothing, and the gate would get slower."""
    for row in ONE_OF:
        file, _, name = row.partition("::")
        functions = [node.name for node in ast.parse((TESTS / file).read_text("utf-8")).body
                     if isinstance(node, ast.FunctionDef)]
        assert functions.count(name) == 1, row
