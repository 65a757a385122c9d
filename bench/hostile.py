"""What hostile clients do to a server and its neighbours: `python -m bench.hostile [NAME ...] [--seconds 10]`.

Plays the rows of `tests/hostile/attacks.py`, or those with one of these words in their names, each against a fresh
server before a simulated Bioloid (`tests/hostile/attack_lab.py`).  All of them take about twenty minutes.

    p50 p99 max   of a neighbour that asks `1+1;` every 10 ms, on time whether it was answered or not; ms
    memory        by which the server grew, at most; MB
    new           whether a new connection has all that it should while the attack goes on
    SIGTERM       how long the server took to end, the attack still going on; s; `!` where the robot does not stand
    log           lines that the attack made

Below a row stands what is wrong with it.  The goal is 50 ms at the 99th percentile, on an idle machine.  The exit code
is the number of rows with something wrong.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "tests" / "hostile"))

from attack_lab import Outcome, run  # noqa: E402
from attacks import Attack, find  # noqa: E402

GOAL = 0.05
"""Seconds at the 99th percentile of the neighbour."""
TIMEOUT_S = 2.0
"""Seconds that a server may take to end."""
HEAD = f"{'attack':44}{'p50':>8}{'p99':>8}{'max':>8}{'memory':>8}{'new':>6}{'SIGTERM':>9}{'log':>6}"
LONGEST, MOST = 160, 12
"""Of the lines below a row: characters, and how many of a kind."""


def row(attack: Attack, outcome: Outcome) -> str:
    """A line of the table."""
    seen = outcome.neighbour
    times = "".join(f"{1000 * value:8.1f}" for value in (seen.p50, seen.p99, seen.worst))
    whole = "yes" if outcome.whole == "yes" else "NO"
    ended = f"{outcome.ended:.2f}" + (" " if outcome.stands else "!")
    return f"{attack.name[:43]:44}{times}{outcome.peak - outcome.idle:8.0f}{whole:>6}{ended:>9}{len(outcome.log):6}"


def notes(attack: Attack, outcome: Outcome) -> list[str]:
    """What is wrong, and what helps to see why."""
    wrong = outcome.faults(attack, TIMEOUT_S)
    if outcome.neighbour.p99 > GOAL:
        wrong.append(f"p99 above {1000 * GOAL:.0f} ms")
    return wrong


def main() -> int:
    """Play the rows and print the table; the number of rows with something wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", nargs="*", help="only rows with one of these in their names")
    parser.add_argument("--seconds", type=float, metavar="S", help="for which each attack goes on")
    parser.add_argument("--verbose", action="store_true", help="what the attacker reads and the log says, too")
    wanted = parser.parse_args()
    print(HEAD)
    bad = 0
    for attack in find(wanted.name):
        outcome = run(attack, wanted.seconds)
        print(row(attack, outcome))
        wrong = notes(attack, outcome)
        bad += bool(wrong)
        for line in wrong:
            print(f"    wrong: {line[:LONGEST]}")
        if outcome.told:
            print(f"    told: {outcome.told.strip()[:LONGEST]}")
        if wanted.verbose:
            for line in outcome.reads.splitlines()[:MOST]:
                print(f"    reads: {line[:LONGEST]}")
            for line in outcome.log[:MOST]:
                print(f"    log: {line[:LONGEST]}")
        sys.stdout.flush()
    return min(bad, 100)


if __name__ == "__main__":
    sys.exit(main())
