"""Search the serial ports for servos, or the network for robots of one kind.

Without a word: all USB serial ports, all speeds, all ids, all protocols.  With a url such as /dev/ttyUSB0: that port
(``?baud=`` for one speed).  With the name of a platform: its robots on the network.  Nothing is written to any servo.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from urbihw import platforms
from urbihw.buses.errors import BadUrl
from urbihw.buses.servos.findings import ServoFinding, cycle_time, findings
from urbihw.buses.servos.survey import SurveyedServo
from urbihw.cli.options import whole
from urbihw.cli.progress import ProgressBar
from urbihw.cli.scan_ports import PortReport, ScanWish, as_json, firmware, search, shown, told_servos, wire_findings
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.kernel.uobject import BadConfig
from urbihw.settings import one_line

_HEADER: Final = ("bps", "id", "model", "firmware", "V", "degC", "ms", "what is wrong")
_FASTEST: Final = 10_500_000


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw scan``."""
    parser.add_argument("where", nargs="?", default="", metavar="URL|PLATFORM",
                        help="a port, such as /dev/ttyUSB0, or a kind of robot to search for on the network (spykee)")
    parser.add_argument("--baud", type=whole(300, _FASTEST, "speed in bps"), action="append", default=[],
                        help="only this speed; may be repeated (default: all)")
    parser.add_argument("--protocol", type=int, choices=(1, 2), help="only this protocol (default: both)")
    parser.add_argument("--thorough", action="store_true",
                        help="ping every id at every speed; half a minute, for servos that ignore a broadcast ping")
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")


def run(options: argparse.Namespace) -> int:
    """Search; returns the exit code."""
    if options.where and not any(sign in options.where for sign in "/:"):
        if Path(options.where.partition("?")[0]).exists():
            options.where = f"./{options.where}"
            return run(options)
        return search_network(options.where)
    protocols = (1, 2) if options.protocol is None else (options.protocol,)
    wanted = ScanWish(options.where, tuple(options.baud), protocols, options.thorough)
    reports = []
    try:
        with ProgressBar() as bar:
            for report in search(wanted, bar.show):
                reports.append(report)
                if wanted.url and not report.usable:
                    bar.clear()
                    return _complain(report.problem, EX_CONFIG)
                if not options.json:
                    bar.clear()
                    print("\n".join(lines(report)), flush=True)
    except BadUrl as error:
        return _complain(str(error), EX_CONFIG)
    if options.json:
        print(json.dumps(as_json(reports), indent=2))
    if not reports:
        return _complain("no serial port found: plug the adapter in", EX_UNAVAILABLE)
    found = any(report.survey and (report.survey.servos or report.survey.conflicts) for report in reports)
    return EX_OK if found else EX_UNAVAILABLE


def search_network(platform: str) -> int:
    """Print each robot of a platform when it answers."""
    count = 0
    try:
        for robot in platforms.scan(platforms.find(platform)):
            count += 1
            # Its name comes from the network, and goes to a terminal.
            print(one_line(str(robot)), flush=True)
    except BadConfig as error:
        return _complain(str(error), EX_CONFIG)
    except OSError as error:
        return _complain(f"cannot look for robots: {error.strerror}; is there a network?", EX_UNAVAILABLE)
    if not count:
        return _complain(
            f"no {platform} answers; is it switched on, and this computer in its network?", EX_UNAVAILABLE
        )  # fmt: skip
    return EX_OK


def lines(report: PortReport) -> Iterator[str]:
    """The text for one port."""
    about = [report.adapter, f"serial number {report.serial_number}" if report.serial_number else "", report.by_id]
    yield f"{report.port}: {', '.join(filter(None, about))}" if any(about) else f"{report.port}:"
    if report.problem:
        yield f"  {report.problem}"
    if report.survey is None:
        return
    for finding in wire_findings(report):
        yield f"  {_with_cost(finding)}"
    servos = told_servos(report.survey.servos)
    if not servos:
        tried = "1 speed" if len(report.survey.bauds) == 1 else f"{len(report.survey.bauds)} speeds"
        what = "no servo answers alone" if report.survey.conflicts else "no servo answers"
        hint = "" if report.survey.conflicts else ": is it powered?"
        yield f"  {what} ({tried}, {report.survey.seconds:.1f} s){hint}"
        return
    rows: list[tuple[str, ...]] = [_HEADER]
    for servo in servos:
        rows += _rows(servo, report.latency)
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADER) - 1)]
    for row in rows:
        cells = [cell.ljust(width) for cell, width in zip(row, widths, strict=False)]
        yield f"  {'  '.join([*cells, row[-1]])}".rstrip()
    yield _summary(report, servos)


def _summary(report: PortReport, servos: Sequence[SurveyedServo]) -> str:
    cycle = sum(cycle_time(servo, report.latency) for servo in servos)
    gain = sum(finding.cost for servo in servos for finding in findings(servo)) + report.latency * len(servos)
    saved = f", of which {1000 * gain:.1f} ms can be saved" if gain else ""
    seconds = report.survey.seconds if report.survey else 0.0
    return f"  {len(servos)} found in {seconds:.1f} s; reading all takes {1000 * cycle:.1f} ms a cycle{saved}"


def _rows(servo: SurveyedServo, latency: float) -> list[tuple[str, ...]]:
    """The rows of one servo: one more for each further thing that is wrong."""
    device = servo.device
    volts, celsius = shown(servo, "present_voltage"), shown(servo, "present_temperature")
    texts = [_with_cost(finding) for finding in findings(servo)] or [""]
    first = (
        str(servo.baud), str(device.id), device.name if device.model else "?", firmware(servo),
        "?" if volts is None else f"{volts:.1f}", "?" if celsius is None else f"{celsius:.0f}",
        f"{1000 * cycle_time(servo, latency):.2f}", texts[0],
    )  # fmt: skip
    return [first, *(("",) * (len(_HEADER) - 1) + (text,) for text in texts[1:])]


def _with_cost(finding: ServoFinding) -> str:
    return f"{finding.text} ({1000 * finding.cost:.2f} ms a cycle)" if finding.cost else finding.text


def _complain(text: str, code: int) -> int:
    print(f"urbihw: {text}", file=sys.stderr)
    return code
