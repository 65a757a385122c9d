"""How the user has started this program, so that messages name commands as this user can type them.

``.venv/bin/urbihw``, ``python -m urbihw.cli.main``, or ``urbihw`` where that is on the PATH.  A stop waits for the
import of this module, so it imports nothing that takes long.
"""

from __future__ import annotations

import os
import sys

PROGRAM = "urbihw"
PROGRAMS = (PROGRAM, "urbi", "urbi-launch", "urbi-send", "urbi-image", "urbi-sound", "urbi-ping")
"""The commands: files of one folder."""
MODULE = "urbihw.cli.main"
"""What ``python -m`` runs instead of ``PROGRAM``."""


def as_typed(line: str) -> str:
    """A command line that begins with ``urbihw``, such as ``urbihw serve``, as the user of this program types it."""
    if not line.startswith(PROGRAM):
        raise ValueError(f"{line!r} does not begin with {PROGRAM}")
    return _own_program() + line.removeprefix(PROGRAM)


def _own_program() -> str:
    main = sys.modules["__main__"]
    if getattr(getattr(main, "__spec__", None), "name", "") == MODULE:
        return f"{_quoted(sys.orig_argv[0])} -m {MODULE}"
    folder, name = os.path.split(sys.argv[0])
    if name not in PROGRAMS or not folder:  # a program that uses the library, or a test
        return PROGRAM
    # What the shell has found on the PATH has its whole path in argv, too.
    beside = os.path.join(folder, PROGRAM)
    return PROGRAM if _is_same(beside, _on_path()) else _quoted(beside)


def _on_path() -> str:
    """The file that a shell runs for ``PROGRAM``; "" for none."""
    for folder in os.environ.get("PATH", "").split(os.pathsep):
        file = os.path.join(folder, PROGRAM)
        if os.access(file, os.X_OK) and os.path.isfile(file):
            return file
    return ""


def _is_same(file: str, other: str) -> bool:
    try:
        return bool(other) and os.path.samefile(file, other)
    except OSError:
        return False


def _quoted(word: str) -> str:
    return f"'{word}'" if " " in word else word
