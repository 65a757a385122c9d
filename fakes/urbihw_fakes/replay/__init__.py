"""A robot made of recorded traffic: it answers each request as the recorded robot did, with the same delays.

`capture` reads a capture with times (`urbihw trace --save`, `urbihw replay`), `framing` cuts what the host writes into
requests, `exchanges` tells which bytes came back on which, `answers` finds the recorded answer to a request, `device`
plays it, `node` on a CAN bus.

What it leaves out: it has no state of its own. A register that was never read after it was written keeps the recorded
value, and a request that the recording has nothing like stays without an answer.
"""

from urbihw_fakes.replay.capture import Capture, read_capture
from urbihw_fakes.replay.device import Replay

__all__ = ["Capture", "Replay", "read_capture"]
