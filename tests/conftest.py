"""For all tests: those under ``e2e`` carry the mark of that name, so that ``pytest -m "not e2e"`` is the quick half.
Kernels are closed with the test that made them, since the collector cannot take back all of them by itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from urbihw.kernel import Kernel

E2E = Path(__file__).parent / "e2e"


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark by folder: a test cannot forget to say that it uses real time."""
    for item in items:
        if E2E in item.path.parents:
            item.add_marker("e2e")


class Closer:
    """Closes the kernels that a test or its own fixtures made; those of fixtures for many tests live on."""

    def __init__(self) -> None:
        self._made: list[Kernel] = []
        self._shared = False

    def watch(self) -> None:
        """Hear of every kernel from now on."""
        init = Kernel.__init__

        def remembered(kernel: Kernel, *args: Any, **options: Any) -> None:
            init(kernel, *args, **options)
            if not self._shared:
                self._made.append(kernel)

        Kernel.__init__ = remembered  # type: ignore[method-assign, assignment]

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[Any]) -> Iterator[None]:
        """A fixture is made."""
        before, self._shared = self._shared, fixturedef.scope != "function"
        try:
            return (yield)
        finally:
            self._shared = before

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self) -> Iterator[None]:
        """A test is over."""
        try:
            return (yield)
        finally:
            for kernel in self._made:
                kernel.close()
            self._made.clear()


def pytest_configure(config: pytest.Config) -> None:
    """Begin."""
    closer = Closer()
    closer.watch()
    config.pluginmanager.register(closer, "closer")
