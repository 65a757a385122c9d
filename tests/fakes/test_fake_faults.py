"""Faults on request."""

from __future__ import annotations

import pytest
from fake_talk import Talk

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.faults import Fault

PING6 = "FF FF 06 02 01 F6"
PONG6 = "FF FF 06 02 00 F7"
PING7 = "FF FF 07 02 01 F5"
PONG7 = "FF FF 07 02 00 F6"


@pytest.fixture
def kit() -> Bioloid:
    return Bioloid()


@pytest.fixture
def wire(kit: Bioloid) -> Talk:
    return Talk(kit)


@pytest.mark.parametrize(
    ("word", "amount", "answer"),
    [
        ("silence", None, []),
        ("checksum", None, ["FF FF 06 02 00 08"]),
        ("cut", None, ["FF FF 06"]),
        ("cut", 5, ["FF FF 06 02 00"]),
        ("cut", 0, []),
        ("noise", None, ["5A FF FF 01 FF FF 06 02 00 F7"]),
        ("noise", 9, ["5A FF FF 01 00 A5 FF 7E 5A FF FF 06 02 00 F7"]),
    ],
)
def test_one_unit_or_all(kit: Bioloid, wire: Talk, word: str, amount: float | None, answer: list[str]) -> None:
    kit.faults.start(word, 6, amount=amount)
    assert wire.raw(PING6) == answer
    assert wire.raw(PING7) == [PONG7]
    kit.faults.stop(word, 6)
    assert wire.raw(PING6) == [PONG6]
    kit.faults.start(word, amount=amount)
    assert wire.raw(PING6) == answer
    assert wire.raw(PING7) != [PONG7]
    kit.faults.stop()
    assert wire.raw(PING7) == [PONG7]


def test_a_silent_unit_still_obeys(kit: Bioloid, wire: Talk) -> None:
    kit.faults.start("silence", 6)
    assert wire.p1(6, "03 19 01") == ""
    assert kit[6].registers.get("led") == 1


def test_late_answers(kit: Bioloid) -> None:
    kit.faults.start("late", 6, amount=0.25)
    (answer,) = kit.feed(bytes.fromhex(PING6), 10.0)
    assert answer.at == 10.25
    (answer,) = kit.feed(bytes.fromhex(PING7), 11.0)
    assert answer.at == 11.0


def test_for_a_number_of_answers(kit: Bioloid, wire: Talk) -> None:
    kit.faults.start("checksum", 6, times=2)
    assert [wire.raw(PING6) == [PONG6] for _ in range(4)] == [False, False, True, True]


def test_faults_add_up(kit: Bioloid, wire: Talk) -> None:
    kit.faults.start("checksum", 6)
    kit.faults.start("noise", amount=1)
    assert wire.raw(PING6) == ["5A FF FF 06 02 00 08"]
    assert set(kit.faults) == {Fault("checksum", 6), Fault("noise", None, 1)}


def test_an_echo_comes_before_the_answer(kit: Bioloid, wire: Talk) -> None:
    kit.faults.start("echo")
    assert wire.raw(PING6) == [PING6, PONG6]
    assert wire.raw("00") == ["00"]
    kit.faults.stop("echo")
    assert wire.raw(PING6) == [PONG6]


def test_words_are_checked(kit: Bioloid) -> None:
    with pytest.raises(UnknownRequest, match="'explode'"):
        kit.faults.start("explode")
    with pytest.raises(UnknownRequest, match="whole bus"):
        kit.faults.start("echo", 6)
    with pytest.raises(UnknownRequest, match="times=0"):
        kit.faults.start("silence", times=0)


def test_a_power_cut_of_one_unit_or_all(kit: Bioloid, wire: Talk) -> None:
    wire.p1(6, "03 1E 00 03")
    kit.power_off(0.0, 6)
    assert (wire.raw(PING6), wire.raw(PING7)) == ([], [PONG7])
    kit.power_on(0.0, 6)
    assert wire.p1(6, "02 18 01") == "00 00"
    kit.power_off(0.0)
    assert (wire.raw(PING6), wire.raw(PING7)) == ([], [])
    kit.power_on(0.0)
    assert (wire.raw(PING6), wire.raw(PING7)) == ([PONG6], [PONG7])


def test_without_power_nothing_is_obeyed_and_everything_is_limp(kit: Bioloid, wire: Talk) -> None:
    wire.p1(6, "03 1E 00 03 64 00")
    kit.power_off(0.0)
    wire.p1(6, "03 19 01")
    kit.power_on(2.0)
    wire.now = 3.0
    assert wire.p1(6, "02 19 01") == "00 00"
    assert wire.p1(6, "02 24 02") == "00 00 02"
