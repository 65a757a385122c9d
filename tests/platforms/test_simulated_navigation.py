"""The bench of navigation, in short, with a body in MuJoCo: a Pioneer finds its goals though its wheels slip."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2]))

pytest.importorskip("mujoco", reason="simulated worlds need the extra mujoco")

from bench.hall import START, Hall
from bench.hall_body import HallBody
from bench.trial import Trial


def test_a_robot_with_a_body_reaches_its_goals_in_the_hall_and_touches_nothing(tmp_path: Path) -> None:
    hall = Hall(1)
    trial = Trial(hall, tmp_path, with_body=True)
    runs = [trial.drive(goal) for goal in ((5.0, 3.0, 0.0), (9.5, 6.0, 1.5))]
    assert [each.reached for each in runs] == [True, True]
    assert all(each.metres < 0.1 and each.degrees < 6 for each in runs)
    assert sum(each.contacts for each in runs) == 0
    assert max(max(each.errors) for each in runs) < 0.15
    # The wheels slip: what they counted is not where it is.
    body = trial.lab.kit.body
    assert body.odometry[:2] != pytest.approx(trial.lab.where()[:2], abs=1e-3)


def test_a_contact_of_the_body_is_counted_once(tmp_path: Path) -> None:
    hall = Hall(1)
    body = HallBody(hall, tmp_path)
    body.advance(1.0)
    assert body.contacts == 0
    # Into the wall on the left, and held there.
    body.set_pose(0.2, START[1], 0.0)
    body.advance(1.5)
    assert body.contacts == 1
