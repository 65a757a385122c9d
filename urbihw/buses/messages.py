"""What a bus worker and its parent tell each other. All of them are frozen and can cross a process border.

To the worker: Begin first; then Targets, Watch, Request, Stop, EmergencyStop, Release, Limits, Alive, Configure.
From the worker: Found, Samples, Happened, DeviceState, LinkState, Reply, Refused, Limited, Guarded, Stopped,
Latched, Statistics, Pulse, Ended.  From who supervises it: WorkerState.

They are the same for every family of wires; what a device is called (a number, a name, a port), which items it has,
and which verbs it takes is for the family's driver to say. Values are raw counts, turned into SI and back by those who
know the device; times are seconds of the machine's monotonic clock (`time.monotonic()`), the same in all processes.
All that is in a message can be pickled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Targets:
    """New values to write, by (device, item). Send only what is to be written: every entry is an act.

    All targets that arrive before a tick go out together at that tick; of two for one item the later wins. A target
    that a device already has is not sent again. A target for a device that is lost, or sent while the link is down,
    is forgotten: a robot never moves by itself because a plug went back in.

    `epoch` is that of the robot's motion when they were written: those of an older one that would move it are dropped.
    `time` is when they were written, in seconds of the writer's clock: a movement is as fast as these say. `resumed`
    are those of a movement whose writer was held up: the device has not gone on meanwhile.
    """

    values: Mapping[tuple[Any, str], Any]
    epoch: int = 0
    time: float | None = None
    resumed: frozenset[tuple[Any, str]] = frozenset()


@dataclass(frozen=True, slots=True)
class Watch:
    """Read `items` of a device every `period` seconds (0: every tick) from now on; None: no more.

    A watch lasts until it is replaced, also while the device is lost and while the link is down.
    """

    device: Any
    items: tuple[str, ...]
    period: float | None = 0.0


@dataclass(frozen=True, slots=True)
class Request:
    """Something to do once, behind the next tick; a `Reply` with the same `reply_id` answers it.

    Every family has the verbs "read", which gives the value of `item`, and "write", which writes `value` and waits for
    the confirmation where there is one; its driver lists the others. `epoch`: as `Targets.epoch`; a request that may
    move the robot and is older, or comes while an emergency stop holds, is answered by an error.
    """

    reply_id: int
    verb: str
    device: Any = 0
    item: str = ""
    value: Any = 0
    epoch: int = 0


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop the robot now: wheels to speed 0, joints that we moved hold where they are. Later targets move it again.

    Attributes:
        epoch: of the robot's motion from now on.
        reason: for the log and for those whose motion ends.
        devices: stop only these, in the same epoch; None for all.
    """

    epoch: int = 0
    reason: str = "asked to stop"
    devices: tuple[Any, ...] | None = None


@dataclass(frozen=True, slots=True)
class EmergencyStop:
    """Stop the robot now, and let nothing move it until `Release`. `who` asked."""

    who: str


@dataclass(frozen=True, slots=True)
class Release:
    """End an emergency stop; nothing moves by that. `who` asked."""

    who: str


@dataclass(frozen=True, slots=True)
class Limit:
    """What a target may be, in raw counts: from `low` to `high`, changing by `rate` a second at most.

    `name` tells the user which setting that is.
    """

    low: float = -math.inf
    high: float = math.inf
    rate: float = math.inf
    name: str = ""


@dataclass(frozen=True, slots=True)
class Threshold:
    """What to do when a measured item goes too far; all in raw counts.

    Attributes:
        device, item: what is measured.
        level: from which it is too much; `above` False: below which it is too little.
        hysteresis: how far back the value must be until the threshold is left again.
        targets, restored: (item, value) to set when it is passed, and when it is left.
        holds: nothing may move the device meanwhile.
        name: tells the user which setting that is.
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


@dataclass(frozen=True, slots=True)
class Limits:
    """The limits of all targets that have any, by (device, item), and all thresholds; replaces those before."""

    table: Mapping[tuple[Any, str], Limit]
    thresholds: tuple[Threshold, ...] = ()


@dataclass(frozen=True, slots=True)
class Alive:
    """The master lives. Send it from the main loop every 0.5 s; any other message counts as one too."""


@dataclass(frozen=True, slots=True)
class Configure:
    """All settings of a worker; sending another one replaces them.

    Attributes:
        rate: ticks a second.
        dead_man: seconds of silence of the parent after which the robot is stopped; 0 for never.
        torque_off_on_stop: every stop also switches the motors off: the robot falls.
        resume: a movement that goes on while its device or the link is lost is taken up again on return.
        options: what else the family knows, by name.
    """

    rate: float = 100.0
    dead_man: float = 1.5
    torque_off_on_stop: bool = False
    resume: bool = True
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Begin:
    """What a worker is born with: always the first message.

    Attributes:
        settings: as later `Configure` messages bring them.
        epoch: of the robot's motion.
        control: path of the control socket to listen at, "" for none.
        instead: why it takes the place of another worker, "" if it does not.
        devices: what the last worker found; they are looked for first.
        watches: what is to be read from the first tick on.
    """

    settings: Configure
    epoch: int = 0
    control: str = ""
    instead: str = ""
    devices: tuple[Any, ...] = ()
    watches: tuple[Watch, ...] = ()


@dataclass(frozen=True, slots=True)
class Found:
    """The devices that are there, each as its family describes one; `conflicts` are ids that several answer to."""

    devices: tuple[Any, ...]
    conflicts: tuple[Any, ...] = ()


@dataclass(frozen=True, slots=True)
class Samples:
    """What one tick read.

    Attributes:
        time: when the tick's last answer was in.
        values: device -> item -> raw count.
        times: device -> when its answer was in.
    """

    time: float
    values: Mapping[Any, Mapping[str, Any]]
    times: Mapping[Any, float]


@dataclass(frozen=True, slots=True)
class DeviceState:
    """A device changed its state: "ok", "suspect", "lost" or "back" (which then becomes "ok").

    A device that comes back may have been without power: its RAM settings are then gone, so set them again.
    """

    device: Any
    old: str
    new: str
    reason: str


@dataclass(frozen=True, slots=True)
class Happened:
    """A device reports something that is no value: a button, a fault, a text; `what` is a name of the family's."""

    device: Any
    what: str
    value: Any = None


@dataclass(frozen=True, slots=True)
class LinkState:
    """The link came up, or went down and why."""

    up: bool
    reason: str = ""


@dataclass(frozen=True, slots=True)
class Reply:
    """The outcome of a `Request`: a value, or an error in words."""

    reply_id: int
    ok: bool
    value: Any = None
    error: str = ""


@dataclass(frozen=True, slots=True)
class Refused:
    """A target or a watch that makes no sense, and why; nothing was written for it."""

    device: Any
    item: str
    reason: str


@dataclass(frozen=True, slots=True)
class Limited:
    """A limit made something else of a target, or (`limit` is "") does so no more; values are raw counts."""

    device: Any
    item: str
    requested: float
    applied: float
    limit: str


@dataclass(frozen=True, slots=True)
class Guarded:
    """A threshold was passed, or (`passed` False) left again, at a raw value; `holds`: as `Threshold.holds`."""

    device: Any
    name: str
    item: str
    value: float
    passed: bool
    holds: bool = False


@dataclass(frozen=True, slots=True)
class Stopped:
    """The robot was brought to its safe stop, and why; all targets are forgotten.

    `epoch` is that of its motion from now on; `devices` are the only ones that were stopped, None for all.
    """

    reason: str
    epoch: int = 0
    devices: tuple[Any, ...] | None = None


@dataclass(frozen=True, slots=True)
class Latched:
    """An emergency stop holds from now on, and why; `reason` "": it was released, by `who`."""

    reason: str
    who: str = ""


@dataclass(frozen=True, slots=True)
class Pulse:
    """The worker lives; it will be heard of again within `allowance` seconds."""

    allowance: float


@dataclass(frozen=True, slots=True)
class WorkerState:
    """Who supervises the worker has seen that it is silent, was replaced, or (`reason` "") answers again."""

    reason: str


@dataclass(frozen=True, slots=True)
class Statistics:
    """How the last second went.

    Attributes:
        time: end of that second.
        rate: ticks a second.
        late: ticks that were skipped because the one before took too long.
        errors: by kind ("timeouts", "damaged", "refused", "retried"); kinds without any are left out.
        load: share of the second in which the wire was busy, 0..1.
        dropped: Samples merged into later ones because the parent did not read.
    """

    time: float
    rate: float
    late: int
    errors: Mapping[str, int] = field(default_factory=dict)
    load: float = 0.0
    dropped: int = 0


@dataclass(frozen=True, slots=True)
class Ended:
    """The worker is gone; `reason` is "" when it was asked to go. Always its last message."""

    reason: str = ""


ToWorker = Targets | Watch | Request | Stop | EmergencyStop | Release | Limits | Alive | Configure
FromWorker = (
    Found
    | Samples
    | Happened
    | DeviceState
    | LinkState
    | Reply
    | Refused
    | Limited
    | Guarded
    | Stopped
    | Latched
    | Statistics
    | Pulse
    | WorkerState
    | Ended
)
