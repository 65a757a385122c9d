"""The messages between a bus worker and its parent: frozen, and picklable for a pipe between processes.

To the worker: Begin first; then Targets, Writers, Unusable, Watch, Request, Stop, EmergencyStop, Release,
ReleaseKnown, Limits, Heartbeat, Configure.
From the worker: Found, GuestsGone, Differences, Samples, DeviceReport, DeviceState, LinkState, Reply, Refused, Limited,
ThresholdCrossed, Held, Stopped, Latched, Statistics, WorkerHeartbeat, Ended.  From the worker's supervisor:
WorkerState.

They are the same for all protocol families; the names of devices (a number, a name, a port), their items, and the verbs
of requests are defined by the driver of the family. Values are raw counts, converted to SI and back by the platform;
times are seconds of the machine's monotonic clock (`time.monotonic()`), which is the same in all processes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Any

from urbihw.frozen import frozen


@frozen
class Targets:
    """New values to write, by (device, item).

    All targets that arrive before a tick are sent together at that tick; of two for one item the later wins. A target
    that a device already has is not sent again. A target for a device that is lost, or that arrives while the link is
    down, is dropped: a robot must not begin to move because a plug was put back.

    `epoch` is the motion epoch in which they were written: targets of an older epoch that would move the robot are
    dropped. `time` is when they were written, in seconds of the writer's clock; the speed of a movement is computed
    from it. `resumed` are targets of a movement whose writer was held up: the device has stood still meanwhile.
    `rates` are the highest speeds of the movements that the targets belong to, in raw counts per second: the worker
    keeps them, however late and far ahead a target arrives. A target without one is a plain write. A driver gets the
    speeds of those targets that limits or movements bound, for a robot that can keep a speed by itself. `settings` are
    targets that no client has asked for by a guarded variable: one of them that would move the robot is refused.
    """

    values: Mapping[tuple[Any, str], Any]
    epoch: int = 0
    time: float | None = None
    resumed: frozenset[tuple[Any, str]] = frozenset()
    rates: Mapping[tuple[Any, str], float] = field(default_factory=dict)
    settings: frozenset[tuple[Any, str]] = frozenset()


@frozen
class Watch:
    """Read `items` of a device every `period` seconds (0: every tick) from now on; None ends the reading.

    A watch lasts until it is replaced, also while the device is lost and while the link is down.
    """

    device: Any
    items: tuple[str, ...]
    period: float | None = 0.0


@frozen
class Request:
    """An operation to execute once, after the next tick; answered by a `Reply` with the same `reply_id`.

    Every family has the verbs "read", which returns the value of `item`, and "write", which writes `value` and waits
    for the confirmation where the protocol has one; the driver lists the others. `epoch`: as `Targets.epoch`; a request
    of an older epoch that may move the robot, or one during an emergency stop, is answered with an error; so is one
    that may move the robot and is a mere `setting`: as `Targets.settings`.
    """

    reply_id: int
    verb: str
    device: Any = 0
    item: str = ""
    value: Any = 0
    epoch: int = 0
    setting: bool = False


@frozen
class Stop:
    """Stop the robot now: wheels to speed 0, joints that we moved hold their position. Later targets move it again.

    Attributes:
        epoch: the motion epoch from now on.
        reason: for the log and for the programs whose motion ends.
        devices: stop only these, in the same epoch; None for all.
    """

    epoch: int = 0
    reason: str = "asked to stop"
    devices: tuple[Any, ...] | None = None


@frozen
class EmergencyStop:
    """Stop the robot now, and refuse all motion until `Release`.

    `who` asked for it, in words.  `user` is whose stop it is, whatever connection is used; with "" anybody may release
    it.  `order` is the number of the order among those of the parent (`Latched.order`).
    """

    who: str
    user: str = ""
    order: int = 0


@frozen
class Release:
    """End the emergency stop of a `user`, and those of the users or names in `others`, or all of them (`everyone`).

    The robot is free when no stop holds any more; this by itself moves nothing. `who` asked for it. `order`: as
    `EmergencyStop.order`.
    """

    who: str
    user: str = ""
    others: tuple[str, ...] = ()
    everyone: bool = False
    order: int = 0


@frozen
class Limit:
    """The limit of a target in raw counts: from `low` to `high`, changing by at most `rate` per second.

    `name` is the setting that it comes from, for messages; `rate_name` that of the rate, if it is another one.
    """

    low: float = -math.inf
    high: float = math.inf
    rate: float = math.inf
    name: str = ""
    rate_name: str = ""


@frozen
class Threshold:
    """A threshold of a measured item, and the reaction to crossing it; all in raw counts.

    Attributes:
        device, item: the measured quantity.
        level: the threshold is passed at or above this value; with `above` False at or below it.
        hysteresis: distance from `level` at which the threshold is left again.
        targets, restored: (item, value) to set when it is passed, and when it is left.
        holds: while it is passed, the device must not move.
        name: the setting that it comes from, for messages.
        advice: what lets a held device move again, in words.
    """

    device: Any
    item: str
    level: float
    name: str
    above: bool = True
    hysteresis: float = 0.0
    targets: tuple[tuple[str, Any], ...] = ()
    restored: tuple[tuple[str, Any], ...] = ()
    holds: bool = False
    advice: str = ""


@frozen
class Limits:
    """The limits of targets, by (device, item), and all thresholds; replaces the earlier ones."""

    table: Mapping[tuple[Any, str], Limit]
    thresholds: tuple[Threshold, ...] = ()


@frozen
class Heartbeat:
    """The heartbeat of the master. Send it from the main loop every 0.5 s; any other message counts as one too."""


@frozen
class ReleaseKnown:
    """The master knows of a release, its own or that of somebody else; one for each `Latched` with `freed`."""


@frozen
class Writers:
    """Who moves which device from now on: device -> name and address of the client; for `urbihw status` and the like.

    Sent before the targets when a device gets another writer, not with each of them.
    """

    names: Mapping[Any, str]


@frozen
class Unusable:
    """The parent does not use a device, although it answers (another model has its id, say), or has lost a part of the
    robot that is on a wire of its own, as a laser is.  The health tells it.

    Attributes:
        device: which one.
        reason: why; "" when it is used again.
    """

    device: Any
    reason: str


@frozen
class ExpectedDevice:
    """A device that the settings expect: its id and name; `model` and `firmware` as text, "" for any."""

    id: int
    name: str
    model: str = ""
    firmware: str = ""


@frozen
class Configure:
    """All settings of a worker; sending another one replaces them.

    Attributes:
        rate: ticks per second.
        dead_man: seconds of silence of the parent after which the robot is stopped; 0 for never.
        torque_off_on_stop: every stop also switches the motors off: the robot falls.
        resume: a movement whose device or link was lost meanwhile continues on its return.
        options: settings of the protocol family, by name.
        expected: the devices that the settings expect; () if they expect none.
        realtime: a process of its own takes real-time scheduling when it begins, where the system allows it.
    """

    rate: float = 100.0
    dead_man: float = 1.5
    torque_off_on_stop: bool = False
    resume: bool = True
    options: Mapping[str, Any] = field(default_factory=dict)
    expected: tuple[ExpectedDevice, ...] = ()
    realtime: bool = False


@frozen
class Begin:
    """The initial state of a worker: always its first message.

    Attributes:
        settings: as in a `Configure` message.
        epoch: the motion epoch.
        control: path of the control socket to listen at, "" for none.
        instead: why it replaces another worker, "" if it does not.
        devices: the devices that the last worker found; they are searched first.
        watches: the watches from the first tick on.
        restarts: how many workers it has replaced.
        holders: who held the robot by emergency stops when the last worker ended: users and names.
        order: the number of the parent's last order (`Latched.order`): those before it are over.
    """

    settings: Configure
    epoch: int = 0
    control: str = ""
    instead: str = ""
    devices: tuple[Any, ...] = ()
    watches: tuple[Watch, ...] = ()
    restarts: int = 0
    holders: tuple[tuple[str, str], ...] = ()
    order: int = 0


@frozen
class Found:
    """The devices that were found, described as the family defines; `conflicts` are ids that several answer to."""

    devices: tuple[Any, ...]
    conflicts: tuple[Any, ...] = ()


@frozen
class Difference:
    """A device that is not as the settings expect it; `expected` and `found` are model and firmware in words.

    `found` is "" for a missing device, `name` and `expected` are "" for an unexpected one.
    """

    id: int
    name: str = ""
    expected: str = ""
    found: str = ""


@frozen
class GuestsGone:
    """Devices of another robot that was on the wire for a while: this one is back, and they are not looked for."""

    devices: tuple[Any, ...]


@frozen
class Differences:
    """What differs from the expected devices now: those that are missing, unexpected, of another model or firmware."""

    missing: tuple[Difference, ...] = ()
    unexpected: tuple[Difference, ...] = ()
    other: tuple[Difference, ...] = ()


@frozen
class Samples:
    """The values that one tick read.

    Attributes:
        time: arrival of the tick's last answer.
        values: device -> item -> raw count.
        times: device -> arrival of its answer.
    """

    time: float
    values: Mapping[Any, Mapping[str, Any]]
    times: Mapping[Any, float]


@frozen
class DeviceState:
    """A device changed its state: "ok", "suspect", "lost" or "back" (which then becomes "ok").

    A device that comes back may have been without power: its RAM settings are then gone, so set them again.
    """

    device: Any
    old: str
    new: str
    reason: str


@frozen
class DeviceReport:
    """A device reports an event: a button, a fault, a text; the names `what` are defined by the family."""

    device: Any
    what: str
    value: Any = None


@frozen
class LinkState:
    """The link came up, or went down for a `reason`; `mistake`: the url makes no sense, and trying again is no use."""

    up: bool
    reason: str = ""
    mistake: bool = False


@frozen
class Reply:
    """The outcome of a `Request`: a value, or an error text."""

    reply_id: int
    ok: bool
    value: Any = None
    error: str = ""


@frozen
class Refused:
    """A target or a watch was invalid, and why; nothing was written for it."""

    device: Any
    item: str
    reason: str


@frozen
class Limited:
    """A limit changed a target, or (`limit` is "") no longer does; values are raw counts."""

    device: Any
    item: str
    requested: float
    applied: float
    limit: str


@frozen
class ThresholdCrossed:
    """A threshold was passed, or (`passed` False) left again, at a raw value; `holds`: as `Threshold.holds`."""

    device: Any
    name: str
    item: str
    value: float
    passed: bool
    holds: bool = False


@frozen
class Held:
    """All devices that thresholds forbid to move, with the names of these and what helps.

    It is posted when `Limits` have been taken, and when a threshold that holds was passed or left.
    """

    devices: Mapping[Any, str]


@frozen
class Stopped:
    """The worker executed the safe stop, for a reason; all targets are dropped.

    `epoch` is the motion epoch from now on; `devices` are those that were stopped, None for all.
    """

    reason: str
    epoch: int = 0
    devices: tuple[Any, ...] | None = None


@frozen
class Latched:
    """Who holds the robot by an emergency stop from now on, in words; `reason` "": the robot is free.

    It answers each order of the parent, and tells each stop and release of others. One that was posted before the
    worker has got the last order of the parent is older than that order: `order` tells it.

    Attributes:
        who: who asked for this stop or release; "" if it changes nothing.
        holders: users and names of those who hold it.
        freed: names of those whose stops `who` has released.
        order: the number of the last `EmergencyStop` or `Release` of the parent that was executed.
    """

    reason: str
    who: str = ""
    holders: tuple[tuple[str, str], ...] = ()
    freed: tuple[str, ...] = ()
    order: int = 0


@frozen
class WorkerHeartbeat:
    """The heartbeat of the worker; the next one is due within `allowance` seconds."""

    allowance: float


@frozen
class WorkerState:
    """The supervisor reports that the worker is silent, was replaced, or (`reason` "") answers again."""

    reason: str


@frozen
class Statistics:
    """Statistics of the last second.

    Attributes:
        time: end of that second.
        rate: ticks per second.
        late: ticks that were missed because others took too long.
        errors: by kind ("timeouts", "damaged", "refused", "retried"): those that the driver counts.
        load: share of the second in which the wire was busy, 0..1.
        dropped: Samples merged into later ones because the parent did not read.
        wanted: ticks per second that the settings ask for.
        turnaround: mean time in s that a device takes to answer, without that of the bytes; 0 if unknown.
        held_up: share of the second in which the worker had something to do and no processor, 0..1.
        crowd: programs that want each processor of this machine, over the last minute; 0 if unknown.
    """

    time: float
    rate: float
    late: int
    errors: Mapping[str, int] = field(default_factory=dict)
    load: float = 0.0
    dropped: int = 0
    wanted: float = 0.0
    turnaround: float = 0.0
    held_up: float = 0.0
    crowd: float = 0.0

    @property
    def late_share(self) -> float:
        """The share of the ticks that were missed, 0..1."""
        return self.late / (self.late + self.rate) if self.late else 0.0


@frozen
class Ended:
    """The worker has ended; `reason` is "" when it was asked to end. Always its last message."""

    reason: str = ""


ToWorker = (
    Targets
    | Writers
    | Unusable
    | Watch
    | Request
    | Stop
    | EmergencyStop
    | Release
    | ReleaseKnown
    | Limits
    | Heartbeat
    | Configure
)
FromWorker = (
    Found
    | GuestsGone
    | Differences
    | Samples
    | DeviceReport
    | DeviceState
    | LinkState
    | Reply
    | Refused
    | Limited
    | ThresholdCrossed
    | Held
    | Stopped
    | Latched
    | Statistics
    | WorkerHeartbeat
    | WorkerState
    | Ended
)
