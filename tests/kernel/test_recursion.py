"""Python's recursion limit is the same after whatever raised it for a while, however deep in calls that was.

It must not grow: programs that recurse without end would go deeper each time, and C code that depends on it uses up the
stack of the process.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from types import FrameType, SimpleNamespace

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.coro import Steps
from urbihw.kernel.server.bounds import Bounds
from urbihw.kernel.server.interrupt import Interrupter
from urbihw.kernel.server.watchdog import Watchdog


def at_each_depth(act: Callable[[], object]) -> int:
    """Act at the recursion limit, and at each depth above; how often that did not fail."""
    done, usual = 0, sys.getrecursionlimit()

    def descend(depth: int) -> None:
        nonlocal done
        try:
            descend(depth + 1)
        except RecursionError:
            pass
        if depth > usual - 200:
            try:
                act()
            except RecursionError:
                return
            done += 1

    descend(0)
    return done


@pytest.fixture
def kernel() -> Kernel:
    return Kernel(fast=True)


def test_a_signal_handler_leaves_the_limit_as_it_was(kernel: Kernel) -> None:
    usual = sys.getrecursionlimit()
    interrupter = Interrupter(kernel.scheduler, lambda: None)
    assert at_each_depth(lambda: interrupter(signal.SIGTERM)) > 10
    assert sys.getrecursionlimit() == usual


def test_the_watchdog_leaves_the_limit_as_it_was(kernel: Kernel) -> None:
    usual = sys.getrecursionlimit()
    watchdog = Watchdog(kernel.scheduler, Bounds())
    handler = signal.getsignal(signal.SIGURG)
    assert callable(handler)
    frame: FrameType = sys._getframe()
    try:
        assert at_each_depth(lambda: handler(signal.SIGURG, frame)) > 10
    finally:
        watchdog.close()
    assert sys.getrecursionlimit() == usual


def test_an_error_of_a_finalizer_at_the_limit_needs_no_room_to_be_kept_out_of_the_log(kernel: Kernel) -> None:
    def nothing(_given: object) -> None: ...

    watchdog = Watchdog(kernel.scheduler, Bounds())
    given = SimpleNamespace(exc_type=RecursionError, exc_value=RecursionError())
    try:
        hook = sys.unraisablehook
        assert at_each_depth(lambda: hook(given)) == at_each_depth(lambda: nothing(given))
    finally:
        watchdog.close()


def test_steps_leave_the_limit_as_it_was() -> None:
    usual = sys.getrecursionlimit()

    def work(pause: Callable[[], None]) -> None:
        sys.setrecursionlimit(usual + 100)
        while True:
            pause()

    steps = Steps(work)
    steps.step()
    assert at_each_depth(steps.step) > 10
    steps.end()
    assert sys.getrecursionlimit() == usual


def test_a_program_that_compiles_at_the_limit_leaves_it_as_it_was(kernel: Kernel) -> None:
    usual = sys.getrecursionlimit()
    lobby = kernel.open_lobby("127.0.0.1")
    text = """
      var done = 0|;
      function f() { try { f() } catch {} | if (done < 20) try { eval("1") | done += 1 } catch {} }|;
      f()|;
      done;
      """
    assert kernel.run_text(lobby, text).splitlines()[-1].endswith("] 20")
    assert sys.getrecursionlimit() == usual
