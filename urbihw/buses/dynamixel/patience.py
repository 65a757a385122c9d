"""How long to wait for an answer: learnt from the answers that came.

The wire time of an answer is known; what the adapter, the driver and the servo add is not (0.1 ms to 16 ms). As TCP
does it, a smoothed mean and deviation of that addition are kept, and the time-out is mean + 4 deviations. A fixed
time-out would either lose every answer of a slow adapter or make a silent servo cost 35 ms (dynamixel-sdk).
"""

from __future__ import annotations

_FIRST_GUESS = 0.020  # an FTDI adapter with its 16 ms latency timer must survive the first question
_FLOOR = 0.003  # below that, a busy computer makes healthy servos look silent
_CEILING = 0.050
# A delay is learnt at once and forgotten slowly: adapters and busy computers are late in bursts.
_LEARN = 1 / 4
_FORGET = 1 / 64


class Patience:
    """The time to allow beyond the wire time, in seconds."""

    def __init__(self) -> None:
        self.allowance = _FIRST_GUESS
        self._mean = 0.0
        self._deviation = 0.0
        self._started = False

    @property
    def brief(self) -> float:
        """A shorter time for those who most likely stay silent: the usual delay and a margin, no room for bursts."""
        return min(self.allowance, 1.5 * self._mean + _FLOOR) if self._started else self.allowance

    def observe(self, delay: float) -> None:
        """Take in that an answer came `delay` seconds later than the wire alone needs."""
        if delay < 0:
            delay = 0.0
        if not self._started:
            self._started = True
            self._mean, self._deviation = delay, delay / 2
        else:
            error = delay - self._mean
            self._mean += error / 8
            surprise = (error if error > 0 else -error) - self._deviation
            self._deviation += surprise * (_LEARN if surprise > 0 else _FORGET)
        allowance = self._mean + 4 * self._deviation
        self.allowance = _FLOOR if allowance < _FLOOR else _CEILING if allowance > _CEILING else allowance
