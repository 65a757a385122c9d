"""Some rows of the hostile list against a real server, judged by answers, not by times: see ``attack_lab``.

``python -m bench.hostile`` plays all of them, and measures.
"""

from __future__ import annotations

import pytest
from attack_lab import run
from attacks import ATTACKS, Attack

pytestmark = pytest.mark.e2e

MOST_OWED = 20
"""Answers that the neighbour may wait for when it asks again: a busy machine is asked as much as it can answer."""
SECONDS = 1.0
"""For which each attack goes on; the loop that never gives way needs more than the limit of the server."""


@pytest.mark.parametrize("attack", [one for one in ATTACKS if one.ci], ids=lambda one: one.name)
def test_an_attack_harms_nobody_else(attack: Attack) -> None:
    outcome = run(attack, SECONDS, MOST_OWED)
    assert outcome.faults(attack) == [], outcome


def test_names_are_unique() -> None:
    names = [attack.name for attack in ATTACKS]
    assert sorted(set(names)) == sorted(names)
