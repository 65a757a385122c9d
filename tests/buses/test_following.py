"""What a shaft carries, as its follower learns it from positions and goals."""

from __future__ import annotations

from urbihw.buses.servos.following import ServoFollower

TICK = 0.02
LAG, FULL = 0.1, 100.0


def test_a_stop_does_not_move_a_joint_by_what_it_carried_before() -> None:
    """A movement against a weight at a kept speed, then one whose speed nothing keeps; the joint stands at its goal."""
    follower, now, place = ServoFollower(LAG, FULL), 0.0, 0.0
    for _ in range(60):
        follower.reach(place, 0.0, 200.0)
        follower.add_reading(place, now, place + 40)
        now, place = now + TICK, place + 0.5
    assert follower.carried > 30
    goal = place + 60
    for _ in range(60):
        now, place = now + TICK, min(place + 2, goal - 1)
        follower.add_reading(place, now, goal)
    assert follower.rest(place, goal) == goal
