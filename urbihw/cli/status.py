"""Show the robots that are served, and each of their devices in one line."""

from __future__ import annotations

import argparse
import json

from urbihw.buses.verdict import rows_in
from urbihw.cli import reports
from urbihw.exitcodes import EX_OK, EX_UNAVAILABLE


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw status``."""
    reports.options(parser)
    parser.add_argument("--json", action="store_true", help="for programs")


def run(options: argparse.Namespace) -> int:
    """Print one line for each robot and each device; 0 if all robots have answered, whatever they told."""
    found = reports.collect_or_complain(options.socket)
    if isinstance(found, int):
        return found
    if options.json:
        print(json.dumps({report.name: reports.as_row(report) for report in found}, indent=2))
    for report in [] if options.json else found:
        print(reports.robot_line(report))
        for row in rows_in(report.told, "devices"):
            print(f"  {reports.device_line(row)}")
    return EX_UNAVAILABLE if any(not report.told for report in found) else EX_OK
