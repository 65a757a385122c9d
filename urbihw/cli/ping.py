"""``urbi-ping``: measures the response time of a server.

The manual has no section about it; the options are those of ``ping`` as far as they make sense here.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence

from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused, GetoptParser, complain, number, whole
from urbihw.cli.reach import add_server, credentials, server
from urbihw.exitcodes import EX_UNAVAILABLE

PROGRAM = "urbi-ping"


def parser() -> GetoptParser:
    """The options of ``urbi-ping``."""
    made = GetoptParser(PROGRAM, "Measure how long an urbiscript server takes to answer.")
    add_server(made)
    made.add_argument("-c", "--count", type=whole(1, 10**9, "number of questions"), metavar="N",
                      help="stop after N questions (default: at Ctrl-C)")
    milliseconds = number(0.001, 1e9, "time in milliseconds")
    made.add_argument("-i", "--interval", type=milliseconds, default=1000.0, metavar="MS",
                      help="time between two questions, in ms (1000)")
    made.add_argument("-t", "--timeout", type=milliseconds, default=5000.0, metavar="MS",
                      help="how long to wait for an answer, in ms (5000)")
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code: 0 if all questions were answered."""
    options = parser().parse(argv)
    times: list[float] = []
    asked = 0
    try:
        with LobbyClient(server(options), credentials(options)) as link:
            print(f"{PROGRAM} {link.peer}")
            while options.count is None or asked < options.count:
                if asked:
                    time.sleep(options.interval / 1000)
                asked += 1
                took = measure(link, options.timeout / 1000, time.perf_counter)
                times.append(took)
                print(f"answer {asked}: {took * 1000:.3f} ms", flush=True)
    except CliRefused as error:
        summary(asked, times)
        return complain(PROGRAM, error)
    except KeyboardInterrupt:
        print()
    summary(asked, times)
    return 0 if times else EX_UNAVAILABLE


def measure(link: LobbyClient, timeout: float, now: Callable[[], float]) -> float:
    """The seconds from a question to its answer."""
    began = now()
    link.ask("1", timeout)
    return now() - began


def summary(asked: int, times: Sequence[float]) -> None:
    """Print the summary of the measurement."""
    if times:
        shown = " / ".join(f"{value * 1000:.3f}" for value in (min(times), sum(times) / len(times), max(times)))
        print(f"{asked} asked, {len(times)} answered; min / mean / max: {shown} ms")


if __name__ == "__main__":
    sys.exit(main())
