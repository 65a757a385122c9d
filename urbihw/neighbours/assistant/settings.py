"""The settings of a server for an assistant."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from urbihw.client.credentials import Credentials
from urbihw.client.where import Where

ROLES: Final = ("view", "drive", "full")
"""Look and stop; move slowly, too; urbiscript, too."""
SPEEDS: Final[Mapping[str, float]] = {"rad": 1.0, "deg": 57.3, "turn": 0.16, "m": 0.1}
"""Greatest speed of a joint on its way, by the unit of its goal, each in a second."""


@dataclass(frozen=True)
class AssistantSettings:
    """What an assistant gets.

    Attributes:
        where: the daemon.
        credentials: those for a daemon that wants a token.
        role: one of ``ROLES``.
        asks: whether the person is asked before each movement, where the assistant's program can ask.
        lease: seconds after which what is moved stands when this process is held.
        speeds: greatest speeds of joints by their unit.
    """

    where: Where
    credentials: Credentials
    role: str = "view"
    asks: bool = True
    lease: float = 1.0
    speeds: Mapping[str, float] = field(default_factory=lambda: SPEEDS)

    def may(self, role: str) -> bool:
        """Whether the assistant has a role, or a greater one."""
        return ROLES.index(self.role) >= ROLES.index(role)
