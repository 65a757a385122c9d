"""The response time-out, estimated from measured delays.

The wire time of an answer is known; the delay that adapter, system driver and servo add is not (0.1 ms to 16 ms). As in
TCP, the estimator keeps a smoothed mean and deviation of that delay; the time-out is mean + 4 deviations. A fixed
time-out would either lose every answer of a slow adapter or make a silent servo cost 35 ms (dynamixel-sdk).
"""

from __future__ import annotations

_INITIAL_S = 0.020  # long enough for an FTDI adapter with its 16 ms latency timer
_MIN_S = 0.003  # below that, a busy computer makes healthy servos look silent
_MAX_S = 0.050
# The deviation rises quickly and falls slowly: the delays of adapters and busy computers come in bursts.
_RISE = 1 / 4
_FALL = 1 / 64


class ResponseTimeoutEstimator:
    """Estimates the time to allow beyond the wire time.

    Attributes:
        allowance: the present estimate, in seconds.
    """

    def __init__(self) -> None:
        self.allowance = _INITIAL_S
        self._mean = 0.0
        self._deviation = 0.0
        self._started = False

    @property
    def mean(self) -> float:
        """The smoothed delay in seconds, 0 before the first answer."""
        return self._mean

    @property
    def brief_allowance(self) -> float:
        """A shorter time-out for devices that are probably absent: mean delay and a margin, without room for bursts."""
        return min(self.allowance, 1.5 * self._mean + _MIN_S) if self._started else self.allowance

    def add_delay(self, delay: float) -> None:
        """Add a measurement: an answer came `delay` seconds later than its wire time."""
        if delay < 0:
            delay = 0.0
        if not self._started:
            self._started = True
            self._mean, self._deviation = delay, delay / 2
        else:
            error = delay - self._mean
            self._mean += error / 8
            surprise = (error if error > 0 else -error) - self._deviation
            self._deviation += surprise * (_RISE if surprise > 0 else _FALL)
        allowance = self._mean + 4 * self._deviation
        self.allowance = _MIN_S if allowance < _MIN_S else _MAX_S if allowance > _MAX_S else allowance
