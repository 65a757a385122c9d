"""The object ``bioloid``: the bus as urbiscript sees it, and the way between its worker and its devices.

The worker's messages come in a thread of the handle and are posted into the kernel's thread; what devices want is
gathered in ``Wire`` and leaves once per scheduler round.  The sign of life is sent by the kernel's own timer: it is the
kernel whose death, or whose being stuck in a script, must stop the robot.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Final, Protocol

from urbihw.buses import messages as m
from urbihw.buses.errors import BadUrl, BadValue, LinkGone
from urbihw.buses.worker import Worker
from urbihw.kernel.uobject import (
    BadConfig,
    DeviceError,
    NotReady,
    Opened,
    Robot,
    RobotSettings,
    UObject,
    event,
    function,
    reading,
)
from urbihw.platforms.bioloid.devices import Device
from urbihw.platforms.bioloid.motors import AX12, Servo, XServo
from urbihw.platforms.bioloid.sensors import AXS1
from urbihw.platforms.bioloid.wire import Wire

log = logging.getLogger("urbihw.bioloid")

CLASSES: Final[dict[str, type[Device]]] = {
    "AX-12": AX12,
    "AX-S1": AXS1,
    "XL330": XServo,
    "XL430": XServo,
    "XM430": XServo,
}
"""Control table (``DeviceInfo.family``) -> class."""
ALIVE: Final = 0.5
"""Seconds between signs of life."""
PATIENCE: Final = 2.0
"""Seconds to wait for the first reading of all devices."""


class Handle(Protocol):
    """What is needed of a worker."""

    def send(self, message: m.ToWorker) -> None:
        """Hand a message to the worker."""
        ...

    def stop(self) -> None:
        """Stop the robot and end the worker."""
        ...


class Devices(UObject):
    """Devices by their number: ``motors[6]``."""

    uname = "BioloidDevices"

    def init(self, what: str = "device") -> None:
        """``what`` is the word for one of them in messages."""
        self._what = what
        self.members: dict[int, Device] = {}

    @function("[]")
    def get(self, id: int) -> Device:
        """The device with this number."""
        if id not in self.members:
            known = ", ".join(map(str, sorted(self.members))) or "none"
            raise ValueError(f"no {self._what} {id}; there are: {known}")
        return self.members[id]

    @function
    def has(self, id: int) -> bool:
        """Whether there is a device with this number."""
        return id in self.members

    @function
    def keys(self) -> list[float]:
        """The numbers, in order."""
        return [float(number) for number in sorted(self.members)]

    @function("asList")
    def as_list(self) -> list[Device]:
        """The devices, in order of their numbers."""
        return [self.members[number] for number in sorted(self.members)]


class Bioloid(Robot):
    """A Bioloid on one bus."""

    classes = (AX12, XServo, AXS1, Devices)

    url = reading("")
    link = reading(False)
    rate = reading(0.0)
    busLoad = reading(0.0)  # noqa: N815 - names of slots
    statistics = reading()
    linkLost = event()  # noqa: N815
    linkBack = event()  # noqa: N815
    lost = event()
    back = event()
    found = event()
    refused = event()
    stopped = event()

    start_worker: Callable[..., Handle] = staticmethod(Worker.start)
    """Makes a worker; tests put another one here."""
    bus_time: Callable[[], float] = staticmethod(time.monotonic)
    """The clock of the worker's time stamps."""

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        self._worker: Handle | None = None
        self._opened: Opened | None = None
        self._missed_link = False
        self.devices: dict[int, Device] = {}
        self.wire = Wire(self._send)

    # ---------------------------------------------------------------- what the daemon calls

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """See ``Robot``.  Options: "protocol" (1, 2 or "auto"), "ids" (those to look for; all if missing)."""
        self._opened = opened
        self._offset = self.host.now() - self.bus_time()
        self.url.sense(settings.url)
        self.motors = self.host.create(Devices, "motors", "motor")
        self.sensors = self.host.create(Devices, "sensors", "sensor")
        self.put_slot("motors", self.motors)
        self.put_slot("sensors", self.sensors)
        try:
            self._worker = self.start_worker(settings.url, post=self._post, settings=_configure(settings))
        except (BadUrl, BadValue) as error:
            raise BadConfig(str(error)) from error
        self.host.each_round(self.wire.flush)
        self.set_timer(ALIVE, self._say_alive)

    def configure(self, settings: RobotSettings) -> None:
        """See ``Robot``."""
        self._send(_configure(settings))

    def close(self) -> None:
        """See ``Robot``."""
        worker, self._worker = self._worker, None
        self.destroy()
        if worker is not None:
            worker.stop()

    def status(self) -> str:
        """See ``Robot``."""
        if not self.link.sensed:
            return "link down"
        motors = sum(isinstance(device, Servo) for device in self.devices.values())
        sensors = len(self.devices) - motors
        lost = [str(number) for number, device in self.devices.items() if device.state.sensed == "lost"]
        parts = [_count(motors, "servo"), _count(sensors, "sensor")]
        if self.rate.sensed:
            parts.append(f"{self.rate.sensed:.0f} Hz")
        return ", ".join(parts) + (f", lost: {' '.join(lost)}" if lost else "")

    # ---------------------------------------------------------------- what urbiscript calls

    @function
    def scan(self) -> None:
        """Look for devices on all ids; takes half a second, in which the cycle rests: not while the robot moves."""
        self.wire.ask("scan", 0, lambda reply: None if reply.ok else log.warning("scan failed: %s", reply.error))

    @function
    def stop(self) -> None:
        """Stop now: wheels stand, joints hold where they are; what is written afterwards moves the robot again."""
        self._send(m.Stop())

    # ---------------------------------------------------------------- the worker

    def _post(self, message: m.FromWorker) -> None:
        """Called in the worker handle's thread."""
        if isinstance(message, m.Samples):
            self.host.post(lambda: self._samples(message))
        else:
            self.host.post(lambda: self._heard(message))

    def _send(self, message: m.ToWorker) -> None:
        if self._worker is not None:
            try:
                self._worker.send(message)
            except LinkGone:
                # Its Ended is on the way and says why.
                pass

    def _say_alive(self) -> None:
        self._send(m.Alive())

    def _samples(self, samples: m.Samples) -> None:
        offset, times, devices = self._offset, samples.times, self.devices
        for number, values in samples.values.items():
            device = devices.get(number)
            if device is not None:
                device.take(values, times[number] + offset)
        if self._opened is not None and self.devices and all(device.whole for device in devices.values()):
            self._answer(None)

    def _heard(self, message: m.FromWorker) -> None:
        match message:
            case m.Reply():
                self.wire.replied(message)
            case m.Found():
                self._found(message)
            case m.DeviceState():
                self._device_state(message)
            case m.LinkState():
                self._link_state(message)
            case m.Statistics():
                self._statistics(message)
            case m.Refused():
                log.warning("device %d: %s: %s", message.device, message.item, message.reason)
            case m.Stopped():
                log.info("bioloid stopped: %s", message.reason)
                self.stopped.emit(message.reason)
            case m.Ended():
                self._ended(message)

    def _statistics(self, message: m.Statistics) -> None:
        self.rate.sense(message.rate)
        self.busLoad.sense(message.load)
        self.statistics.sense(
            {"rate": message.rate, "late": message.late, "busLoad": message.load, "dropped": message.dropped}
            | {kind: float(count) for kind, count in message.errors.items()}
        )

    def _link_state(self, message: m.LinkState) -> None:
        if self._opened is not None and not message.up:
            self._answer(NotReady(message.reason))
            return
        if bool(self.link.sensed) == message.up:
            return
        self.link.sense(message.up)
        if message.up:
            if self._missed_link:
                log.warning("link to %s is back", self.url.sensed)
                self.linkBack.emit()
            return
        self._missed_link = True
        log.warning("link lost: %s; trying again until it is back", message.reason)
        for device in self.devices.values():
            device.link_changed(False)
        self.linkLost.emit(message.reason)

    def _ended(self, message: m.Ended) -> None:
        if self._worker is None and not message.reason:
            return
        reason = message.reason or "the bus worker ended"
        if self._opened is not None:
            self._answer(NotReady(reason))
        else:
            self._worker = None
            self._link_state(m.LinkState(False, reason))

    # ---------------------------------------------------------------- devices

    def _found(self, message: m.Found) -> None:
        if message.conflicts:
            self._conflicts(message.conflicts)
        for info in message.devices:
            device = self.devices.get(info.id)
            if device is None:
                self._add(info)
            else:
                device.link_changed(True)
        if self._opened is None:
            return
        if not self.devices:
            self._answer(
                NotReady(
                    f"no servo found on {self.url.sensed}: is the robot switched on, are the cables plugged in, "
                    "is this its speed (?baud=1000000)?"
                )
            )
        elif not message.conflicts:
            self.set_patience()

    def set_patience(self) -> None:
        """Wait for the first readings, but not for ever: a device may have died since the scan."""
        handle = 0

        def over() -> None:
            self.remove_timer(handle)
            self._answer(None)

        handle = self.set_timer(PATIENCE, over)

    def _conflicts(self, ids: tuple[int, ...]) -> None:
        numbers = " and ".join(map(str, ids))
        text = (
            f"several devices answer to id {numbers} on {self.url.sensed}: take all but one off the bus and give the "
            "others ids of their own"
        )
        if self._opened is not None:
            self._answer(BadConfig(text))
        else:
            log.error("%s", text)

    def _add(self, info: m.DeviceInfo) -> None:
        kind = CLASSES.get(info.family)
        if kind is None:
            log.warning("device %d (%s) is of no kind known here; it is left alone", info.id, info.name)
            return
        group, name = (self.motors, "motor") if issubclass(kind, Servo) else (self.sensors, "sensor")
        device = self.host.create(kind, f"{name}{info.id}", self.wire, info, self._refuse)
        self.devices[info.id] = group.members[info.id] = device
        self.found.emit(device)

    def _device_state(self, message: m.DeviceState) -> None:
        device = self.devices.get(message.device)
        if device is None:
            return
        device.changed_state(message.new, message.reason)
        if message.new == "lost":
            log.warning("%s %d is lost: %s", device.kind_of_device, message.device, message.reason)
            self.lost.emit(device)
        elif message.new == "back":
            log.warning("%s %d is back", device.kind_of_device, message.device)
            self.back.emit(device)

    def _refuse(self, device: Device, slot: str, reason: str) -> None:
        log.warning("%s %d: %s not written: %s", device.kind_of_device, device.number, slot, reason)
        self.refused.emit(device, slot, reason)

    def _answer(self, error: DeviceError | None) -> None:
        opened, self._opened = self._opened, None
        if opened is not None:
            opened(error)


def _configure(settings: RobotSettings) -> m.Configure:
    protocol, ids = settings.options.get("protocol", "auto"), settings.options.get("ids")
    if protocol not in (1, 2, "auto"):
        raise BadConfig(f'bioloid: protocol must be 1, 2 or "auto", not {protocol!r}')
    if ids is not None and not (isinstance(ids, list | tuple) and all(isinstance(number, int) for number in ids)):
        raise BadConfig(f"bioloid: ids must be a list of numbers, such as [1, 2, 100], not {ids!r}")
    return m.Configure(
        rate=settings.rate,
        dead_man=settings.dead_man,
        torque_off_on_stop=settings.torque_off_on_stop,
        protocol=protocol,
        ids=None if ids is None else tuple(ids),
    )


def _count(number: int, word: str) -> str:
    return f"{number} {word}" if number == 1 else f"{number} {word}s"
