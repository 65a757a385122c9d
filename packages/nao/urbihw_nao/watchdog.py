#!/usr/bin/env python
"""Stops a Nao that has lost urbihw: a program for the robot itself, beside NAOqi.

NAOqi has no watchdog for its clients, so a robot goes on walking when the connection is lost.  This program registers
the service ``UrbihwWatchdog``.  urbihw calls its ``feed(seconds)`` all the time while something moves, and
``release()`` when nothing moves.  When the time of the last feed is over, the behaviours that urbihw has begun are
ended (``ALBehaviorManager.stopBehavior``; their names are in ALMemory), then the walk (``ALMotion.stopMove``), and
then, as soon as the robot stands, everything else that ALMotion does (``killAll``).  Nothing gets slack, and the fall
manager stays as it is.

It needs Python 2.7 or 3, and ``qi``; the robot has both.  It uses nothing else of urbihw, so that this file is enough.
"""

import argparse
import logging
import signal
import sys
import threading
import time

MYPY = False
if MYPY:  # Python 2 has no module typing
    from typing import Any

NAME = "UrbihwWatchdog"
VERSION = "2"
PERIOD_S = 0.02
"""Between two looks at the time."""
LONGEST_S = 10.0
"""What one feed may last at most."""
STAND_S = 3.0
"""How long a walk may need to end, before ``killAll`` ends it wherever its feet are."""
RETRY_S = 1.0
"""Between two attempts to reach NAOqi, which starts with the robot or is started again."""
BEGUN = "urbihw/begun"
"""The key of ALMemory under which urbihw keeps what it has begun: whether something moves, and names of behaviours."""
OFF, FED, STOPPING, STOPPED = "off", "fed", "stopping", "stopped"

log = logging.getLogger("urbihw-watchdog")


class NaoWatchdog(object):
    """Counts the time down; ``feed``, ``release`` and ``state`` may come from any thread.

    ``find_service`` gives a service of NAOqi by its name; without it behaviours are left running.
    """

    def __init__(self, motion, find_service=None):
        # type: (Any, Any) -> None
        self._motion = motion
        self._find_service = find_service
        self._lock = threading.Lock()
        self._state = OFF
        self._left = 0.0

    def feed(self, seconds):
        # type: (float) -> None
        """Stop the robot when this time is over without another feed.  Raises ValueError: 0 < seconds <= 10."""
        if not 0 < seconds <= LONGEST_S:
            raise ValueError("feed: give more than 0 and up to %g seconds, not %r" % (LONGEST_S, seconds))
        with self._lock:
            self._state, self._left = FED, float(seconds)

    def release(self):
        # type: () -> None
        """Nothing moves any more: count no longer."""
        with self._lock:
            self._state = OFF

    def state(self):
        # type: () -> str
        """One of off, fed, stopping, stopped."""
        return self._state

    def advance(self, elapsed):
        # type: (float) -> None
        """So many seconds have passed; called all the time, by one thread.

        Raises what ALMotion raises, and tries again with the next call.
        """
        with self._lock:
            self._left -= elapsed
            state, over = self._state, self._left <= 0
        if state == FED and over:
            log.warning("urbihw was not heard in time: the robot is stopped")
            # Behaviours first: they would begin another motion.
            self._stop_behaviors()
            self._motion.stopMove()
            self._change(FED, STOPPING)
        elif state == STOPPING and (over or not self._motion.moveIsActive()):
            self._motion.killAll()
            self._change(STOPPING, STOPPED)

    def _stop_behaviors(self):
        # type: () -> None
        """End what urbihw has begun.  The walk is ended whatever happens here."""
        if self._find_service is None:
            return
        try:
            _, names = self._find_service("ALMemory").getData(BEGUN)
            manager = self._find_service("ALBehaviorManager")
        except (RuntimeError, TypeError, ValueError) as error:
            log.info("no behaviours to end: %s", error)
            return
        for name in names:
            try:
                manager.stopBehavior(name)
            except RuntimeError as error:
                log.info("%s: %s", name, error)

    def _change(self, before, after):
        # type: (str, str) -> None
        """Go on to another state, unless urbihw was heard meanwhile."""
        with self._lock:
            if self._state == before and (before != FED or self._left <= 0):
                self._state, self._left = after, STAND_S


class WatchdogService(object):
    """What clients see of it: all that is public here."""

    def __init__(self, watchdog):
        # type: (NaoWatchdog) -> None
        self._watchdog = watchdog

    def feed(self, seconds):
        # type: (float) -> None
        self._watchdog.feed(seconds)

    def release(self):
        # type: () -> None
        self._watchdog.release()

    def state(self):
        # type: () -> str
        return self._watchdog.state()

    def version(self):
        # type: () -> str
        """Version of this program."""
        return VERSION


def serve(url, listen):
    # type: (str, str) -> None
    """Register the service, and watch until NAOqi is gone.  Raises RuntimeError, also where it cannot be reached."""
    import qi

    session = qi.Session()
    try:
        session.connect(url)
        session.listen(listen)
        watchdog = NaoWatchdog(session.service("ALMotion"), session.service)
        session.registerService(NAME, WatchdogService(watchdog))
        log.info("ready: NAOqi %s, service at %s", url, ", ".join(session.endpoints()))
        # Every clock of Python 2 can be set: a step backwards counts as one period, one ahead stops the robot.
        clock = getattr(time, "monotonic", time.time)
        before = clock()
        while session.isConnected():
            time.sleep(PERIOD_S)
            now = clock()
            elapsed, before = max(now - before, PERIOD_S), now
            try:
                watchdog.advance(elapsed)
            except RuntimeError as error:
                log.warning("ALMotion: %s", error)
    finally:
        session.close()
    raise RuntimeError("the connection is lost")


def main():
    # type: () -> None
    """Watch over the robot until the process ends."""
    parser = argparse.ArgumentParser(description="Stops a Nao that has lost urbihw.")
    parser.add_argument("--url", default="tcp://127.0.0.1:9559", help="NAOqi (%(default)s)")
    parser.add_argument("--listen", default="tcp://0.0.0.0:0", help="where urbihw reaches the service (%(default)s)")
    wanted = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(name)s: %(message)s")
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(0))
    while True:
        try:
            serve(wanted.url, wanted.listen)
        except RuntimeError as error:
            log.warning("NAOqi at %s: %s; another attempt in %g s", wanted.url, error, RETRY_S)
            time.sleep(RETRY_S)


if __name__ == "__main__":
    main()
