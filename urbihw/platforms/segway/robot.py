"""The object ``segway``: the base on its wire, with the RMPs that show it, and what stops it.

The base is stopped when the kernel has not been heard of for DEAD_MAN seconds, when the connection that drove it
closes, when the link or the base is lost, and when the daemon ends.  None of that needs a script's help.
"""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import BadConfig, NotReady, Opened, Origin, RobotSettings, event, function, reading
from urbihw.platforms.base import Limited, WiredRobot
from urbihw.platforms.segway.driver import BASE, FASTEST, SLOWEST
from urbihw.platforms.segway.options import Options
from urbihw.platforms.segway.rmp import RMP

DEAD_MAN: Final = 0.4
"""Seconds of silence of the kernel at most until the base is stopped: as long as a base waits by itself."""
ALIVE: Final = 0.1
"""Seconds between signs of life."""
SHORTEST: Final = 1 / FASTEST
"""Seconds between two readings at least; the base's own cycle takes half of that."""
LONGEST: Final = 60.0
TREE: Final = "rmp.u"
"""Builds the standard robot API, when the base is there."""


class Segway(WiredRobot):
    """A Segway RMP."""

    classes = (RMP,)

    robot_name = "segway"
    family = "urbihw.platforms.segway.driver:RmpDriver"

    model = reading("200")
    build = reading(0.0)
    state = reading("lost")
    lost = event()
    back = event()
    restarted = event()
    refused = event()

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.settings: dict[str, int] = {}
        self._members: weakref.WeakSet[RMP] = weakref.WeakSet()
        self._wanted: RobotSettings
        self._raw: dict[str, int] = {}
        self._built = False

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """See ``Robot``."""
        self._wanted = _safe(settings)
        super().open(self._wanted, opened)
        self.model.sense(Options.of(settings.options).model)
        self.wire.watch(BASE, (), 1 / self._wanted.rate)
        self.set_timer(ALIVE, self._say_alive)

    def configure(self, settings: RobotSettings) -> None:
        """See ``Robot``; the rate stays what the RMPs asked for."""
        self._wanted = replace(_safe(settings), rate=self._wanted.rate)
        super().configure(self._wanted)

    def status(self) -> str:
        """See ``Robot``."""
        if not self.link.sensed:
            return "link down"
        if self.state.sensed != "ok":
            return "base lost"
        volts = f", {self._raw['battery'] / 4:.0f} V" if "battery" in self._raw else ""
        return f"RMP {self.model.sensed}{volts}" + self.rate_words()

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def join(self, rmp: RMP, period: float) -> None:
        """Let an RMP show this base, every ``period`` s; commands go out as often as the quickest RMP wants, within
        20 to 50 ms."""
        if not 0 < period <= LONGEST:
            raise ValueError(f"period is in seconds, {SHORTEST:g} to {LONGEST:g}")
        rmp.attach(self, max(period, SHORTEST))
        self._members.add(rmp)
        rmp.changed_state(str(self.state.sensed))
        self._pace(min(float(member.period.sensed) for member in self._members))
        if self._raw and self.state.sensed == "ok":
            rmp.take(self._raw, self.host.now())

    @function
    def shutdown(self) -> None:
        """Switch the base off; one that balances falls."""
        self.wire.ask("shutdown", BASE, lambda reply: None if reply.ok else self._refuse("shutdown", reply.error))

    # ---------------------------------------------------------------- what an RMP calls

    def aim(self, item: str, counts: int, origin: Origin) -> None:
        """Send a speed with the next command."""
        self.wire.aim(BASE, item, counts, origin)

    def order(self, slot: str, name: str, parameter: int) -> None:
        """Configure the base; what it does not take is said."""

        def done(reply: m.Reply) -> None:
            if not reply.ok:
                self._refuse(slot, reply.error)
            elif name not in ("reset", "mode"):
                self.settings[name] = parameter
            for rmp in self._members:
                rmp.configured()

        self.wire.write(BASE, name, parameter, done, self.motion.origin())

    def _refuse(self, slot: str, reason: str) -> None:
        self.log.warning("%s: not done: %s", slot, reason)
        self.refused.emit(slot, reason)

    # ---------------------------------------------------------------- the worker

    def _pace(self, period: float) -> None:
        rate = min(max(1 / period, SLOWEST), FASTEST)
        if rate != self._wanted.rate:
            self._wanted = replace(self._wanted, rate=rate)
            super().configure(self._wanted)
        self.wire.watch(BASE, (), period)

    def limited_devices(self) -> Mapping[str, Limited]:
        """See ``WiredRobot``: the base, shown by the RMP that was made first."""
        first = min(self._members, key=lambda rmp: rmp.unique_name, default=None)
        return {} if first is None else {BASE: first}

    def on_found(self, message: m.Found) -> None:
        """See ``WiredRobot``."""
        (info,) = message.devices
        self.build.sense(float(info.build))
        if info.old:
            self.log.warning("the firmware of the base is old: it tells neither mode nor torques nor faults")
        self._changed("ok")
        if not self._built:
            self._built = True
            path = Path(__file__).with_name(TREE)
            self.host.run(path.read_text("latin-1"), str(path), self._has_tree)

    def _has_tree(self, problem: str) -> None:
        self.send_limits()
        self.answer(BadConfig(problem) if problem else None)

    def on_samples(self, message: m.Samples) -> None:
        """See ``WiredRobot``."""
        self._raw = dict(message.values[BASE])
        stamp = message.times[BASE] + self.offset
        for rmp in self._members:
            rmp.offer(self._raw, stamp)

    def whole(self) -> bool:
        """See ``WiredRobot``; the tree answers."""
        return False

    def on_happened(self, message: m.Happened) -> None:
        """See ``WiredRobot``; a base that was off in between has forgotten its settings, which it gets again."""
        if message.what != "restarted":
            self.log.warning("another program on the bus commands this base too; end it, or the base jerks")
            return
        self.log.warning("the base was switched off and on; it gets its settings again")
        for name, parameter in self.settings.items():
            self.order(name, name, parameter)
        self.restarted.emit()

    def on_device_state(self, message: m.DeviceState) -> None:
        """See ``WiredRobot``."""
        if message.new == "lost":
            if self.opening:
                self.answer(NotReady(_nobody(self.url.sensed, message.reason)))
                return
            self.log.warning("the base is lost: %s; its motion is zero until it is driven again", message.reason)
            self._changed("lost")
            self.lost.emit(message.reason)
        elif message.new == "back":
            self.log.warning("the base is back")
            self._changed("ok")
            self.back.emit()

    def on_link_down(self, reason: str) -> None:
        """See ``WiredRobot``."""
        self._changed("lost")

    def _changed(self, state: str) -> None:
        self.state.sense(state)
        for rmp in self._members:
            rmp.changed_state(state)


def _safe(settings: RobotSettings) -> RobotSettings:
    """The settings within what this robot allows: never without a dead man, never faster or slower than it likes."""
    return replace(
        settings,
        rate=min(max(settings.rate, SLOWEST), FASTEST),
        dead_man=min(settings.dead_man or DEAD_MAN, DEAD_MAN),
    )


def _nobody(url: str, reason: str) -> str:
    if reason != "it says nothing":
        return f"no RMP on {url}: {reason}"
    return (
        f"no RMP on {url}: is it switched on, are its plugs in, is this its speed (USB ?baud=460800, CAN 500 kbit/s)?"
    )
