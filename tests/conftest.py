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
BELOW_E2E = f"{E2E}{os.sep}"
SHARED_OUT = ("tests/platforms/", "tests/e2e/", "tests/hostile/test_attacks.py")
"""Where tests of one file may run in several workers, unless its fixtures are made once for the file."""
ONE_OF = {
    "browser/test_panel_robots.py::test_a_base_drives_while_a_key_is_held": 3,
    "e2e/test_benches.py::test_a_bench_prints_its_last_row": 4,
    "e2e/test_control_e2e.py::test_direct_knows_every_platform": 3,
    "e2e/test_drive.py::test_keys_that_stop": 2,
    "e2e/test_drive.py::test_signals_that_stop": 2,
    "e2e/test_faults.py::test_the_body_stands_and_stays_so": 4,
    "e2e/test_nao_libqi.py::test_a_robot_that_goes_and_comes_back": 2,
    "e2e/test_nao_libqi.py::test_a_service_in_another_process_is_called_at_its_own_end_point": 2,
    "e2e/test_nao_libqi.py::test_it_walks_and_a_stop_ends_it": 2,
    "e2e/test_nao_pictures.py::test_urbi_image_saves_a_picture": 3,
    "e2e/test_sandbox.py::test_a_simulated_robot_is_served_in_the_sandbox": 3,
    "e2e/test_signals.py::test_an_end_during_the_start_is_clean": 4,
    "e2e/test_signals.py::test_two_signals_end_it_as_one_does": 4,
    "e2e/test_simulated_worlds.py::test_the_others_are_served_in_their_world": 2,
    "e2e/test_spykee_tools.py::test_a_tone_that_is_sent_is_what_the_loudspeaker_plays": 3,
    "e2e/test_webots_faults.py::test_a_wrong_model_is_one_line_and_a_right_one_is_taken": 3,
    "fakes/test_fake_nao_errors.py::test_odd_arguments_never_end_the_robot": 3,
    "hostile/test_attacks.py::test_an_attack_harms_nobody_else": 4,
    "kernel/compiler/test_pieces.py::test_no_piece_is_long": 3,
    "kernel/server/test_exit_watchdog.py::test_a_process_that_does_not_end_in_order_is_ended": 2,
    "kernel/test_long_builtins.py::test_others_are_answered_meanwhile": 3,
    "kernel/test_long_input.py::test_answers_do_not_depend_on_the_packets": 3,
    "kernel/test_long_input.py::test_neighbours_are_answered_meanwhile": 4,
    "kernel/test_robustness.py::test_deep_nesting_is_answered_or_refused": 3,
    "kernel/test_robustness.py::test_endless_recursion_ends_that_job_only": 3,
    "kernel/test_robustness.py::test_sane_nesting_is_answered": 3,
    "kernel/test_sabotage.py::test_no_built_in_slot_is_needed_by_the_others": 3,
    "platforms/test_bounded_by_body.py::test_a_joint_that_gets_its_force_back_begins_where_it_is": 2,
    "platforms/test_bounded_by_body.py::test_a_neighbour_who_holds_the_interpreter_does_not_make_a_trajectory_leap": 2,
    "platforms/test_chain_models.py::test_a_wheel_turns_both_ways_stops_and_is_a_joint_again": 2,
    "platforms/test_cia402_drive.py::test_a_drive_that_another_master_takes_away_brakes_and_stays_off": 3,
    "platforms/test_limit_rounding.py::test_what_is_applied_is_within_the_limit_by_less_than_two_counts": 3,
    "platforms/test_lost_links.py::test_a_trajectory_that_outlives_its_link_ends_with_an_error": 2,
    "platforms/test_lost_links.py::test_nothing_reads_as_fresh_while_the_link_is_lost": 2,
    "platforms/test_nao_call_limits.py::test_a_call_beyond_a_limit_is_refused_in_one_line": 3,
    "platforms/test_nao_camera.py::test_the_image_program_shows_the_same_room_in_each_format": 3,
    "platforms/test_other_masters.py::test_a_motion_of_another_master_is_stopped": 2,
    "platforms/test_owed.py::test_the_stop_needs_no_slot_of_the_library": 3,
    "platforms/test_release.py::test_what_began_before_the_release_moves_nothing_until_it_is_armed_again": 2,
    "platforms/test_servo_families.py::test_a_joint_goes_by_its_angle_and_holds": 2,
    "platforms/test_servo_families.py::test_a_wheel_turns_both_ways_and_a_stop_ends_it": 2,
    "platforms/test_stop_holds.py::test_a_joint_that_is_silent_while_it_is_stopped_holds_when_it_answers_again": 2,
    "platforms/test_teach.py::test_after_a_stop_or_a_loss_the_torque_stays_off": 3,
    "stdlib/test_hostile.py::test_no_call_brings_out_a_failure_of_ours": 3,
    "uremote/test_remote.py::test_values_go_there_and_back": 3,
}
"""Tests whose cases differ little and take long: `make test` plays one case of so many, `make long` the others."""
MOST_DESCRIPTORS = 400
"""Descriptors of a process that runs tests; `select` takes numbers up to 1023."""
if find_library("EGL"):
    # mujoco chooses how it renders when it is imported, by whatever test comes first.
    os.environ.setdefault("MUJOCO_GL", "egl")
GC_THRESHOLDS = 30_000, 5, 3
"""Python's own are 700, 10, 10.  A kernel has about 60000 objects, so a collection frees some ten of them.  Nothing is
frozen: the long work of a kernel thaws all (`urbihw/kernel/sched/collector.py`)."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark by folder: a test cannot forget to say that it uses real time.  Mark by ``ONE_OF`` which cases are long."""
    cases: Counter[str] = Counter()
    for item in items:
        if str(item.path).startswith(BELOW_E2E):
            item.add_marker("e2e")
        test, bracket, _ = item.nodeid.partition("[")
        fewer = ONE_OF.get(test.removeprefix("tests/"))
        if fewer is not None and bracket:
            if cases[test] % fewer:
                item.add_marker("long")
            cases[test] += 1


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out files without tests of the kind that `make check` asks for; each worker would import them all."""
    kind = config.getoption("markexpr")
    if collection_path.is_dir():
        return True if collection_path == E2E and kind.startswith("not e2e") else None
    if not kind.startswith("e2e") or E2E in collection_path.parents:
        return None
    return None if "mark.e2e" in collection_path.read_text("utf-8") else True


def collect_descriptors() -> None:
    """Let the collector close pipes and sockets of simulated robots, which are circles, before there are too many."""
    lowest_free = os.dup(0)
    os.close(lowest_free)
    if lowest_free > MOST_DESCRIPTORS:
        gc.collect()


@pytest.fixture(scope="module")
def few_objects() -> Iterator[None]:
    """For a file that collects often: what exists already is frozen.

    A worker has half a million objects, the tests among them, and each full collection would visit them: 0.4 s.
    """
    gc.freeze()
    yield
    gc.unfreeze()


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
