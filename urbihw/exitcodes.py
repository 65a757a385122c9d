"""The exit codes of all commands, as ``sysexits.h`` names them.

Source: server protocol, section 9, for 1, 64, 66 and 69; the others are those of ``urbihw``.
"""

from __future__ import annotations

TYPE_CHECKING = False  # as ``typing`` has it, whose import a stop cannot wait for
if TYPE_CHECKING:
    from typing import Final

EX_OK: Final = 0
NO_SERVER: Final = 1
"""No server listens; the code that the original's own clients use."""
EX_USAGE: Final = 64
EX_SYNTAX: Final = 65
"""A syntax error in urbiscript (``EX_DATAERR``)."""
EX_NOINPUT: Final = 66
"""A file or a module cannot be read."""
EX_UNAVAILABLE: Final = 69
EX_RUNTIME: Final = 70
"""A run-time error of urbiscript, or an internal error (``EX_SOFTWARE``)."""
EX_CONFIG: Final = 78
INTERRUPTED: Final = 130
"""The code that a shell reports for a program that Ctrl-C has ended."""
