"""What the settings of a worker of CiA 402 drives hold, beside those of every worker (`messages.Configure.options`)."""

from __future__ import annotations

from typing import Final

from urbihw.frozen import frozen
from urbihw.settings import SettingsTable, setting, wholes

LAST_NODE: Final = 126
"""The largest number of a drive; we are the node above."""


@frozen(slots=False)
class CanOptions(SettingsTable):
    """The options of the family.

    Attributes:
        nodes: the drives to look for; all if empty.
    """

    nodes: tuple[int, ...] = setting((), wholes(1, LAST_NODE, "[5, 6]"))
