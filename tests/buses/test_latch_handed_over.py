"""Latches that a worker gets from the one before it."""

from __future__ import annotations

from pathlib import Path

from urbihw.buses.authority import MOST_HOLDERS, MOST_SHARING, MotionAuthority


def test_latches_that_are_handed_over_are_kept_in_the_file(tmp_path: Path) -> None:
    file = tmp_path / "robot.estop"
    MotionAuthority(file=file, holders=[("uid 1", "anna")])
    assert MotionAuthority(file=file).holders == {"uid 1": "anna"}
    lost = MotionAuthority(file=tmp_path / "absent" / "robot.estop", holders=[("uid 1", "anna")])
    assert lost.latched == "anna"
    assert "is not kept in" in lost.unkept


def test_a_latch_that_users_share_outlives_the_worker_that_knew_them() -> None:
    """The next one does not know who they are: the release of a later one is not theirs."""
    before = MotionAuthority()
    for number in range(MOST_HOLDERS + 1):
        before.latch(f"name {number}", f"user {number}")
    after = MotionAuthority(holders=before.holders.items())
    after.latch("anna", "anna")
    held = dict(after.holders)
    assert not after.release("anna")
    assert after.holders == held
    assert after.release("anna", others=["others"])
    assert "others" not in after.holders


def test_the_file_keeps_the_shared_latch_beside_all_others(tmp_path: Path) -> None:
    file = tmp_path / "robot.estop"
    before = MotionAuthority(file=file)
    for number in range(MOST_HOLDERS + 1):
        before.latch(f"name {number}", f"user {number}")
    before.keep_latches()
    assert MotionAuthority(file=file).holders == before.holders


def test_those_beyond_the_users_who_are_known_to_share_a_latch_hold_it() -> None:
    authority = MotionAuthority()
    users = [f"user {number}" for number in range(MOST_HOLDERS + MOST_SHARING + 1)]
    for user in users:
        authority.latch("somebody", user)
    for user in users[:-1]:
        authority.release(user)
    assert authority.latched
