"""The toss mode of a CM-5 or CM-510, in which the controller passes bytes through between its serial line and the bus.

The controller must be in manage mode (MODE, then START); `t` and a carriage return select the toss mode. It ends when
the controller is switched off. The maker does not document it: the sources are users' accounts
(nsmoly/BioloidController README; barrystaes.blogspot.com, "Use the CM5 as USB2Dynamixel"), and the text of the answer
is not confirmed, so it is not evaluated. To servos on a wire without a controller the two bytes are no packet.
"""

from __future__ import annotations

from typing import Final

from urbihw.buses.link import Link

BAUD: Final = 57_600
"""Speed of the controller's serial line."""
_COMMAND: Final = b"t\r"
_ANSWER_S: Final = 0.3
"""Seconds in which the controller prints its answer."""
_BITS_PER_BYTE: Final = 10


def has_toss_speed(link: Link) -> bool:
    """Return whether a link has the speed of such a controller."""
    return abs(link.byte_time * BAUD / _BITS_PER_BYTE - 1) < 0.01


def request_toss_mode(link: Link) -> None:
    """Ask the controller for its toss mode, without waiting for the text that it answers.  Raises LinkGone."""
    link.discard()
    link.write(_COMMAND)


def enter_toss_mode(link: Link) -> None:
    """Ask the controller for its toss mode, and discard the text that it answers.  Raises LinkGone."""
    request_toss_mode(link)
    deadline = link.clock.now() + _ANSWER_S
    while link.read(256, deadline):
        pass
