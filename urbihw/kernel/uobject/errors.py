"""Failures that device code reports to the daemon: the class states the kind of failure, the daemon decides how to
react.

::

    DeviceError
      NotReady    temporary: a later attempt may succeed (port missing, robot switched off)
      BadConfig   permanent until the user changes something: bad option, two devices with one id (also a ValueError)
      Gone        the robot was connected and is lost (also a ConnectionError)

Every message is one line that says what happened, where, and what to do about it.
"""

from __future__ import annotations


class DeviceError(Exception):
    """Base of the failures that device code reports."""


class NotReady(DeviceError):
    """The robot cannot be reached now; a later attempt may succeed."""


class BadConfig(DeviceError, ValueError):
    """The robot cannot work with the present configuration; the user has to change it."""


class Gone(DeviceError, ConnectionError):
    """The connection to the robot is lost."""
