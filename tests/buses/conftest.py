"""A fake kit on an in-memory wire in simulated time."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

from urbihw import buses
from urbihw.buses.clock import BusSimClock
from urbihw.buses.link import Context, Link
from urbihw.buses.pipe import PipeEnd
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.transactions import ProtocolChoice
from urbihw_fakes.bioloid import Bioloid

from .sdk_bus import SdkBus

BAUD = 1_000_000


BACK_ENDS: dict[str, type[ServoBus]] = {"own": ServoBus, "sdk": SdkBus}

both_back_ends = pytest.mark.usefixtures("back_end")
"""For tests of the contract of the wire: they run over each back end."""


class Rig:
    """A kit, the simulated clock it lives on, and the link that reaches it.

    Attributes:
        back_end: what `bus` makes.
    """

    back_end: type[ServoBus] = ServoBus

    def __init__(self, kit: Bioloid) -> None:
        self.kit = kit
        self.clock = BusSimClock(100.0)
        self.end = PipeEnd(self._receive)
        self._sent: list[str] = []
        self.context = Context(self.clock, {"robot": self.end})
        self.url = f"pipe://robot?baud={BAUD}"
        self.link: Link = buses.open_link(self.url, self.context)
        kit.pace(BAUD)
        for unit in kit:
            # As a gateway should set it; the factory value of 0.5 ms is a matter of its own tests.
            unit.registers.put("return_delay", 0)

    def bus(self, protocol: ProtocolChoice = 1) -> ServoBus:
        return self.back_end(self.link, protocol)

    def sent(self) -> list[str]:
        """What the host has written since the last call, one entry a write, as spaced hex."""
        sent, self._sent = self._sent, []
        return sent

    def _receive(self, data: bytes, at: float) -> None:
        self._sent.append(data.hex(" ").upper())
        self.kit.tick(at)
        for answer in self.kit.feed(data, at):
            self.end.send(answer.data, answer.at)


@pytest.fixture(params=BACK_ENDS)
def back_end(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Rig, "back_end", BACK_ENDS[request.param])


@pytest.fixture
def rig() -> Iterator[Rig]:
    """18 AX-12 and an AX-S1 at 1 Mbps."""
    made = Rig(Bioloid(baud=BAUD))
    yield made
    made.link.close()


@pytest.fixture
def x_rig() -> Iterator[Rig]:
    """18 XL430 at 1 Mbps; their firmware knows no fast reads unless a test says so."""
    made = Rig(Bioloid.x_series(18, baud=BAUD))
    for unit in made.kit:
        unit.registers.put("firmware", 44)
    yield made
    made.link.close()


def instruction_of(line: str) -> str:
    """The instruction of a packet in hex: byte 4 in protocol 1.0, byte 7 in 2.0."""
    words = line.split()
    return words[7 if words[2:4] == ["FD", "00"] else 4]


@pytest.fixture
def make_rig() -> Callable[[Bioloid], Rig]:
    return Rig
