"""Play transcripts and show how their answers differ: ``python -m tests.lang.run [--write] FILE ...``.

With ``--write`` the expected lines are replaced by what was answered, for the author to review: read the diff, a
transcript that repeats what a wrong kernel said is worth less than none.  Exact time stamps are written where the file
says ``//#timed`` or has exact ones already.  Exit code 1 if anything differed.
"""

from __future__ import annotations

import argparse
import difflib
import sys
from collections.abc import Sequence
from pathlib import Path

from .transcript import Player, read, rewrite

PASSES = 5
"""Line numbers in error messages move with the answers above them: write and play again until nothing moves."""


def as_answered(path: Path) -> str:
    """The text of a transcript with the answers it really gets."""
    text = path.read_bytes().decode("latin-1")
    for _ in range(PASSES):
        transcript = read(path, text)
        written = rewrite(transcript, Player().play(transcript))
        if written == text:
            break
        text = written
    return text


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.lang.run", description=(__doc__ or "").partition(":")[0])
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE")
    parser.add_argument("--write", action="store_true", help="replace the expected lines by what was answered")
    options = parser.parse_args(argv)
    differed = 0
    for path in options.files:
        before, after = path.read_bytes().decode("latin-1"), as_answered(path)
        differed |= before != after
        diff = difflib.unified_diff(before.split("\n"), after.split("\n"), str(path), "as answered", lineterm="", n=2)
        sys.stdout.writelines(line + "\n" for line in diff)
        if options.write and before != after:
            path.write_bytes(after.encode("latin-1"))
    return differed


if __name__ == "__main__":
    sys.exit(main())
