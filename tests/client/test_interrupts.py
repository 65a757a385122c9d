"""Ctrl-C at each step of a command: the next command is answered all the same."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from lan_server import Lan

import urbihw
from urbihw.client.interrupts import Deferral
from urbihw.client.robot import Robot

pytestmark = pytest.mark.e2e
STEPS = range(1, 400, 3)


@pytest.fixture(autouse=True)
def ctrl_c() -> Iterator[None]:
    """Python's own handler, also where the tests run in the background, which ignores SIGINT."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    lan = Lan(tmp_path)
    with urbihw.connect("127.0.0.1", lan.plain_port, timeout=5) as made:
        made.run("var Global.motor6 = Object.clone|; var motor6.val = 0|; function Global.idem(x) { x }|;")
        yield made
    lan.close()


def interrupt_at(step: int, call: Callable[[], object]) -> bool:
    """Call, with Ctrl-C at a step of the client library; whether it was interrupted."""
    steps = 0

    def trace(frame: FrameType, event: str, argument: object) -> Any:
        nonlocal steps
        if "/urbihw/client/" not in frame.f_code.co_filename or frame.f_code.co_filename.endswith("interrupts.py"):
            return None
        frame.f_trace_opcodes = True
        if event == "opcode":
            steps += 1
            if steps == 5 * step:
                signal.raise_signal(signal.SIGINT)
        return trace

    sys.settrace(trace)
    try:
        call()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(None)
    return False


def test_the_next_command_after_ctrl_c_is_answered(robot: Robot) -> None:
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    interrupted = 0
    for step in STEPS:
        interrupted += interrupt_at(step, lambda: robot.run("idem(1)"))
        assert robot.run(f"idem({step})") == step
    assert interrupted > len(STEPS) / 2
    assert robot._connection.core.connects == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_the_next_sample_after_ctrl_c_comes(robot: Robot) -> None:
    with robot.watch("motor6.val", hz=200) as samples:
        for step in STEPS:
            interrupt_at(step, lambda: next(samples))
            next(samples)


def test_ctrl_c_ends_waiting(robot: Robot) -> None:
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        robot.run("sleep(20s)")
    timer.join()
    assert robot.run("idem(2)") == 2


def test_a_handler_of_the_program_is_put_back_and_one_that_it_sets_stays() -> None:
    heard: list[str] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: heard.append("first"))
    try:
        deferral = Deferral()
        with deferral:
            signal.raise_signal(signal.SIGINT)
            assert not heard
            with deferral, deferral.waiting:
                assert heard == ["first"]
                signal.raise_signal(signal.SIGINT)
                assert heard == ["first"] * 2
            signal.raise_signal(signal.SIGINT)
        assert heard == ["first"] * 3
        with deferral:
            signal.signal(signal.SIGINT, lambda number, frame: heard.append("second"))
        signal.raise_signal(signal.SIGINT)
        assert heard[-1] == "second"
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        with deferral:
            signal.raise_signal(signal.SIGINT)
        assert signal.getsignal(signal.SIGINT) == signal.SIG_IGN and len(heard) == 4
    finally:
        signal.signal(signal.SIGINT, before)
