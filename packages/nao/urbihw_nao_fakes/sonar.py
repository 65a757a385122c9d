"""ALSonar."""

from __future__ import annotations

from urbihw_nao_fakes.memory import Memory
from urbihw_nao_fakes.services import Service, method


class Sonar(Service):
    """ALSonar: it measures while somebody has subscribed."""

    name = "ALSonar"

    def __init__(self, memory: Memory) -> None:
        super().__init__()
        self.memory = memory

    @method("subscribe", "(s)")
    def subscribe(self, name: str) -> None:
        """Measure for one more."""
        self.memory.sonars.add(name)

    @method("unsubscribe", "(s)")
    def unsubscribe(self, name: str) -> None:
        """Measure for one less."""
        self.memory.sonars.discard(name)
