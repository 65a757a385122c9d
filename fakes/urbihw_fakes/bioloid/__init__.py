"""A simulated Robotis Bioloid: `kit` (the bus with its servos and sensors), `console` (what can be typed), `start`.

The units themselves are in `urbihw_fakes.dynamixel`.
"""

from urbihw_fakes.bioloid.kit import Bioloid

__all__ = ["Bioloid"]
