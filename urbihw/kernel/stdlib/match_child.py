"""The process that looks for a regular expression in a text; run as a program by ``matcher``, never imported.

On both pipes: the length of what follows in four bytes, and a value as ``marshal`` writes it.  A request is
(expression, text, seconds); the answer is [whole match, group, ...], or None, or how it failed, as a string.  The
operating system ends the process when the seconds have passed.
"""

import marshal
import re
import resource
import signal
import sys

MEMORY = 512 * 1024 * 1024
"""Bytes of memory that the process may take."""


def answer(expression: str, text: str) -> list[str] | str | None:
    """The groups of the first match, None if there is none, or what went wrong."""
    try:
        match = re.compile(expression, re.ASCII).search(text)
    except MemoryError:
        return "takes too much memory"
    except (re.error, RecursionError, OverflowError):
        return "is too complex"
    return None if match is None else [match[0], *(group or "" for group in match.groups())]


def main() -> None:
    """Answer until the other end closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a Ctrl-C is for the other end
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    source, target = sys.stdin.buffer, sys.stdout.buffer
    while len(head := source.read(4)) == 4:
        expression, text, seconds = marshal.loads(source.read(int.from_bytes(head, "big")))
        signal.setitimer(signal.ITIMER_REAL, seconds)
        data = marshal.dumps(answer(expression, text))
        signal.setitimer(signal.ITIMER_REAL, 0)
        target.write(len(data).to_bytes(4, "big") + data)
        target.flush()


if __name__ == "__main__":
    main()
