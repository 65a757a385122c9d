"""The worker process for regular expressions: ``matcher`` runs this module as a program; it is never imported.

Messages on both pipes: a length in four bytes, then a value written by ``marshal``.  A request is (expression, text,
seconds); the answer is [whole match, group, ...], None, or an error message as a string.  The operating system ends the
process after that number of seconds.
"""

import marshal
import re
import resource
import signal
import sys

MEMORY_LIMIT = 512 * 1024 * 1024
"""Maximum memory of the process, in bytes."""


def answer(expression: str, text: str) -> list[str] | str | None:
    """The groups of the first match, None if there is none, or an error message."""
    try:
        match = re.compile(expression, re.ASCII | re.MULTILINE).search(text)
    except MemoryError:
        return "takes too much memory"
    except (re.error, RecursionError, OverflowError):
        return "is too complex"
    return None if match is None else [match[0], *(group or "" for group in match.groups())]


def main() -> None:
    """Answer requests until the other end closes the pipe."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent process
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
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
