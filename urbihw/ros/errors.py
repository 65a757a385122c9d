"""What can go wrong with ROS; the message of each error is one line for the user."""

from __future__ import annotations


class RosError(Exception):
    """Something that ROS refuses or that cannot be done."""


class NoMaster(RosError):
    """The master does not answer."""


class PeerError(RosError):
    """Another node has said something wrong, or has refused us."""


class RosNameTaken(RosError):
    """Another node has taken the name of this one: it is of no use to try again."""


class MessageError(RosError):
    """A message that does not have the form of its type; the text names the field."""
