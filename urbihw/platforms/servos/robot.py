"""The base of the robots on a servo bus: tables of the devices found, their states, and what is missing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Final

from urbihw.buses import messages as m
from urbihw.buses.pace import Pace, PaceWatch
from urbihw.buses.servos import calibration
from urbihw.buses.servos.calibration import BadCalibration, JointCalibration
from urbihw.buses.servos.device import DeviceInfo
from urbihw.buses.servos.status import FEETECH
from urbihw.figure import Figure
from urbihw.figure.model import read
from urbihw.kernel.uobject import BadConfig, NotReady, Opened, RobotSettings, UObject, event, function, reading
from urbihw.platforms import expected
from urbihw.platforms.base import WiredRobot
from urbihw.platforms.devicelog import BACK, LOST, DeviceEvent
from urbihw.platforms.expected import DeviceSettings
from urbihw.platforms.hooks import LimitedDevice
from urbihw.platforms.servos import words
from urbihw.platforms.servos.devices import ServoBusDevice
from urbihw.platforms.servos.frame import JointFrame, frame_of
from urbihw.platforms.servos.growth import TreeGrowth
from urbihw.platforms.servos.missing import MissingDevices
from urbihw.platforms.servos.motors import ServoMotor
from urbihw.platforms.servos.options import CALIBRATION, FIGURE, for_driver
from urbihw.platforms.teach.motions import TaughtMotions
from urbihw.platforms.words import counted

_OF_ANOTHER: Final = "it belongs to another robot, which is gone"
LEFT: Final = DeviceEvent(
    "{who} belongs to another robot, which is gone: it is no longer looked for",
    "{count} devices belong to another robot, which is gone: they are no longer looked for: {who}",
    "left",
)
MISSING: Final = DeviceEvent(
    "no answer from {who}: it joins when it answers",
    "no answer from {count} devices, which join when they answer: {who}",
    "missing",
)
_MOST_NAMED: Final = 8
"""Devices that a message names; the others are counted."""
_STATUS_WORDS: Final = {"motor": "servo", "sensor": "sensor", "device": "other device"}
"""Kind of device -> its word in ``status``."""
_LIKE_PERIODS: Final = 0.05
"""Share by which the period of a bus must change before movements follow it."""
_SLOWEST_HZ: Final = 1.0
_OPTIONAL: Final = frozenset({"device"})
"""Kinds that ``status`` names only if there are some."""


class Devices(UObject):
    """The devices of one kind by number.

    Its functions belong to the instance, so that the library of a platform can make them slots of a Group such as
    ``motors``.
    """

    slot_words = words.TABLE

    uname = "ServoDevices"

    def init(self, what: str = "device") -> None:
        """``what`` is the word for one of them in messages."""
        self._what = what
        self.members: dict[int, ServoBusDevice] = {}
        self.bind_function(self.get, "[]")
        self.bind_function(self.has)
        self.bind_function(self.keys)
        self.bind_function(self.as_list, "asList")
        self.bind_function(self.size)
        self.bind_function(self.empty)

    def get(self, id: int) -> ServoBusDevice:
        """The device with this number."""
        if id not in self.members:
            known = ", ".join(map(str, sorted(self.members))) or "none"
            raise ValueError(f"no {self._what} {id}; there are: {known}")
        return self.members[id]

    def has(self, id: int) -> bool:
        """Whether there is a device with this number."""
        return id in self.members

    def keys(self) -> list[float]:
        """The numbers, in order."""
        return [float(number) for number in sorted(self.members)]

    def as_list(self) -> list[ServoBusDevice]:
        """The devices, in order of their numbers."""
        return [self.members[number] for number in sorted(self.members)]

    def size(self) -> int:
        """How many there are."""
        return len(self.members)

    def empty(self) -> bool:
        """Whether no servo is there."""
        return not self.members


def _conflict_text(number: int) -> str:
    """What several devices with one id are, and what helps."""
    return (f"several devices answer to id {number}: leave one on the bus, stop the daemon, and give it another id "
            "with urbihw servo set-id")


class ServoRobot(WiredRobot):
    """A robot on one servo bus.

    A subclass sets ``kinds`` and ``robot_name``, and implements ``class_of``.  Its library defines the function
    ``grow`` of the robot's slot, which is called when new devices were found: it makes the tree of ``robot`` from
    the tables ``motorTable`` and so on.
    """

    classes: ClassVar[tuple[type[UObject], ...]] = (Devices,)

    slot_words = words.BUS

    parts = (TaughtMotions,)

    family = "servos"

    kinds: ClassVar[tuple[str, ...]] = ("motor",)
    """The kinds of devices (``Device.kind_of_device``), each with a table of its own."""

    lost = event()
    back = event()
    found = event()
    refused = event()
    missing = reading([])

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self.motions = TaughtMotions(self, self.robot_name, self.motion, self.log, self.joint_position)
        self.devices: dict[int, ServoBusDevice] = {}
        self.tables: dict[str, Devices] = {}
        self._infos: dict[int, DeviceInfo] = {}
        self._missing = MissingDevices(self.log, self.missing.sense)
        self._growth = TreeGrowth(self._run_growth, self.found.emit, self._complain_of_growth)
        self._pace_watch = PaceWatch()
        self._period = 0.0
        """The `System.period` that was set last."""
        self._conflicts: tuple[int, ...] = ()
        self._named: dict[int, tuple[str, DeviceSettings]] = {}
        self._calibrated: dict[int, tuple[str, JointCalibration]] = {}

    def class_of(self, info: DeviceInfo) -> type[ServoBusDevice] | None:
        """Return the class for a device that was found, None to leave it alone; override."""
        raise NotImplementedError

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Make the tables of the devices, set the period of movements, then start the worker."""
        for kind in self.kinds:
            table = self.tables[kind] = self.host.create(Devices, None, kind)
            self.put_slot(f"{kind}Table", table)
        self.motions.use_folder(settings.motions)
        self._set_period(settings.rate)
        self._read_joints(settings)
        self._drawn = str(settings.options.get(FIGURE, ""))
        super().open(replace(settings, options=for_driver(settings.options)), opened)
        self._missing.open(settings.options.get("ids", ()))

    def configure(self, settings: RobotSettings) -> None:
        """Apply new settings, also the period of the movements.  Raises BadConfig."""
        super().configure(replace(settings, options=for_driver(settings.options)))
        self._drawn = str(settings.options.get(FIGURE, ""))
        self._set_period(settings.rate)
        self._missing.reload(settings.options.get("ids", ()), (each.id for each in self.expected))

    def figure(self) -> Figure | None:
        """Return the figure that the settings name, else that of the platform.  Raises BadFigure."""
        return read(Path(self._drawn)) if self._drawn else super().figure()

    def _read_joints(self, settings: RobotSettings) -> None:
        """Read names and frames of the joints from ``[devices]`` and the calibration file.  Raises BadConfig."""
        self._named = {row.id: (name, row) for name, row in expected.read(settings.devices).items()}
        path = settings.options.get(CALIBRATION, "")
        if not path:
            return
        try:
            joints = calibration.load(path)
        except BadCalibration as error:
            raise BadConfig(f"options.{CALIBRATION}: {error}") from error
        self._calibrated = {joint.id: (self._usable_name(name, joint.id), joint) for name, joint in joints.items()}

    def _usable_name(self, name: str, number: int) -> str:
        """Return the name of a joint of the calibration file, "" for one that would hide a slot."""
        mistake = "" if number in self._named else expected.mistake_in_name(name, number)
        if mistake:
            text = "the calibration names motor %d %s, which %s; it stays motor%d"
            self.log.warning(text, number, name, mistake, number)
        return "" if mistake else name

    @function("refuseName")
    def refuse_name(self, name: str, number: int) -> None:
        """Log that a joint keeps its number, because a program has a slot of Global of its name."""
        self.log.warning("motor %d is not %s: a program has given that name to something else", number, name)

    @function("refuseGroup")
    def refuse_group(self, name: str) -> None:
        """Log that a group of the settings is not made, because a program has a slot of Global of its name."""
        self.log.warning("there is no group %s: a program has given that name to something else", name)

    def _frame_of(self, info: DeviceInfo) -> JointFrame:
        place = ServoMotor.table_for(info).item("present_position")
        return frame_of(place, self._named.get(info.id), self._calibrated.get(info.id))

    def _set_period(self, rate: float) -> None:
        """With the default of 20 ms a movement would give a bus of 100 Hz a new goal in every second tick only."""
        self._period = 1 / rate
        self.host.run(f"System.period = {self._period!r};", f"{self.robot_name}.period")

    def on_statistics(self, message: m.Statistics) -> None:
        """Log why the rate is not kept; let movements follow the rate that the bus achieves."""
        if not message.wanted:
            return
        second = Pace(
            message.wanted, message.rate, message.late_share, message.load, message.turnaround, message.held_up,
            message.crowd,
        )
        if line := self._pace_watch.hear(second):
            self.log.warning("%s", line)
        self._follow_rate(message)

    def _follow_rate(self, message: m.Statistics) -> None:
        """Set the period of movements to that of the bus, unless a program has set one of its own."""
        period = 1 / message.wanted
        if message.rate < message.wanted / (1 + _LIKE_PERIODS):
            period = 1 / max(message.rate, _SLOWEST_HZ)
        if abs(period - self._period) > _LIKE_PERIODS * self._period:
            before, self._period = self._period, period
            text = f"if (System.period == {before!r}) System.period = {period!r};"
            self.host.run(text, f"{self.robot_name}.period")

    def summary(self) -> str:
        """Return the number of devices of each kind, the rate, and which are lost."""
        lost = [str(number) for number, device in self.devices.items() if device.state.sensed == "lost"]
        shown = [kind for kind, table in self.tables.items() if table.members or kind not in _OPTIONAL]
        parts = [counted(len(self.tables[kind].members), _STATUS_WORDS[kind]) for kind in shown]
        parts[-1] += self.worker.rate_words()
        return ", ".join(parts) + (f", lost: {' '.join(lost)}" if lost else "") + self._missing.words()

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def scan(self) -> None:
        """Look for devices on all ids; takes half a second, in which the cycle rests: not while the robot moves."""

        def done(reply: m.Reply) -> None:
            if not reply.ok:
                self.log.warning("scan failed: %s", reply.error)

        self.channel.send_request("scan", 0, done)

    def joint_position(self, number: int, position: float) -> float:
        """Return the position of a joint in its frame for one of its motor, from the middle, in rad."""
        servo = self.devices.get(number)
        return servo.frame.joint(position) if isinstance(servo, ServoMotor) else position

    @function("jointGroups")
    def joint_groups(self) -> list[list[Any]]:
        """The groups of the settings: the name and the joints of each, in order of their numbers."""
        groups: dict[str, list[ServoBusDevice]] = {}
        for _, device in sorted(self.devices.items()):
            for name in device.frame.groups if isinstance(device, ServoMotor) else ():
                groups.setdefault(name, []).append(device)
        return [[name, joints] for name, joints in groups.items()]

    # ---------------------------------------------------------------- the worker

    def on_samples(self, message: m.Samples) -> None:
        """Pass the values of each device to it."""
        offset, times, devices = self.offset, message.times, self.devices
        for number, values in message.values.items():
            device = devices.get(number)
            if device is not None and number not in self.channel.blocked:
                device.update_values(values, times[number] + offset)

    def is_complete(self) -> bool:
        """Return whether the tree is built and every device found has been read once."""
        devices = self.devices.values()
        return self._growth.is_complete and bool(devices) and all(device.is_complete for device in devices)

    def on_link_down(self, reason: str) -> None:
        """Mark all devices as stale."""
        for device in self.devices.values():
            device.link_changed(False)

    def signed_target(self, device: Any, item: str, raw: Any) -> float:
        """Return a raw target as a signed number: the speed of an AX wheel has its sign in a bit."""
        scale = self._wheel_scale(device, item)
        return float(raw) if scale is None else scale[0].speed_of(int(raw)) * scale[1]

    def raw_target(self, device: Any, item: str, signed: float) -> Any:
        scale = self._wheel_scale(device, item)
        return signed if scale is None else scale[0].speed_target(signed / scale[1], True)[1]

    def _wheel_scale(self, device: Any, item: str) -> tuple[ServoMotor, float] | None:
        """The servo, and its counts for 1 rad/s, of a target that is the speed of a wheel; None for others."""
        servo = self.devices.get(device)
        if not isinstance(servo, ServoMotor) or not servo.wheel.sensed:
            return None
        speed, scale = servo.wheel_scale()
        return (servo, scale) if item == speed else None

    # ---------------------------------------------------------------- devices

    def on_found(self, message: m.Found) -> None:
        """Report ID conflicts; make new devices, and restore those that are back."""
        for info in message.devices:
            device = self.devices.get(info.id)
            if device is None:
                self._add_device(info)
            elif self._has_known_registers(device, info):
                self.tables[device.kind_of_device].members[info.id] = device
                device.link_changed(True)
        self._growth.begin()
        url = self.arrival.url.sensed
        conflict = self._explain_conflicts(message.conflicts)
        foreign = [info for info in message.devices if self.class_of(info) is None]
        others = self._explain_foreign(foreign)
        if self.arrival.opening and len(foreign) == len(message.devices):
            self.arrival.answer(
                NotReady(
                    conflict
                    or others
                    or f"no servo found on {url}: is the robot switched on, are the cables plugged in, "
                    "is this its speed (?baud=1000000)? urbihw scan looks at all speeds"
                )
            )
            return
        if conflict:
            self.log.error("%s", conflict)
        if others:
            self.log.warning("%s", others)
        if self.arrival.opening:
            self.arrival.wait_for_readings()

    def on_gone(self, message: m.GuestsGone) -> None:
        """Take the devices of another robot out of the tables; a program that has one finds it lost."""
        for number in message.devices:
            device = self.devices.get(number)
            if device is not None:
                self.channel.blocked.pop(number, None)
                self.tables[device.kind_of_device].members.pop(number, None)
                device.changed_state("lost", _OF_ANOTHER)
                self.motion.set_absent(number, f"device {number} is lost: {_OF_ANOTHER}")
                self.log.log_event(LEFT, f"{device.kind_of_device} {number}")
                group = f"{self.robot_name}.{device.kind_of_device}s"
                self.host.run(f"{group}.remove({device.kind_of_device}{number});", group, self._on_left_group)
        self.report.show()

    def _on_left_group(self, problem: str) -> None:
        if problem:
            self.log.error("a device of another robot stays in its group: %s", problem)

    def has_own_limits(self) -> bool:
        """Joints may have a range by ``[devices]`` or by their calibration."""
        return any(device.frame.limit for device in self.devices.values() if isinstance(device, ServoMotor))

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the servos as ``motor1`` to ``motorN``."""
        return {f"motor{number}": each for number, each in self.devices.items() if isinstance(each, ServoMotor)}

    def joint_names(self) -> Mapping[str, str]:
        """Return the joints of the settings, or of the arm, by their names."""
        servos = ((number, each) for number, each in self.devices.items() if isinstance(each, ServoMotor))
        return {each.frame.name: f"motor{number}" for number, each in servos if each.frame.name}

    @function("jointOrder")
    def joint_order(self) -> list[ServoBusDevice]:
        """The servos in the order of the settings (``[devices]``), the others by their numbers."""
        order = [*self._named, *sorted(number for number in self.devices if number not in self._named)]
        return [self.devices[number] for number in order if number in self.devices]

    def on_threshold_crossed(self, message: m.ThresholdCrossed) -> None:
        """Also show the torque of a servo that a threshold has released as off."""
        device = self.devices.get(message.device)
        if message.holds and message.passed and isinstance(device, ServoMotor):
            device.mark_released()

    def _run_growth(self, done: Callable[[str], None]) -> None:
        grow = f"{self.robot_name}.grow"
        self.host.run(f"{grow};", grow, done)

    def _complain_of_growth(self, problem: str) -> None:
        self.log.error("the tree of the robot is not complete: %s", problem)

    def _explain_conflicts(self, ids: tuple[int, ...]) -> str:
        for number in {*self._conflicts, *ids}:
            self.worker.send(m.Unusable(number, _conflict_text(number) if number in ids else ""))
        self._conflicts = ids
        self.report.show()
        if not ids:
            return ""
        numbers = " and ".join(map(str, ids))
        return (
            f"several devices answer to id {numbers} on {self.arrival.url.sensed}: take all but one off the bus and "
            "give the others ids of their own"
        )

    def _explain_foreign(self, infos: Sequence[DeviceInfo]) -> str:
        """Return which devices are no part of such a robot, and the platforms that serve them; "" for none."""
        if not infos:
            return ""
        found = ", ".join(f"{info.name} (id {info.id})" for info in infos[:_MOST_NAMED])
        more = f" and {len(infos) - _MOST_NAMED} more" if len(infos) > _MOST_NAMED else ""
        feetech = any(info.protocol == FEETECH for info in infos)
        kits = "so101 for an SO-101 arm" if feetech else "bioloid for a Bioloid"
        return (
            f"{self.arrival.url.sensed} has {found}{more}, which {self.model_name} does not have; left alone: "
            f"use --platform {kits}, --platform chain for any servos"
        )

    def _add_device(self, info: DeviceInfo) -> None:
        made = self.class_of(info)
        if made is None:
            return
        joint = (self.motion, self._frame_of(info)) if issubclass(made, ServoMotor) else ()
        name = f"{made.kind_of_device}{info.id}"
        device = self.host.create(made, name, self.channel, info, self._report_refused, *joint)
        device.log, device.state_changed = self.log, self.report.show
        device.motion = self.motion
        if isinstance(device, ServoMotor):
            device.mode_changed = self.limits.send
        self._missing.found(info.id)
        self.devices[info.id] = self.tables[made.kind_of_device].members[info.id] = device
        self._infos[info.id] = info
        self._growth.add(device)

    def _has_known_registers(self, device: ServoBusDevice, info: DeviceInfo) -> bool:
        """Return whether a device that answers again has the registers of its object; another one is blocked."""
        blocked, before = self.channel.blocked, self._infos[info.id]
        name = f"{device.kind_of_device} {info.id}"
        if info.family == before.family:
            if blocked.pop(info.id, ""):
                self._show_unusable(info.id, "")
                device.changed_state("back", "")
                device.changed_state("ok", "")
                self.log.log_event(BACK, name)
                self.back.emit(device)
            return True
        reason = f"{info.name} answers to this id, not {before.name}: start urbihw again to use it"
        changed = blocked.get(info.id) != reason
        blocked[info.id] = reason
        # Each time: a lost link, and another worker, forget it.
        self._show_unusable(info.id, reason)
        if changed:
            self.log.log_event(LOST, name, reason)
            device.changed_state("lost", reason)
            self.lost.emit(device)
        return False

    def _show_unusable(self, number: int, reason: str) -> None:
        """Tell clients that write to a device, the health and ``problems`` why it is not used; "" when it is again."""
        text = reason and f"device {number} is lost: {reason}"
        if self.motion.absent.get(number, ("", 0))[0] != text:
            # It may have been silent before, which was another reason.
            self.motion.set_absent(number, "")
            self.motion.set_absent(number, text)
        self.worker.send(m.Unusable(number, reason))
        self.report.show()

    def unusable_devices(self) -> list[str]:
        """See ``RobotHooks``: another model under the id of a device, several devices of one id, alarms."""
        blocked = [f"{self.devices[number].kind_of_device} {number}: {reason}"
                   for number, reason in self.channel.blocked.items() if number in self.devices]
        alarms = [device.explain_alarm() for device in self.devices.values() if device.state.sensed == "alarm"]
        return [*blocked, *(_conflict_text(number) for number in self._conflicts), *alarms]

    def on_happened(self, message: m.DeviceReport) -> None:
        """Show what a joint does against what it was told; the movements of one that was stopped for it are over."""
        motor = self.devices.get(message.device)
        if not isinstance(motor, ServoMotor):
            return
        if message.what == "blocked":
            motor.set_blocked(message.value + self.offset)
        elif message.what == "free":
            motor.set_blocked(None)
        elif message.what == "overspeed":
            motor.set_too_fast(message.value)
        elif message.what == "relaxed":
            motor.mark_released()
        elif message.what == "halted":
            self.log.warning("%s: its movements are over", message.value)
            self.guard.end_movements(message.device, message.value)
            # Targets may have been on their way.
            self.worker.send(m.Stop(self.motion.epoch, message.value, (message.device,)))

    def on_freed(self) -> None:
        """See ``RobotHooks``: the torque limits of some servos are efforts, which an emergency stop refuses."""
        for device in self.devices.values():
            device.restore_refused()

    def on_device_state(self, message: m.DeviceState) -> None:
        """Show the loss and the return of a device; one that was lost before it was found is logged as missing."""
        device = self.devices.get(message.device)
        if device is None:
            if message.new == "lost":
                self._missing.add(message.device)
                if all(each.id != message.device for each in self.expected):  # else it is among the differences
                    self.log.log_event(MISSING, str(message.device))
            return
        if message.device in self.channel.blocked:
            return
        device.changed_state(message.new, message.reason)
        if message.new == "lost":
            self.log.log_event(LOST, f"{device.kind_of_device} {message.device}", message.reason)
            self.lost.emit(device)
        elif message.new == "back":
            self.log.log_event(BACK, f"{device.kind_of_device} {message.device}")
            self.back.emit(device)

    def _report_refused(self, device: ServoBusDevice, slot: str, reason: str) -> None:
        self.log.warning("%s %d: %s not written: %s", device.kind_of_device, device.number, slot, reason)
        self.refused.emit(device, slot, reason)
