"""An hour of random programs and faults for each robot: `python -m bench.random_faults [--platform nao] [--seed 2]`.

In simulated time, judged at the body: see ``tests/platforms/test_random_faults.py``, which does the same. A row tells
what befell the robot, the highest speed as a share of what was allowed at that moment, how long a body moved at most
after the last statement that asked for it, and whether all was right.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import pytest
from random_fate import live

from urbihw.platforms import folders

HEAD = (
    "| robot | simulated | befell it | fastest, of what was told | stood after | nobody asked | processor | verdict |"
    "\n|---|---|---|---|---|---|---|---|"
)


def row(platform: str, seconds: float, seed: int) -> tuple[str, str]:
    """Return the line of a robot, and what was wrong, "" if nothing."""
    begin = time.process_time()
    with tempfile.TemporaryDirectory(prefix="random-") as folder:
        try:
            trial = live(platform, seconds, seed, Path(folder))
        except pytest.fail.Exception as failure:
            wrong = str(failure)
            return f"| {platform} | - | - | - | - | - | - | {wrong.splitlines()[0]} |", wrong
    befell = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in trial.befell.most_common())
    figures = (
        f"{seconds:.0f} s", befell, f"{trial.fastest_share:.0%}", f"{trial.slowest_rest:.2f} s",
        f"{trial.quiet_share(seconds):.0%} of the time", f"{time.process_time() - begin:.0f} s",
    )  # fmt: skip
    return f"| {platform} | {' | '.join(figures)} | right |", ""


def main() -> None:
    """Let each robot live, and print."""
    names = [folder.name for folder in folders()]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--platform", choices=names, help="only this one")
    parser.add_argument("--seconds", type=float, default=3600.0, help="simulated time for each robot")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="ten seconds each")
    wanted = parser.parse_args()
    print(HEAD, flush=True)
    failures = []
    for name in [wanted.platform] if wanted.platform else names:
        line, wrong = row(name, 10.0 if wanted.quick else wanted.seconds, wanted.seed)
        print(line, flush=True)
        failures += [wrong] if wrong else []
    print("".join(f"\n{wrong}\n" for wrong in failures), end="")
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
