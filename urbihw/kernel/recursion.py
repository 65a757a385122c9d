"""Python's recursion limit, which signal handlers, the compiler and long work raise for a while."""

from __future__ import annotations

import sys


def set_recursion_limit(limit: int) -> int:
    """Set the limit and return the former one, which the caller can set again with ``sys.setrecursionlimit``.

    Python refuses a limit that the depth of calls has reached.  So a function that has used up its stack could raise
    the limit and not restore it, and with each such call programs could go deeper.  Here, one call deeper, the same
    function gets a RecursionError before anything has changed.
    """
    former = sys.getrecursionlimit()
    sys.setrecursionlimit(limit)
    return former
