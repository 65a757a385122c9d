"""Judge the health of the robots that are served, with reasons; the exit code is 0 ok, 1 warning, 2 bad."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence

from urbihw.cli import reports
from urbihw.cli.reports import Report


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw health``."""
    reports.options(parser)
    parser.add_argument("--json", action="store_true", help="print verdict, reasons and all that the robots tell")


def run(options: argparse.Namespace) -> int:
    """Print the verdict; the exit code is that of the worst robot."""
    found = reports.collect_or_complain(options.socket)
    if isinstance(found, int):
        return found
    print(_as_json(found) if options.json else "\n".join(map(_lines, found)))
    return int(max(report.level for report in found))


def _lines(report: Report) -> str:
    texts = [f"  {finding.level.word}: {reports.clean(str(finding))}" for finding in report.findings]
    return "\n".join((f"{report.name}: {report.level.word}", *texts))


def _as_json(found: Sequence[Report]) -> str:
    return json.dumps(
        {
            report.name: {
                "verdict": report.level.word,
                "reasons": [
                    {"level": each.level.word, "kind": each.kind, "device": each.device, "text": each.text}
                    for each in report.findings
                ],
                "told": reports.without_nan(report.told),
            }
            for report in found
        },
        indent=2,
    )
