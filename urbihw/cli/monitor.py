"""Watch the robots that are served: a live table of their devices, or lines where there is no terminal for a table.

The table asks four times a second, each time anew, so it finds a daemon again that was restarted.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import select
import sys
import termios
import time
import tty
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from urbihw.buses.verdict import device_name, rows_in
from urbihw.cli import control, reports
from urbihw.cli.options import whole
from urbihw.cli.reports import Report
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_UNAVAILABLE
from urbihw.extras import install_command
from urbihw.started import as_typed

if TYPE_CHECKING:
    from rich.console import RenderableType

TABLE_PERIOD_S: Final = 0.25
LINE_PERIOD_S: Final = 1.0
MAX_FINDINGS: Final = 5
"""Reasons of a verdict above the table."""
LEAVE: Final = b"q\x03\x04"
"""Keys that end it: q, Ctrl-C, Ctrl-D."""
_STYLES: Final = ("green", "yellow", "bold red")
"""The colours of the levels, from ok to bad."""
_STATE_STYLES: Final = {"ok": "green", "back": "yellow", "suspect": "yellow", "lost": "bold red"}
_DUMB: Final = ("", "dumb", "unknown")
"""Values of TERM for a terminal without a cursor that can be moved."""
_MEASURED: Final = ("temperature", "voltage", "load", "current", "charge")
_WORDS: Final = ("device", "model", "state", "moved by")
"""Columns of words, which begin at the left; the others are numbers."""
_GAP: Final = 2
"""Spaces between two columns."""
_ALWAYS: Final = ("device", "model", "state", "requested", "applied", "measured", "moved by")
"""Columns that are shown without any text, too, so that the table does not jump when a device begins to move."""
_FIRST_TO_GO: Final = (
    "misses", "charge", "current", "load", "model", "voltage", "applied", "temperature", "moved by", "requested",
)  # fmt: skip
"""Columns that a narrow terminal does not show, the least important first."""


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw monitor``."""
    reports.options(parser)
    parser.add_argument("--count", type=whole(1, 10**9), metavar="N", help="end after N lines or pictures of the table")
    parser.add_argument("--json", action="store_true", help="lines for programs: one object a second with all robots")


def run(options: argparse.Namespace) -> int:
    """Show the table until q is pressed, or lines until the reader ends."""
    try:
        if not options.json and sys.stdin.isatty() and sys.stdout.isatty() and os.environ.get("TERM", "") not in _DUMB:
            return _show_table(options)
        return _print_lines(options, time.sleep)
    except ValueError as error:  # BadConfig
        return control.complain(str(error), EX_CONFIG)
    except (KeyboardInterrupt, BrokenPipeError):
        # Python would complain of the broken pipe once more when it flushes at its end.
        with contextlib.suppress(OSError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EX_OK


def _print_lines(options: argparse.Namespace, sleep: Callable[[float], None]) -> int:
    """Print one line a second for each robot.  A daemon that goes may come back; without one at the start the command
    fails."""
    left, seen = options.count, False
    while left is None or left > 0:
        found = reports.collect(options.socket)
        seen = seen or bool(found)
        if not seen:
            return control.complain(control.no_daemon_problem("health"), EX_UNAVAILABLE)
        if options.json:
            lines = [json.dumps({report.name: reports.as_row(report) for report in found})]
        else:
            texts = [reports.robot_line(report) for report in found] or [control.no_daemon_problem("health")]
            lines = [f"{time.strftime('%H:%M:%S')} {text}" for text in texts]
        for line in lines:
            print(line, flush=True)
        left = None if left is None else left - 1
        if left != 0:
            sleep(LINE_PERIOD_S)
    return EX_OK


def _show_table(options: argparse.Namespace) -> int:
    try:
        from rich.live import Live
    except ImportError:
        plain = as_typed("urbihw monitor") + " | cat"
        return control.complain(f"the table needs a package: {install_command('monitor')}; or: {plain}",
                                EX_CONFIG)
    left = options.count
    with _keys(), Live(screen=True, auto_refresh=False) as live:
        while left is None or left > 0:
            live.update(picture(reports.collect(options.socket), live.console.width), refresh=True)
            left = None if left is None else left - 1
            if _wait_for_key(TABLE_PERIOD_S):
                break
    return EX_OK


@contextlib.contextmanager
def _keys() -> Iterator[None]:
    """Keys arrive one by one, and are not shown."""
    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


def _wait_for_key(seconds: float) -> bool:
    """Wait; return whether a key ends the command, or the terminal is gone."""
    if not select.select([sys.stdin], [], [], seconds)[0]:
        return False
    typed = os.read(sys.stdin.fileno(), 100)
    return not typed or any(key in LEAVE for key in typed)


# ---------------------------------------------------------------- the picture


def picture(found: Sequence[Report], width: int) -> RenderableType:
    """The table of all robots, for a terminal with so many columns."""
    from rich.console import Group
    from rich.text import Text

    if not found:
        return Text(f"{control.no_daemon_problem('health')}; looking for it (q ends)", "yellow")
    parts: list[RenderableType] = []
    for report in found:
        parts.append(Text(reports.robot_line(report), _STYLES[report.level]))
        parts += [Text(f"  {reports.clean(str(each))}", _STYLES[each.level]) for each in report.findings[:MAX_FINDINGS]]
        if len(report.findings) > MAX_FINDINGS:
            parts.append(Text(f"  and {len(report.findings) - MAX_FINDINGS} more: {as_typed('urbihw health')}"))
        if report.told:
            parts.append(_table(rows_in(report.told, "devices"), width))
    parts.append(Text("q ends", "dim"))
    return Group(*parts)


def _table(rows: Sequence[Mapping[str, Any]], width: int) -> RenderableType:
    """The devices of a robot, a row each, with the columns that have something to tell and fit into the width."""
    from rich.console import Group
    from rich.table import Table
    from rich.text import Text

    cells = [cells_of(row) for row in rows]
    heads, narrow = columns_for(cells, width)
    table = Table(box=None, pad_edge=False, padding=(0, _GAP, 0, 0))
    for head in heads:
        table.add_column(head, justify="left" if head in _WORDS else "right", no_wrap=True)
    for row, texts in zip(rows, cells, strict=True):
        style = "bold red" if row.get("alarm") else _STATE_STYLES.get(str(row.get("state")), "")
        table.add_row(*(Text(texts[head]) for head in heads), style=style)
    if not narrow:
        return table
    return Group(table, Text(f"no room for: {', '.join(narrow)}; make the terminal wider", "dim"))


def cells_of(row: Mapping[str, Any]) -> dict[str, str]:
    """The texts of a device by the heads of their columns."""
    moved = motion_of(row)
    cells = {"device": device_name(row), "model": row.get("model"), "state": row.get("alarm") or row.get("state")}
    cells |= {
        head: reports.value_text(row, moved, which)
        for head, which in (("requested", "requested"), ("applied", "applied"), ("measured", "values"))
    }
    cells |= {name: reports.value_text(row, name) for name in _MEASURED}
    cells["misses"] = f"{row.get('missed')}/{row.get('lost')}" if row.get("missed") or row.get("lost") else ""
    cells["moved by"] = row.get("who")
    return {head: reports.clean(str(text or "")) for head, text in cells.items()}


def columns_for(rows: Sequence[Mapping[str, str]], width: int) -> tuple[list[str], list[str]]:
    """The heads of the columns that are shown, and of those for which a terminal of this width has no room.

    A column without any text is left out; the least important ones give way first.
    """
    widths = {
        head: max(len(head), *(len(row[head]) for row in rows))
        for head in (rows[0] if rows else ())
        if head in _ALWAYS or any(row[head] for row in rows)
    }
    narrow = []
    for head in _FIRST_TO_GO:
        if sum(widths.values()) + _GAP * (len(widths) - 1) <= width:
            break
        if widths.pop(head, None) is not None:
            narrow.append(head)
    return [*widths], narrow


def motion_of(row: Mapping[str, Any]) -> str:
    """The quantity that moves a device: what was requested last, or else what is measured."""
    for table in ("requested", "values"):
        found = row.get(table)
        for name in ("position", "speed", "torque"):
            if isinstance(found, Mapping) and name in found:
                return name
    return "position"
