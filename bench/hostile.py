"""What hostile clients do to a server and its neighbours: `python -m bench.hostile [NAME ...] [--seconds 10]`.

Plays the rows of `tests/hostile/attacks.py`, or those with one of these words in their names, each against a fresh
server before a simulated Bioloid (`tests/hostile/attack_lab.py`).  All of them take about twenty minutes.

    p99 max       of a neighbour that asks `1+1;` every 10 ms, on time whether it was answered or not; ms
    busy          the 99th percentile of the processor time of the server until an answer came; ms
    held          the longest processor time of the server in which no answer came though one was owed; ms
    holds         how often that was longer than 50 ms
    memory        by which the server grew, at most; MB
    new           whether a new connection has all that it should while the attack goes on
    SIGTERM       how long the server took to end, the attack still going on; s; `!` where the robot does not stand
    log           lines that the attack made

Below a row stands what is wrong with it.  Judged are `busy` and `held`, which do not depend on what else the machine
has to do: at most 50 ms at the 99th percentile; those who hold the interpreter on purpose may do so once until the
limit of the server ends them, or as often as the row says; several connections may each, but not one after the other
while the neighbour waits.  The exit code is the number of rows with something wrong.
"""

from __future__ import annotations

import argparse
import sys

from attack_lab import Outcome, run
from attacks import Attack, find

from urbihw.kernel.server.bounds import HOLD_LIMIT
from urbihw.kernel.uobject import RobotSettings

GOAL = 0.05
"""Seconds of processor time at the 99th percentile of the neighbour."""
LONGEST_HOLD = 0.75 * RobotSettings("").dead_man
"""Seconds of processor time for those who hold on purpose: they do not stop the robot (``urbihw.daemon.timeouts``)."""
TIMEOUT_S = 2.0
"""Seconds that a server may take to end."""
HEAD = (
    f"{'attack':44}{'p99':>8}{'max':>8}{'busy':>8}{'held':>8}{'holds':>6}{'memory':>8}{'new':>5}{'SIGTERM':>9}{'log':>5}"
)
LONGEST, MOST = 160, 12
"""The lines below a row: how many characters, and how many lines of a kind."""


def row(attack: Attack, outcome: Outcome) -> str:
    """A line of the table."""
    seen = outcome.neighbour
    times = "".join(f"{1000 * value:8.1f}" for value in (seen.p99, seen.worst, seen.busy_p99, seen.longest_hold))
    whole = "yes" if outcome.whole == "yes" else "NO"
    ended = f"{outcome.ended:.2f}" + (" " if outcome.stands else "!")
    counts = f"{len(seen.holds):6}{outcome.peak - outcome.idle:8.0f}{whole:>5}{ended:>9}{len(outcome.log):5}"
    return f"{attack.name[:43]:44}{times}{counts}"


def notes(attack: Attack, outcome: Outcome) -> list[str]:
    """What is wrong, and what helps to see why."""
    wrong = outcome.faults(attack, TIMEOUT_S)
    seen = outcome.neighbour
    if not attack.holds:
        if seen.busy_p99 > GOAL:
            wrong.append(f"busy above {1000 * GOAL:.0f} ms")
    elif seen.longest_hold > attack.holds * LONGEST_HOLD:
        wrong.append(f"held for more than {1000 * attack.holds * LONGEST_HOLD:.0f} ms")
    elif sum(hold > HOLD_LIMIT for hold in seen.holds) > attack.holds * attack.connections:
        wrong.append(f"held until the limit more than {attack.holds * attack.connections} times")
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
