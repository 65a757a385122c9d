"""The gripper of a Pioneer: two paddles and a lift, driven by the controller itself.

It has no positions: the controller drives a paddle or the lift until its end switch, and its state tells the ends.
Sources: the ARCOS chapter of the Pioneer 3 manual, ARIA (``ArGripper``).
"""

from __future__ import annotations

import math
from functools import partial
from typing import Final, Protocol

from urbihw.kernel.uobject import EffectorDevice, Motion, Origin, UVar, function, number, owned, reading, set_range
from urbihw.platforms.p3dx import words
from urbihw.platforms.p3dx.commands import (
    CLOSE,
    DEPLOY,
    DOWN,
    GRIPPER,
    HALT,
    HALT_LIFT,
    HALT_PADDLES,
    OPEN,
    STORE,
    UP,
)

_ENDS: Final = {1: 1.0, 2: 0.0}
"""State bits of the paddles (and, four bits higher, of the lift): at the upper or the lower end."""
_MOVING: Final = 4


class Hands(Protocol):
    """The interface of the robot for its gripper."""

    motion: Motion

    def order_gripper(self, code: int, origin: Origin) -> None:
        """Send an action; raises ValueError while the link is down."""
        ...


class Gripper(EffectorDevice):
    """The gripper: ``val`` is 1 open and 0 closed, ``lift`` 1 up and 0 down, 0.5 between, nan while unknown.

    Writing them moves the paddles or the lift to that end; 0.5 stops them where they are.
    """

    slot_words = words.GRIPPER

    uname = "P3dxGripper"

    val = owned(math.nan)
    lift = owned(math.nan)
    moving = reading(False)

    def init(self, robot: Hands) -> None:
        """Nothing moves before the first write."""
        self._robot = robot
        for var, actions in ((self.val, (CLOSE, HALT_PADDLES, OPEN)), (self.lift, (DOWN, HALT_LIFT, UP))):
            set_range(var, 0.0, 1.0)
            self.guard(robot.motion, GRIPPER, var)
            self.notify_change(var, partial(self._order_end, var, actions))

    @function
    def store(self) -> None:
        """Close the paddles and raise the lift, for driving."""
        self._send(STORE)

    @function
    def deploy(self) -> None:
        """Lower the lift and open the paddles, ready to take something."""
        self._send(DEPLOY)

    @function
    def halt(self) -> None:
        """Stop the paddles and the lift where they are."""
        self._send(HALT)

    def show_state(self, state: int, stamp: float) -> None:
        """Show the byte GRIP_STATE of a SIP."""
        for var, bits in ((self.val, state & 15), (self.lift, state >> 4)):
            var.sense(_ENDS.get(bits & 3, 0.5), stamp)
        self.moving.sense(bool((state | state >> 4) & _MOVING), stamp)

    def forget_state(self) -> None:
        """The link is down: nothing is known."""
        self.val.sense(math.nan)
        self.lift.sense(math.nan)
        self.moving.sense(False)

    def _order_end(self, var: UVar, actions: tuple[int, int, int]) -> None:
        self._send(actions[round(2 * number(var))])

    def _send(self, code: int) -> None:
        self._robot.order_gripper(code, self._robot.motion.admit(GRIPPER))
