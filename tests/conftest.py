"""For all tests: those under ``e2e`` carry the mark of that name, so that ``pytest -m "not e2e"`` is the quick half."""

from __future__ import annotations

from pathlib import Path

import pytest

E2E = Path(__file__).parent / "e2e"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark by folder: a test cannot forget to say that it uses real time."""
    for item in items:
        if E2E in item.path.parents:
            item.add_marker("e2e")
