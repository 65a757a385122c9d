"""Latches that a worker gets from the one before it."""

from __future__ import annotations

from pathlib import Path

from urbihw.buses.authority import MotionAuthority


def test_latches_that_are_handed_over_are_kept_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "robot.estop"
    MotionAuthority(file=file, holders=[("uid 1", "anna")])
    assert MotionAuthority(file=file).holders == {"uid 1": "anna"}
    lost = MotionAuthority(file=tmp_path / "absent" / "robot.estop", holders=[("uid 1", "anna")])
    assert lost.latched == "anna"
    assert "is not kept in" in lost.unkept
