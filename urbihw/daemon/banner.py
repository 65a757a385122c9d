"""The ten lines that greet a client (server protocol, "Banner")."""

from __future__ import annotations

from typing import Final

_ROW: Final = "*" * 56


def banner(version: str) -> tuple[str, ...]:
    """The payloads of the lines, in order."""
    return (
        f"*** {_ROW}",
        f"*** urbihw {version}: robots as urbiscript objects",
        "*** Copyright (C) 2026 the urbihw authors",
        "***",
        "*** This program comes with ABSOLUTELY NO WARRANTY.  It can",
        "*** be used under certain conditions: the BSD 3-clause",
        "*** license.  Type `localSlotNames;' to see what is here.",
        "***",
        "*** Every robot is a slot of Global; see the docs folder.",
        f"*** {_ROW}",
    )
