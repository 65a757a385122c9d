"""For all tests: those under ``e2e`` carry the mark of that name, so that ``pytest -m "not e2e"`` is the quick half.
Kernels are closed with the test that made them, since the collector cannot take back all of them by itself.  As there
are thousands of kernels, they share the compiled library, and the collector looks for them less often: that is a third
of the time of all tests.
"""

from __future__ import annotations

import gc
import os
from collections import Counter
from collections.abc import Iterator
from ctypes.util import find_library
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.compiler import library

E2E = Path(__file__).parent / "e2e"
SHARED_OUT = ("tests/platforms/", "tests/e2e/", "tests/hostile/test_attacks.py")
"""Where tests of one file may run in several workers, unless its fixtures are made once for the file."""
ONE_OF = {
    "e2e/test_drive.py::test_keys_that_stop": 2,
    "e2e/test_drive.py::test_signals_that_stop": 2,
    "e2e/test_faults.py::test_the_body_stands_and_stays_so": 2,
    "e2e/test_sandbox.py::test_a_simulated_robot_is_served_in_the_sandbox": 3,
    "e2e/test_simulated_worlds.py::test_the_others_are_served_in_their_world": 2,
    "e2e/test_webots_faults.py::test_a_wrong_model_is_one_line_and_a_right_one_is_taken": 3,
    "hostile/test_attacks.py::test_an_attack_harms_nobody_else": 2,
}
"""Tests with real processes whose cases differ little and take seconds each: `make test` plays one case of so many,
`make long` plays the others."""
MOST_DESCRIPTORS = 400
"""Descriptors of a process that runs tests; `select` takes numbers up to 1023."""
if find_library("EGL"):
    # mujoco chooses how it renders when it is imported, by whatever test comes first.
    os.environ.setdefault("MUJOCO_GL", "egl")
GC_THRESHOLDS = 30_000, 5, 5
"""Python's own are 700, 10, 10; a kernel has about 60000 objects."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark by folder: a test cannot forget to say that it uses real time.  Mark by ``ONE_OF`` which cases are long."""
    cases: Counter[str] = Counter()
    for item in items:
        if E2E in item.path.parents:
            item.add_marker("e2e")
        test, bracket, _ = item.nodeid.partition("[")
        fewer = ONE_OF.get(test.removeprefix("tests/"))
        if fewer is not None and bracket:
            if cases[test] % fewer:
                item.add_marker("long")
            cases[test] += 1


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """With ``-m 'e2e ...'``, leave out the files without such tests: each of several workers would import them all."""
    if not config.getoption("markexpr").startswith("e2e") or collection_path.is_dir() or E2E in collection_path.parents:
        return None
    return None if "mark.e2e" in collection_path.read_text("utf-8") else True


def collect_descriptors() -> None:
    """Let the collector close pipes and sockets of simulated robots, which are circles, before there are too many."""
    lowest_free = os.dup(0)
    os.close(lowest_free)
    if lowest_free > MOST_DESCRIPTORS:
        gc.collect()


def freeze_modules() -> None:
    """Spare the collector what lives as long as the process: modules, and all tests.

    To be called between two files, when there are no kernels.  Tests of long work thaw it.
    """
    if not gc.get_freeze_count():
        gc.collect()
        gc.freeze()


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
    def pytest_runtest_teardown(self, item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[None]:
        """A test is over."""
        try:
            return (yield)
        finally:
            for kernel in self._made:
                kernel.close()
            self._made.clear()
            collect_descriptors()
            if nextitem is not None and nextitem.path != item.path:
                freeze_modules()

    @pytest.hookimpl(trylast=True)
    def pytest_collection_finish(self) -> None:
        """All tests are known."""
        freeze_modules()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """A file stays with one worker, as some count what is left, but those of many long cases are shared out."""
    if config.getvalue("dist") != "loadfile":
        return None
    scheduling = import_module("xdist.scheduler").LoadFileScheduling(config, log)
    by_file = scheduling._split_scope
    scheduling._split_scope = lambda nodeid: nodeid if is_shared_out(nodeid.partition("::")[0]) else by_file(nodeid)
    return scheduling


@cache
def is_shared_out(file: str) -> bool:
    """Whether the tests of a file may run in several workers."""
    return file.startswith(SHARED_OUT) and 'scope="module"' not in (E2E.parents[1] / file).read_text("utf-8")


def share_library() -> None:
    """Read each part of the library from the disk only once."""
    load = library.load
    known: dict[str, list[library.Compiled]] = {}

    def remembered(key: str) -> list[library.Compiled] | None:
        if key not in known and (found := load(key)) is not None:
            known[key] = found
        return known.get(key)

    library.load = remembered


def pytest_configure(config: pytest.Config) -> None:
    """Begin."""
    gc.set_threshold(*GC_THRESHOLDS)
    share_library()
    closer = Closer()
    closer.watch()
    config.pluginmanager.register(closer, "closer")
