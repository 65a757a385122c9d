"""``urbi-ping``: how long a server takes to answer.

It has no section in the manual; the options are those of ``ping`` as far as they make sense here.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence

from urbihw.cli.link import Link
from urbihw.cli.options import EX_UNAVAILABLE, Parser, Refused, complain
from urbihw.cli.reach import add_server, credentials, server

PROGRAM = "urbi-ping"


def parser() -> Parser:
    """The options of ``urbi-ping``."""
    made = Parser(PROGRAM, "Measure how long an urbiscript server takes to answer.")
    add_server(made)
    made.add_argument("-c", "--count", type=_count, metavar="N", help="stop after N questions (default: at Ctrl-C)")
    made.add_argument("-i", "--interval", type=_milliseconds, default=1.0, metavar="MS",
                      help="time between two questions, in ms (1000)")
    made.add_argument("-t", "--timeout", type=_milliseconds, default=5.0, metavar="MS",
                      help="how long to wait for an answer, in ms (5000)")
    return made


def _count(text: str) -> int:
    if not text.isdigit() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} is no number of questions")
    return int(text)


def _milliseconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < 1e9:
        raise argparse.ArgumentTypeError(f"{text!r} is no time in milliseconds")
    return value / 1000


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code: 0 if all questions were answered."""
    options = parser().parse(argv)
    times: list[float] = []
    asked = 0
    try:
        with Link(server(options), credentials(options)) as link:
            print(f"{PROGRAM} {link.peer}")
            while options.count is None or asked < options.count:
                if asked:
                    time.sleep(options.interval)
                asked += 1
                took = measure(link, options.timeout, time.perf_counter)
                times.append(took)
                print(f"answer {asked}: {took * 1000:.3f} ms", flush=True)
    except Refused as error:
        summary(asked, times)
        return complain(PROGRAM, error)
    except KeyboardInterrupt:
        print()
    summary(asked, times)
    return 0 if times else EX_UNAVAILABLE


def measure(link: Link, patience: float, now: Callable[[], float]) -> float:
    """Seconds from a question to its answer."""
    began = now()
    link.ask("1", patience)
    return now() - began


def summary(asked: int, times: Sequence[float]) -> None:
    """The last line."""
    if times:
        shown = " / ".join(f"{value * 1000:.3f}" for value in (min(times), sum(times) / len(times), max(times)))
        print(f"{asked} asked, {len(times)} answered; min / mean / max: {shown} ms")


if __name__ == "__main__":
    sys.exit(main())
