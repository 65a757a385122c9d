"""The clock that a simulation leads."""

from __future__ import annotations

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import LedClock


def test_it_stands_until_it_is_led_and_never_goes_back() -> None:
    clock = LedClock()
    assert clock.is_led
    assert clock.now() == 0.0
    clock.lead(2.0)
    clock.lead(1.0)
    assert clock.now() == pytest.approx(2.0)


def test_what_is_due_at_a_step_is_due_although_fractions_are_not_exact() -> None:
    clock = LedClock()
    clock.lead(0.1 + 0.2 - 0.30000000000000004 + 0.3 - 1e-16)
    assert clock.now() >= 0.3


def test_it_goes_on_in_real_time_when_it_is_released(monkeypatch: pytest.MonkeyPatch) -> None:
    clock, now = LedClock(), [50.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    clock.lead(2.0)
    clock.release()
    now[0] = 53.0
    clock.release()
    assert clock.now() == pytest.approx(5.0)
    clock.lead(1.0)
    assert clock.is_led
    assert clock.now() == pytest.approx(5.0)


def test_jobs_wake_by_the_steps_of_the_clock() -> None:
    clock = LedClock()
    kernel = Kernel(clock)
    lobby = kernel.open_lobby()
    kernel.run()
    lobby.output.take_bytes()
    kernel.feed(lobby, b"sleep(100ms); 1;")
    kernel.run()
    for step in range(1, 6):
        assert lobby.output.take_bytes() == b""
        clock.lead(step * 0.02)
        kernel.run()
    assert lobby.output.take_bytes() == b"[00000100] 1\n"
