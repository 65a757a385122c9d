"""A simulated SO-101 arm: six STS3215 with ids 1 to 6 and an end stop for each joint, follower or leader.

Not covered: gravity, and the mechanics between the joints.
"""

from urbihw_fakes.so101.arm import JOINTS, So101

__all__ = ["JOINTS", "So101"]
