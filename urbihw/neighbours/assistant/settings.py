"""The settings of a server for an assistant."""

from __future__ import annotations

from typing import Final

from urbihw.frozen import frozen
from urbihw.neighbours.orders import OrderSettings

ROLES: Final = ("view", "drive", "full")
"""Look and stop; move slowly, too; urbiscript, too."""


@frozen(slots=False)
class AssistantSettings:
    """What an assistant gets.

    Attributes:
        orders: the daemon, and the lease of each order.
        role: one of ``ROLES``.
        asks: whether the person is asked before each movement, where the assistant's program can ask.
    """

    orders: OrderSettings
    role: str = "view"
    asks: bool = True

    def may(self, role: str) -> bool:
        """Whether the assistant has a role, or a greater one."""
        return ROLES.index(self.role) >= ROLES.index(role)
