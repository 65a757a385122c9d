"""Run in a network of its own (``unshare --net``): how soon a cut network is noticed, in s, on standard output."""

from __future__ import annotations

import subprocess
import time

from urbihw.buses import open_link
from urbihw.buses.errors import LinkGone
from urbihw.buses.messages import Configure, Targets
from urbihw.platforms.spykee.driver import SpykeeDriver
from urbihw_fakes.spykee.device import Spykee
from urbihw_fakes.spykee.endpoint import SpykeeEndpoint

LONGEST_S = 20.0


def main() -> None:
    """Let the robot drive, cut the network, and wait until the driver has missed it."""
    subprocess.run(("ip", "link", "set", "lo", "up"), check=True)
    with SpykeeEndpoint(Spykee()) as end:
        end.start()
        driver = SpykeeDriver()
        driver.configure(Configure())
        with open_link(end.url) as link:
            driver.attach(link)
            driver.targets(Targets({("trackL", "speed"): 50}))
            subprocess.run(("ip", "link", "set", "lo", "down"), check=True)
            cut = time.monotonic()
            try:
                while time.monotonic() < cut + LONGEST_S:
                    driver.tick(link.clock.now(), lambda: None)
                    time.sleep(0.01)
            except LinkGone:
                pass
            print(time.monotonic() - cut)


if __name__ == "__main__":
    main()
