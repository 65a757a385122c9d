"""The SO-100 and SO-101 arms of LeRobot: six Feetech STS3215 on one bus, as a follower, with or without a leader arm.

Reading order: ``platform.toml`` (what the daemon knows without importing this), ``urbihw.platforms.servos`` (servos as
objects), ``arm`` (the joints and the gripper's limits), ``robot`` (the object ``so101``), ``leader`` (the second arm),
``so101.u`` (the tree of the standard robot API).
"""
