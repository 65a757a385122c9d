"""What a bus worker and its parent tell each other. All of them are frozen and can cross a process border.

To the worker: Targets, Watch, Request, Stop, Alive, Configure.
From the worker: Found, Samples, DeviceState, LinkState, Reply, Refused, Stopped, Statistics, Ended.

Values are raw counts (`urbihw.buses.dynamixel.units` turns them into SI and back); items are names of the control
tables; times are seconds of the machine's monotonic clock (`time.monotonic()`), the same in all processes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True, slots=True)
class Targets:
    """New values to write, by (device, item). Send only what is to be written: every entry is an act.

    All targets that arrive before a tick go out together at that tick; of two for one item the later wins. A target
    that a device already has is not sent again. A target for a device that is lost, or sent while the link is down,
    is forgotten: a robot never moves by itself because a plug went back in.
    """

    values: Mapping[tuple[int, str], int]


@dataclass(frozen=True, slots=True)
class Watch:
    """Read `items` of a device every `period` seconds (0: every tick) from now on; None: no more.

    A watch lasts until it is replaced, also while the device is lost and while the link is down.
    """

    device: int
    items: tuple[str, ...]
    period: float | None = 0.0


Verb = Literal["read", "write", "ping", "reboot", "scan"]


@dataclass(frozen=True, slots=True)
class Request:
    """Something to do once, behind the next tick; a `Reply` with the same `reply_id` answers it.

    "read" gives the value of `item`, "write" writes `value` and waits for the confirmation, "ping" gives the model
    number, "reboot" restarts a protocol 2.0 device, "scan" looks for devices on all ids (0.5 s, in which the cycle
    rests: not while the robot moves), posts `Found` and gives the number of devices.
    """

    reply_id: int
    verb: Verb
    device: int = 0
    item: str = ""
    value: int = 0


@dataclass(frozen=True, slots=True)
class Stop:
    """Stop the robot now: wheels to speed 0, joints that we moved hold where they are. Later targets move it again."""


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
        protocol: 1, 2 or "auto"; read when the link opens.
        ids: devices to look for when the link opens, None for all.
        fast_read: use FAST SYNC READ where all devices of a group can do it.
    """

    rate: float = 100.0
    dead_man: float = 1.5
    torque_off_on_stop: bool = False
    protocol: Literal[1, 2, "auto"] = "auto"
    ids: tuple[int, ...] | None = None
    fast_read: bool = True


@dataclass(frozen=True, slots=True)
class DeviceInfo:
    """One device as found: `family` is its control table ("AX-12", ... or "" for an unknown model), `mode` a name."""

    id: int
    model: int
    name: str
    family: str
    firmware: int
    protocol: int
    mode: str


@dataclass(frozen=True, slots=True)
class Found:
    """The devices that are there, after a scan; `conflicts` are ids that several devices answer to."""

    devices: tuple[DeviceInfo, ...]
    conflicts: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Samples:
    """What one tick read.

    Attributes:
        time: when the tick's last answer was in.
        values: device -> item -> raw count. The item "state" comes with the lasting error bits of the answers when
            they change (`urbihw.buses.dynamixel.status.state_words` says them).
        times: device -> when its answer was in.
    """

    time: float
    values: Mapping[int, Mapping[str, int]]
    times: Mapping[int, float]


@dataclass(frozen=True, slots=True)
class DeviceState:
    """A device changed its state: "ok", "suspect", "lost" or "back" (which then becomes "ok").

    A device that comes back may have been without power: its RAM settings are then gone, so set them again.
    """

    device: int
    old: str
    new: str
    reason: str


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
    value: int | None = None
    error: str = ""


@dataclass(frozen=True, slots=True)
class Refused:
    """A target or a watch that makes no sense, and why; nothing was written for it."""

    device: int
    item: str
    reason: str


@dataclass(frozen=True, slots=True)
class Stopped:
    """The robot was brought to its safe stop, and why; all targets are forgotten."""

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


ToWorker = Targets | Watch | Request | Stop | Alive | Configure
FromWorker = Found | Samples | DeviceState | LinkState | Reply | Refused | Stopped | Statistics | Ended
