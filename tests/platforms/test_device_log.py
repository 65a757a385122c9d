"""The log of a robot: many devices at once are one line, repetitions are counted."""

from __future__ import annotations

import logging
from collections.abc import Callable

import pytest
from bioloid_lab import Lab as Bioloid
from cia402_lab import Lab as Drives

from urbihw.platforms.devicelog import BACK, GATHER_S, LOST, MAX_ALIKE, MAX_SAME, DeviceLog, join_names
from urbihw.repeats import PERIOD

Lines = Callable[[], list[str]]


class Bench:
    """A log, and its time."""

    def __init__(self) -> None:
        self.time = 0.0
        self.lines: list[str] = []
        self._due: dict[int, tuple[float, Callable[[], None]]] = {}
        logger = logging.Logger("test")
        logger.addHandler(_Collector(self.lines))
        self.log = DeviceLog(logger, lambda: self.time, self._later)

    def _later(self, seconds: float, action: Callable[[], None]) -> Callable[[], None]:
        number = len(self._due)
        while number in self._due:
            number += 1
        self._due[number] = self.time + seconds, action
        return lambda: self._due.pop(number, None) and None

    def run(self, seconds: float) -> None:
        """Let time pass."""
        end = self.time + seconds
        while ripe := min(((due, number) for number, (due, _) in self._due.items() if due <= end), default=None):
            self.time, number = ripe
            self._due.pop(number)[1]()
        self.time = end

    @property
    def pending(self) -> int:
        """How many timers run."""
        return len(self._due)


class _Collector(logging.Handler):
    def __init__(self, lines: list[str]) -> None:
        super().__init__()
        self._lines = lines

    def emit(self, record: logging.LogRecord) -> None:
        self._lines.append(record.getMessage())


def test_one_device_is_told_as_it_always_was() -> None:
    bench = Bench()
    bench.log.log_event(LOST, "motor 6", "does not answer")
    assert bench.lines == []
    bench.run(GATHER_S)
    assert bench.lines == ["motor 6 is lost: does not answer"]
    bench.log.log_event(BACK, "motor 6")
    bench.run(1)
    assert bench.lines[1:] == ["motor 6 is back"]


def test_many_devices_are_one_line() -> None:
    bench = Bench()
    for number in (*range(1, 19), 100):
        bench.log.log_event(LOST, f"{'motor' if number < 100 else 'sensor'} {number}", "does not answer")
        bench.run(0.05)
    bench.run(1)
    assert bench.lines == ["19 devices are lost: motor 1-18, sensor 100 (does not answer)"]


def test_reasons_that_differ_are_not_told_for_one_of_them() -> None:
    bench = Bench()
    bench.log.log_event(LOST, "motor 1", "1 says {nothing}")
    bench.log.log_event(LOST, "motor 2", "2 says nothing")
    bench.run(1)
    bench.log.log_event(LOST, "motor 1", "1 says {nothing}")
    bench.run(1)
    assert bench.lines == ["2 devices are lost: motor 1-2", "motor 1 is lost: 1 says {nothing}"]


def test_a_row_without_end_is_told_all_the_same() -> None:
    bench = Bench()
    for number in range(40):
        bench.log.log_event(LOST, f"motor {number}", "x")
        bench.run(0.1)
    assert [line.partition(" ")[0] for line in bench.lines] == ["20", "20"]


def test_what_happened_last_is_told_last() -> None:
    bench = Bench()
    bench.log.log_event(LOST, "motor 1", "x")
    bench.log.log_event(BACK, "motor 1")
    bench.log.log_event(LOST, "motor 1", "y")
    bench.run(1)
    assert bench.lines == ["motor 1 is back", "motor 1 is lost: y"]


def test_a_flapping_device_gets_a_few_lines_and_a_number() -> None:
    bench = Bench()
    for _ in range(80):
        bench.log.log_event(LOST, "motor 6", "does not answer")
        bench.run(0.35)
        bench.log.log_event(BACK, "motor 6")
        bench.run(0.35)
    bench.run(2 * PERIOD)
    assert len(bench.lines) <= 2 * (MAX_SAME + 1)
    assert "motor 6 is lost: does not answer (77 times more)" in bench.lines
    assert bench.pending == 0
    bench.log.log_event(LOST, "motor 6", "does not answer")
    bench.run(1)
    assert bench.lines[-1] == "motor 6 is lost: does not answer"


def test_a_flapping_device_does_not_silence_another() -> None:
    bench = Bench()
    for _ in range(10):
        bench.log.warning("%s %d: %s", "motor", 6, "overheating")
    bench.log.warning("%s %d: %s", "motor", 7, "overheating")
    assert bench.lines == ["motor 6: overheating"] * MAX_SAME + ["motor 7: overheating"]


def test_lines_that_differ_in_a_value_are_counted_together() -> None:
    bench = Bench()
    for number in range(1000):
        bench.log.warning("motor 6: val not written: %d is too much", number)
    assert len(bench.lines) == MAX_ALIKE
    assert bench.pending <= MAX_ALIKE + 1
    bench.run(PERIOD)
    assert bench.lines[MAX_ALIKE:] == ["and 970 lines more of the kind: motor 6: val not written: %d is too much"]


def test_closing_tells_what_waits() -> None:
    bench = Bench()
    bench.log.log_event(LOST, "motor 6", "x")
    for _ in range(5):
        bench.log.info("again")
    bench.log.close()
    assert bench.lines == ["again"] * MAX_SAME + ["motor 6 is lost: x", "again (2 times more)"]
    assert bench.pending == 0


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["motor 6"], "motor 6"),
        (["motor 3", "motor 1", "motor 2", "sensor 100"], "motor 1-3, sensor 100"),
        (["1", "2", "9"], "1-2, 9"),
        (["base", "laser"], "base, laser"),
    ],
)
def test_names_in_short(names: list[str], words: str) -> None:
    assert join_names(names) == words


# ---------------------------------------------------------------- robots


def test_a_bus_without_power_is_one_line_and_so_is_its_return(caplog: pytest.LogCaptureFixture) -> None:
    lab = Bioloid.ready()
    caplog.set_level(logging.INFO)
    lab.kit.power_off(lab.bus_clock.now())
    lab.run(3)
    lab.kit.power_on(lab.bus_clock.now())
    lab.run(5)
    lost, back = (record.getMessage() for record in caplog.records)
    assert lost == "19 devices are lost: motor 1-18, sensor 100"
    assert back == "19 devices are back: motor 1-18, sensor 100"


def test_expected_devices_that_are_missing_are_one_line(caplog: pytest.LogCaptureFixture) -> None:
    lab = Bioloid.ready(ids=[1, 2, 30, 31, 32])
    lab.run(1)
    assert [record.getMessage() for record in caplog.records] == [
        "no answer from 3 devices, which join when they answer: 30-32"
    ]


def test_a_flapping_servo_does_not_fill_the_log(caplog: pytest.LogCaptureFixture) -> None:
    lab = Bioloid.small(6)
    caplog.set_level(logging.INFO)
    for _ in range(20):
        lab.kit.power_off(lab.bus_clock.now(), 6)
        lab.run(0.6)
        lab.kit.power_on(lab.bus_clock.now(), 6)
        lab.run(0.9)
    assert len(caplog.records) <= 2 * MAX_SAME
    lab.robot.close()
    assert any("is lost" in record.getMessage() and "times more)" in record.getMessage() for record in caplog.records)


def test_drives_without_power(caplog: pytest.LogCaptureFixture) -> None:
    lab = Drives.ready()
    lab.robot.log.log_event(LOST, "drive 5", "x")
    lab.robot.log.log_event(LOST, "drive 6", "x")
    lab.run(1)
    assert "2 devices are lost: drive 5-6 (x)" in caplog.text
