"""How soon a robot stands when something goes wrong: `python -m bench.safety [--rig NXT] [--event SIGTERM] [--write]`.

Real daemons, with their workers, before simulated robots in this process, on real transports. Each robot is set
moving; then something happens, and the body of the robot is looked at every few milliseconds: when it last moved, how
far it has come since, whether it then stands for three seconds, and what the client has read that had set it moving.
With `--write` the tables go into docs/safety.md, between the two markers; those of robots that were not measured stay.
"""

from __future__ import annotations

import argparse
import math
import os
import platform
import re
from collections.abc import Iterable, Iterator

from bounds_lab import BOUND_CASES, BOUND_RIGS, measure_peak
from faults_lab import EVENTS, Event, Outcome, run
from moving_robots import RIGS, Rig

from bench import ROOT

PAGE = ROOT / "docs" / "safety.md"
BEGIN, END = "<!-- measured -->", "<!-- /measured -->"
EMPTY = f"# Safety\n\n{BEGIN}\n{END}\n"
HEAD = "| What happens | stands after | moved | stays so for 3 s | the client reads |\n|---|---|---|---|---|"
LONGEST = 140
BOUNDS = "Servos, how fast they get"


def row(rig: Rig, event: Event, outcome: Outcome) -> str:
    """A line of the table of a robot."""
    if math.isfinite(outcome.standstill):
        after, stays = f"{outcome.standstill * 1000:.0f} ms", "yes"
    elif rig.live and "pulled" in event.name:
        ratio = outcome.peaks[1] / outcome.peaks[0]
        after, stays = "-", f"goes on when it is back, at {ratio:.2f} times its speed"
    else:
        after, stays = "not at all", "no"
    reads = re.sub(r"\w+://\S+", "(url)", outcome.reads).replace("|", "\\|")
    reads = reads if len(reads) <= LONGEST else reads[:LONGEST] + " ..."
    way = f"{outcome.moved * 100:.1f} cm" if rig.unit == "m" else f"{outcome.moved:.0f} {rig.unit}"
    way = way if after != "-" else after
    return f"| {event.name} | {after} | {way} | {stays} | {reads or 'nothing'} |"


def bounds_table() -> Iterator[str]:
    """The table of the bodies that are bound to a speed, line by line, as it is measured."""
    names = " | ".join(f"fastest, {rig.name}" for rig in BOUND_RIGS)
    yield f"### {BOUNDS}\n\n| What happens | told | {names} |\n|---|---|{'---|' * len(BOUND_RIGS)}"
    for case in BOUND_CASES:
        peaks = " | ".join(f"{measure_peak(rig, case):.2f} rad/s" for rig in BOUND_RIGS)
        yield f"| {case.name} | {case.told:.2f} rad/s | {peaks} |"


def head() -> str:
    """The line above the tables."""
    return f"Measured with Python {platform.python_version()} on {os.cpu_count()} cores, with the simulated robots."


def table(rig: Rig, events: Iterable[Event]) -> Iterator[str]:
    """The table of a robot, line by line, as it is measured."""
    yield f"### {rig.name}\n\n`{rig.go}`\n\n{HEAD}"
    for event in events:
        if event.concerns(rig):
            yield row(rig, event, run(rig, event))


def merge(page: str, fresh: dict[str, str]) -> str:
    """A page with these tables between its markers, by names of robots; those of other robots stay."""
    if BEGIN not in page:
        page = f"{page.rstrip()}\n\n{BEGIN}\n{END}\n"
    before, _, rest = page.partition(BEGIN)
    inner, _, after = rest.partition(END)
    old = (text.strip() for text in re.split(r"^(?=### )", inner, flags=re.M)[1:])
    known = {text.splitlines()[0].removeprefix("### "): text for text in old} | fresh
    found = "\n\n".join([head(), *(known[name] for name in (BOUNDS, *(rig.name for rig in RIGS)) if name in known)])
    return f"{before}{BEGIN}\n{found}\n{END}{after}"


def main() -> None:
    """Measure, print, and write if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rig", default="", metavar="NAME", help="only robots with this in their name")
    parser.add_argument("--event", default="", metavar="NAME", help="only events with this in their name")
    parser.add_argument("--write", action="store_true", help=f"put the tables into {PAGE.relative_to(ROOT)}")
    wanted = parser.parse_args()
    rigs = [rig for rig in RIGS if wanted.rig.lower() in rig.name.lower()]
    events = [event for event in EVENTS if wanted.event.lower() in event.name.lower()]
    bounds = wanted.rig.lower() in BOUNDS.lower() and not wanted.event
    if not (rigs or bounds) or not events:
        names = ", ".join(each.name for each in (RIGS if not rigs else EVENTS))
        parser.error(f"no such {'rig' if not rigs else 'event'}; there are: {names}")
    if wanted.write and wanted.event:
        parser.error("--write takes whole tables: leave --event out")
    print(head())
    fresh: dict[str, str] = {}
    tables = {rig.name: table(rig, events) for rig in rigs}
    if bounds:
        tables[BOUNDS] = bounds_table()
    for name, rows in tables.items():
        lines = []
        print()
        for line in rows:
            print(line, flush=True)
            lines.append(line)
        fresh[name] = "\n".join(lines)
    if wanted.write:
        PAGE.write_text(merge(PAGE.read_text("utf-8") if PAGE.exists() else EMPTY, fresh), "utf-8")


if __name__ == "__main__":
    main()
