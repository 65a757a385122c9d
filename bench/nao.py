"""Joints of a Nao: cycles a second that all joints get a goal in and are measured, and what the worker's half costs.

The simulated Nao runs in a thread of this process, so the share of the processor is that of the driver alone, by
`time.thread_time`; a cycle is one `setAngles` of 24 joints and one `getListData`, over loopback TCP.
"""

from __future__ import annotations

import math
import time

from urbihw import buses
from urbihw.buses.messages import Configure, Targets
from urbihw.platforms.nao.driver import NaoDriver
from urbihw_fakes.nao.device import Nao
from urbihw_fakes.nao.endpoint import NaoEndpoint

SECONDS = 5.0
RATES = (50.0, 100.0)
BUDGET = 0.25
"""Share of a processor at 100 cycles a second, at most."""


def measure(rate: float) -> tuple[float, float, float]:
    """Cycles a second, calls of setAngles a second, share of a processor."""
    robot = Nao()
    with NaoEndpoint(robot) as end:
        end.start()
        with buses.open(end.url) as port:
            driver = NaoDriver()
            driver.configure(Configure(rate=rate))
            driver.attach(port)
            names = [name for name in robot.body.joints if "Hand" not in name and name != "RHipYawPitch"]
            driver.targets(Targets({(name, "stiffness"): 1.0 for name in names}))
            begun, worked = time.monotonic(), time.thread_time()
            before, cycles = robot.motion.calls.get("setAngles", 0), 0
            while (now := time.monotonic()) < begun + SECONDS:
                driver.targets(Targets({(name, "angle"): 0.01 * math.sin(now) for name in names}))
                driver.tick(now, lambda: None)
                cycles += 1
                time.sleep(max(0.0, begun + cycles / rate - time.monotonic()))
            share = (time.thread_time() - worked) / SECONDS
            driver.detach()
        calls = robot.motion.calls["setAngles"] - before
    return cycles / SECONDS, calls / SECONDS, share


def main() -> None:
    """Print the figures beside their budgets."""
    for rate in RATES:
        cycles, calls, share = measure(rate)
        goals = calls * 24
        print(
            f"nao: {cycles:.0f} cycles/s (asked {rate:.0f}), {goals:.0f} joint goals/s, "
            f"{share:.0%} of a processor (budget {BUDGET * rate / 100:.0%})"
        )


if __name__ == "__main__":
    main()
