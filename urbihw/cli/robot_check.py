"""The checks of ``urbihw doctor`` on the robot: what its bus does with its time, and what return delays cost.

A robot that a daemon serves is not asked: the daemon's bus worker shows its traffic, and its state.  Otherwise the port
is opened, and its servos are pinged and read; nothing is written.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from urbihw import platforms
from urbihw.buses import ports
from urbihw.buses.errors import BadFrame, BusTimeout, DeviceRefused
from urbihw.buses.pace import busy_words
from urbihw.buses.processor import crowd
from urbihw.buses.servos import trace, units
from urbihw.buses.servos.changes import check_alone, find_all
from urbihw.buses.servos.device import ServoScan
from urbihw.buses.servos.findings import findings as servo_findings
from urbihw.buses.servos.line import ServoLine
from urbihw.buses.servos.plan import read_blocks
from urbihw.buses.servos.registers import ServoError, ServoRegisters, bus_for
from urbihw.buses.servos.survey import SurveyedServo, read_live
from urbihw.buses.trace import Chunk
from urbihw.buses.turnaround import BusMeter
from urbihw.buses.verdict import ERROR_SHARE, Level, error_level, judge, number_in, rows_in, table_in
from urbihw.cli import control
from urbihw.cli.dialogue import Dialogue
from urbihw.cli.machine import ReportLine, Verdict
from urbihw.cli.tracing import WorkerTraffic
from urbihw.kernel.uobject import BadConfig
from urbihw.started import as_typed

WATCH_S: Final = 2.0
"""Seconds for which the traffic of a daemon is measured."""
ROUNDS: Final = 20
"""How often each servo is read."""
DELAY: Final = "return_delay_time"
_SLOW_S: Final = 200e-6
"""A turnaround above this is worth a line."""
_READ: Final = ("present_position", "present_temperature", "firmware_version")
_BITS: Final = 10
_VERDICTS: Final[Mapping[Level, Verdict]] = {Level.OK: "ok", Level.WARNING: "note", Level.BAD: "bad"}
_NORMAL: Final = f": up to {100 * ERROR_SHARE:g} % is normal"
_MANY: Final = 8
"""Ids that are named in a line at most."""


@dataclass
class BusReport:
    """What was measured.

    Attributes:
        findings: in words.
        numbers: for programs: bytes_a_cycle, busy, retries, damaged, silent (device -> count), turnaround (device -> s)
            and return_delay (id -> s).
        servos: those that were found, () behind a daemon.
    """

    findings: list[ReportLine] = field(default_factory=list)
    numbers: dict[str, Any] = field(default_factory=dict)
    servos: tuple[SurveyedServo, ...] = ()


def check_served(traffic: WorkerTraffic, seconds: float = WATCH_S) -> BusReport:
    """Measure the bus of a robot that a daemon serves.  Raises CliRefused."""
    report = BusReport([ReportLine("ok", f"a daemon serves {traffic.about.get('url')}: it is asked, not the robot")])
    told = _health_of(traffic.path)
    report.findings += (ReportLine(_VERDICTS[each.level], str(each)) for each in judge(told))
    if told.get("scheduling"):
        report.findings.append(ReportLine("ok", f"its bus worker runs {told['scheduling']}"))
    devices, speed = traffic.devices, traffic.baud or 1_000_000
    if not told.get("link"):
        return report
    name = traffic.path.stem.rpartition("-")[0]
    try:
        decoder = platforms.load_trace(platforms.find(name))(devices)
    except BadConfig:
        report.findings.append(
            ReportLine("note", f"which kind of robot {traffic.path.stem} is, is not known: its bus is not measured")
        )
        return report
    meter = BusMeter(decoder, _BITS / speed)
    items = list(traffic.chunks(time.monotonic() + seconds))
    meter.add_all((item for item in items if isinstance(item, Chunk)), is_cut_off=True)
    if not meter.seconds:
        report.findings.append(ReportLine("note", f"nothing was on the wire for {seconds:g} s: it is not measured"))
        return report
    lost = sum(item for item in items if isinstance(item, int))
    if lost:
        report.findings.append(ReportLine("note", f"{lost} pieces of the traffic were lost on the way here: its errors "
                                               "are not counted"))
    bus = table_in(told, "bus")
    rate = number_in(bus, "rate")
    report.numbers["retries"] = round(number_in(table_in(bus, "recent_errors"), "retried"))
    _describe(report, meter, meter.seconds * rate, f"at {rate:.0f} cycles a second, for {seconds:g} s")
    if not lost:
        report.findings += _error_findings(meter, meter.seconds * rate, _lost_devices(told))
    return report


def _lost_devices(told: Mapping[str, Any]) -> set[str]:
    """The devices that the worker counts as lost, and asks now and then."""
    return {str(row.get("device")) for row in rows_in(told, "devices") if row.get("state") == "lost"}


def check_line(line: ServoLine) -> BusReport:
    """Measure a bus of servos that no daemon serves: each servo is read several times.  Raises LinkGone."""
    report = BusReport()
    found, once = _look_twice(line)
    report.findings += _conflict_findings(found.conflicts)
    if once:
        shown = ", ".join(map(str, once))
        report.findings.append(
            ReportLine("note", f"servo {shown}: found in one of two searches only: check its cable and supply")
        )
    if not found.devices:
        report.findings.append(ReportLine("bad", f"{line.name}: no servo answers at {line.baud} bps: is it powered? "
                                              f"{as_typed('urbihw scan')} looks at all speeds"))
        return report
    report.servos = tuple(read_live(bus_for(line.link, device), device) for device in found.devices)
    chunks: list[Chunk] = []
    clock = line.link.clock
    line.link.observer = lambda direction, data: chunks.append(
        Chunk(clock.now(), ">" if direction == ">" else "<", data)
    )
    retries = 0
    try:
        for servo in report.servos:
            retries += _read_often(line, servo)
    finally:
        line.link.observer = None
    devices = [vars(servo.device) for servo in report.servos]
    meter = BusMeter(trace.dynamixel(devices), line.link.byte_time)
    meter.add_all(chunks)
    report.findings.append(ReportLine("ok", f"{line.name}: {len(report.servos)} servos at {line.baud} bps"))
    report.numbers["retries"] = retries
    _describe(report, meter, ROUNDS, "one servo after the other")
    report.findings += _error_findings(meter, ROUNDS, set(), retries)
    for servo in report.servos:
        for each in servo_findings(servo):
            if not each.cost:  # The return delay: told with its gain.
                report.findings.append(ReportLine("note", f"servo {servo.device.id}: {each.text}"))
    report.findings += _delay_findings(report)
    return report


def _look_twice(line: ServoLine) -> tuple[ServoScan, list[int]]:
    """Search twice; return all that was found, and the ids of devices that one of the searches has missed.

    Raises LinkGone.
    """
    first, second = find_all(line.link), find_all(line.link)
    conflicts = {*first.conflicts, *second.conflicts}
    both = ({device.id: device for device in each.devices if device.id not in conflicts} for each in (first, second))
    before, after = both
    found = before | after
    once = sorted(before.keys() ^ after.keys())
    return ServoScan(tuple(found[number] for number in sorted(found)), tuple(sorted(conflicts))), once


def _conflict_findings(numbers: Sequence[int]) -> Iterator[ReportLine]:
    """One line for the ids that several servos answer; so many at once are rather damaged answers."""
    if len(numbers) > _MANY:
        shown = ", ".join(map(str, numbers[:_MANY]))
        yield ReportLine("bad", f"{len(numbers)} ids (first {shown}): no answer is like the one before: check speed, "
                             "cable and ground; if they are right, several servos have one id: "
                             f"{as_typed('urbihw servo set-id')}")
    elif numbers:
        shown = ", ".join(map(str, numbers))
        yield ReportLine("bad", f"id {shown}: more than one servo answers: {as_typed('urbihw servo set-id')}")


def _read_often(line: ServoLine, servo: SurveyedServo) -> int:
    """Read a servo ROUNDS times; return the number of retries."""
    table = servo.device.table
    bus = bus_for(line.link, servo.device)
    names = [name for name in _READ if table is not None and name in table.items][:1]
    blocks = read_blocks(table, names, servo.device.protocol) if table is not None and names else []
    for _ in range(ROUNDS):
        try:
            if blocks:
                bus.read(servo.device.id, blocks[0].address, blocks[0].size)
            else:
                bus.ping(servo.device.id)
        except (BusTimeout, BadFrame, DeviceRefused):
            continue
    return bus.counters.retried


_CABLE: Final = ": check its cable and supply"


def _describe(report: BusReport, meter: BusMeter, cycles: float, how: str) -> None:
    """Add what a meter has measured of bytes and times."""
    times = meter.turnarounds()
    cycle_bytes = (meter.written + meter.read) / cycles if cycles else 0.0
    report.numbers |= {
        "bytes_a_cycle": round(cycle_bytes, 1), "busy": round(meter.busy, 4), "damaged": meter.damaged,
        "silent": dict(meter.silent),
        "turnaround": {device: round(seconds, 6) for device, seconds in times.items()},
    }  # fmt: skip
    idle = 100 * (1 - meter.busy)
    text = f"bus: {cycle_bytes:.0f} bytes a cycle, idle {idle:.0f} % of the time ({how})"
    report.findings.append(ReportLine("ok", text))
    if times:
        slowest = max(times, key=lambda device: times[device])
        text = (f"turnaround: {1000 * min(times.values()):.2f} .. {1000 * max(times.values()):.2f} ms "
                f"(the slowest: {slowest})")
        if times[slowest] > _SLOW_S:
            report.findings.append(ReportLine("note", f"{text}: return delay, adapter or system"))
        else:
            report.findings.append(ReportLine("ok", text))


def _silence_hint() -> str:
    """What to do about answers that are missing: on a machine with more work than processors they may only be late."""
    busy = busy_words(crowd())
    return f": {busy}: look again when it is idle" if busy else _CABLE


def _error_findings(meter: BusMeter, cycles: float, lost: Collection[str], retries: int = 0) -> Iterator[ReportLine]:
    """What went wrong on the wire, judged as by ``urbihw health``; the caller reports devices that are `lost`."""
    silent = {device: count for device, count in meter.silent.items() if device not in lost}
    among = f"in {cycles:.0f} cycles"
    if silent:
        level = error_level("timeouts", sum(silent.values()), cycles)
        times = {device: "once" if count == 1 else f"{count} times" for device, count in silent.items()}
        which = ", ".join(f"{device} ({often})" for device, often in times.items())
        hint = _silence_hint() if level else _NORMAL
        if level and hint is not _CABLE:
            level = Level.WARNING  # a machine that has no time for its worker says nothing about a cable
        yield ReportLine(_VERDICTS[level], f"no answer {among} from {which}{hint}")
    if meter.damaged:
        level = error_level("damaged", meter.damaged, cycles)
        hint = ": check cables and ground; two servos may have one id" if level else _NORMAL
        yield ReportLine(_VERDICTS[level], f"{meter.damaged} damaged answers {among}{hint}")
    if retries:
        yield ReportLine(
            _VERDICTS[error_level("retried", retries, cycles)], f"{retries} questions were repeated {among}"
        )
    if not (silent or meter.damaged or retries):
        yield ReportLine("ok", f"no question without an answer, no damaged answer {among}")


def delays(servos: Iterable[SurveyedServo]) -> dict[int, float]:
    """Return id -> return delay in seconds, of the servos that have one above 0."""
    found = {}
    for servo in servos:
        table, raw = servo.device.table, servo.values.get(DELAY)
        if table is not None and raw:
            found[servo.device.id] = units.to_si(table.item(DELAY), raw)
    return found


def _delay_findings(report: BusReport) -> Iterator[ReportLine]:
    """What the return delays cost, for each servo and in all."""
    found = delays(report.servos)
    report.numbers["return_delay"] = found
    for number, seconds in found.items():
        yield ReportLine("note", f"servo {number}: return delay {1000 * seconds:.3f} ms: 0 would gain that each cycle")
    if found:
        gain = 1000 * sum(found.values())
        mending = as_typed("urbihw doctor URL --mend")
        yield ReportLine("note", f"you would gain {gain:.1f} ms a cycle by return delay 0: {mending}")


def mend_delays(line: ServoLine, servos: Iterable[SurveyedServo], dialogue: Dialogue) -> Iterator[ReportLine]:
    """Write return delay 0 where it is not, after a question; each write is read back.  Raises LinkGone."""
    servos = tuple(servos)
    found = delays(servos)
    if not found:
        yield ReportLine("ok", "all return delays are 0")
        return
    ids = ", ".join(map(str, found))
    question = f"Write return delay 0 to servo {ids}? Their torque goes off and stays off: hold the robot."
    if not dialogue.confirm(question):
        yield ReportLine("note", "nothing was changed")
        return
    for servo in servos:
        if servo.device.id not in found:
            continue
        try:
            check_alone(line.link, servo.device)
            ServoRegisters(line.link, servo.device).write(DELAY, 0)
        except (ServoError, BusTimeout, BadFrame, DeviceRefused) as error:
            yield ReportLine("bad", f"servo {servo.device.id}: return delay not written: {error}")
        else:
            yield ReportLine("ok", f"servo {servo.device.id}: return delay is 0, checked; its torque is off")


def mend_latency(device: str, dialogue: Dialogue, folder: Path = ports.LATENCY) -> Iterator[ReportLine]:
    """Set the latency timer of the adapter of a port to 1 ms, after a question; it lasts until it is unplugged."""
    timer = folder / Path(device).resolve().name / "latency_timer"
    try:
        value = int(timer.read_text("ascii"))
    except (OSError, ValueError):
        return
    if value <= 1 or not dialogue.confirm(f"Set the latency timer of {device} from {value} to 1 ms?"):
        return
    try:
        timer.write_text("1\n", "ascii")
    except OSError as error:
        yield ReportLine("note", f"latency timer not set: {error.strerror}: echo 1 | sudo tee {timer}")
    else:
        yield ReportLine("ok", f"latency timer of {device}: 1 ms until it is unplugged; the udev rules make it last")


def _health_of(path: Path) -> Mapping[str, Any]:
    (answer,) = control.ask([path], "health", "urbihw doctor")
    return answer.state
