"""The common part of ``urbihw status``, ``urbihw health`` and ``urbihw monitor``: the robots, asked for their health.

The answers come from the bus workers, not from the interpreter.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, NamedTuple

from urbihw.buses.verdict import Level, Reason, device_name, judge, level_of, number_in, rows_in, table_in
from urbihw.cli import control
from urbihw.cli.reach import accepts
from urbihw.daemon.runtime import control_sockets, service_socket_names
from urbihw.exitcodes import EX_CONFIG, EX_UNAVAILABLE
from urbihw.settings import escape_unprintable

SHOWN: Final = ("position", "speed", "torque", "load", "current", "voltage", "temperature", "charge")
"""The quantities of a line, in order."""
_FORMATS: Final = {
    "temperature": "{:.0f}", "voltage": "{:.1f}", "charge": "{:.0%}", "load": "{:.0%}", "current": "{:.2f}",
}  # fmt: skip


class Report(NamedTuple):
    """What a robot tells; ``told`` is empty if it has not answered, for the reason ``problem``."""

    name: str
    told: Mapping[str, Any]
    problem: str
    findings: list[Reason]

    @property
    def level(self) -> Level:
        """The verdict on the robot."""
        return level_of(self.findings)


def options(parser: argparse.ArgumentParser) -> None:
    """The options of all three commands."""
    parser.add_argument("--socket", type=Path, metavar="PATH", help="control socket of the robot (default: all found)")


def collect(path: Path | None) -> list[Report]:
    """Ask all robots, or the one at a path; a robot whose daemon has ended is left out.

    Raises ValueError if the folder of the sockets cannot be used.
    """
    paths = [path] if path is not None else _sockets()
    answers = zip(paths, control.ask(paths, "health", ""), strict=True)
    found = (_replaced(each, answer) if answer.gone else answer for each, answer in answers)
    return [report(answer) for answer in found if not answer.gone]


def _replaced(path: Path, answer: control.Answer) -> control.Answer:
    """The answer for a control socket without a listener: its daemon may be there, and start another bus worker."""
    client_socket = path.with_name(f"urbi-{path.stem.rpartition('-')[2]}.socket")
    if not client_socket.exists() or not accepts(client_socket):
        return answer
    return control.Answer(answer.name, {}, "its bus worker has ended; the daemon is there and starts another one")


def _sockets() -> list[Path]:
    try:
        return control_sockets()
    except ValueError:  # BadConfig, for the folder of the user
        found = [Path(name) for name in service_socket_names()]
        if not found:
            raise
        return found


def collect_or_complain(path: Path | None) -> list[Report] | int:
    """The reports of all robots, or the exit code after a line that says why there is none."""
    try:
        reports = collect(path)
    except ValueError as error:
        return control.complain(str(error), EX_CONFIG)
    return reports or control.complain(control.no_daemon_problem("health"), EX_UNAVAILABLE)


def report(answer: control.Answer) -> Report:
    """The report of an answer; a worker that does not answer is bad."""
    if answer.problem:
        return Report(answer.name, {}, answer.problem, [Reason(Level.BAD, "silent", "", answer.problem)])
    return Report(answer.name, answer.state, "", judge(answer.state))


def robot_line(report: Report) -> str:
    """The robot in one line."""
    told = report.told
    if not told:
        return f"{report.name}: bad: {clean(report.problem)}"
    bus, parts = table_in(told, "bus"), []
    parts.append("link up" if told.get("link") else f"no link ({told.get('link_reason') or 'never there'})")
    parts.append(f"{number_in(bus, 'rate'):.0f} of {number_in(bus, 'wanted_rate'):.0f} Hz")
    parts.append(f"wire {number_in(bus, 'load'):.0%}")
    parts.append(f"{number_in(bus, 'late'):.0f} late")
    errors = ", ".join(f"{count} {kind}" for kind, count in table_in(bus, "errors").items() if count)
    parts.append(errors or "no errors")
    if told.get("estop"):
        parts.append(f"emergency stop by {told['estop']}")
    return clean(f"{report.name}: {report.level.word}: {', '.join(parts)}")


def as_row(report: Report) -> dict[str, Any]:
    """The robot for programs: its verdict, the line for people, and its devices as they tell themselves."""
    devices = without_nan(rows_in(report.told, "devices"))
    return {"verdict": report.level.word, "line": robot_line(report), "devices": devices}


def device_line(row: Mapping[str, Any]) -> str:
    """A device in one line."""
    model = f" {row['model']}" if row.get("model") else ""
    parts = [str(row.get("state", "?")), *(value_text(row, name) for name in SHOWN if name in table_in(row, "values"))]
    if row.get("alarm"):
        parts.append(f"alarm: {row['alarm']}")
    if row.get("who"):
        parts.append(f"moved by {row['who']}")
    return clean(f"{device_name(row)}{model}: {', '.join(part for part in parts if part)}")


def value_text(row: Mapping[str, Any], quantity: str, table: str = "values") -> str:
    """A value with its unit; "" if there is none."""
    value = table_in(row, table).get(quantity)
    if not isinstance(value, int | float):
        return ""
    unit = table_in(row, "units").get(quantity, "")
    return f"{_FORMATS.get(quantity, '{:.2f}').format(value)}{f' {unit}' if unit else ''}"


def without_nan(told: Any) -> Any:
    """An answer with null for numbers that JSON does not have: nan, inf."""
    return json.loads(json.dumps(told), parse_constant=lambda _: None)


def clean(text: str) -> str:
    """A text without control characters: models and names come from a robot."""
    return escape_unprintable(text)
