"""Simulated chains by text: which models, and which do not share a bus."""

from __future__ import annotations

import pytest

from urbihw_fakes.bioloid.kit import Bioloid
from urbihw_fakes.chain.parts import chain_of
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.feetech.bus import FeetechBus

PING_3 = bytes.fromhex("FF FF 03 02 01 F9")
PONG_3 = bytes.fromhex("FF FF 03 02 00 FA")


def test_dynamixel_of_both_protocols_share_a_bus() -> None:
    chain = chain_of("AX-12:3, XL330:5,MX-28:7")
    assert isinstance(chain, Bioloid)
    assert [(unit.id, unit.protocol) for unit in chain] == [(3, 1), (5, 2), (7, 1)]
    chain.set_baud(1_000_000)
    assert b"".join(answer.data for answer in chain.feed(PING_3, 0.0)) == PONG_3


def test_feetech_servos_have_a_bus_of_their_own() -> None:
    chain = chain_of("STS3215:1,SCS0009:7")
    assert isinstance(chain, FeetechBus)
    assert [unit.id for unit in chain] == [1, 7]


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("STS3215:1,AX-12:2", "Dynamixel and Feetech servos do not share one bus"),
        ("AX-12", "MODEL:ID"),
        ("AX-12:300", "id of 0..252"),
        ("ZX-1:3", "not simulated"),
    ],
)
def test_what_makes_no_chain_is_refused(text: str, problem: str) -> None:
    with pytest.raises(UnknownRequest, match=problem):
        chain_of(text)
