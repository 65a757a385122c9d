"""What device code tells the daemon: the kind of failure; what is done about it is the daemon's decision.

::

    DeviceError
      NotReady      not now, but perhaps later without anybody changing anything: port missing, robot switched off
      BadConfig     never, unless somebody changes something: bad option, two devices with one id  (also a ValueError)
      Gone          was there and is not any more                                               (also a ConnectionError)

Every message is one line that says what happened, where, and what to do about it.
"""

from __future__ import annotations


class DeviceError(Exception):
    """Base of the failures that device code reports."""


class NotReady(DeviceError):
    """The robot cannot be reached now; trying again later may help."""


class BadConfig(DeviceError, ValueError):
    """The robot cannot work as it is set up; somebody has to change something."""


class Gone(DeviceError, ConnectionError):
    """The robot was there and is gone."""
