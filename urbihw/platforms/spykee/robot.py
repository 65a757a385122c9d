"""The object ``Spykee`` (the robot on its connection), and how its parts get what the worker says.

The tree of components (``robot``) is put together in ``spykee.u``.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import (
    BadConfig,
    Opened,
    RobotSettings,
    event,
    finite_number,
    function,
    number,
    owned,
    reading,
    set_range,
)
from urbihw.platforms.arrival import LINK_DOWN
from urbihw.platforms.base import WiredRobot
from urbihw.platforms.hooks import LimitedDevice
from urbihw.platforms.spykee import protocol as p
from urbihw.platforms.spykee import words
from urbihw.platforms.spykee.audio import SpykeeSpeaker
from urbihw.platforms.spykee.calibration import Calibration, calibration_file, load, save
from urbihw.platforms.spykee.clapper import Clapper
from urbihw.platforms.spykee.devices import DOCKED, SpykeeBattery, SpykeeLed, SpykeeTrack
from urbihw.platforms.spykee.driver import CAMERA, ENGINE, MICRO, POWER, TRACKS
from urbihw.platforms.spykee.mp3 import SpykeeMp3
from urbihw.platforms.spykee.options import SpykeeOptions
from urbihw.platforms.spykee.session import SpykeeRobotInfo
from urbihw.platforms.spykee.streams import SpykeeCamera, SpykeeMicro
from urbihw.settings import BadSetting

TREE: Final = "tree.u"
"""Builds the standard robot API, when the robot was found."""


class Spykee(WiredRobot):
    """A Spykee, with its tracks, senses and sounds."""

    slot_words = words.BASE

    uname = "SpykeeRobot"
    classes = (SpykeeTrack, SpykeeLed, SpykeeBattery, SpykeeCamera, SpykeeMicro, SpykeeSpeaker, SpykeeMp3, Clapper)

    robot_name = "spykee"
    model_name = "Spykee"
    family = "urbihw.platforms.spykee.driver:SpykeeDriver"

    power = reading(0.0)
    charging = reading(False)
    onDock = reading(False)
    volume = owned(0.0)
    uid = reading("")
    robotName = reading("")
    firmware = reading("")
    fullSpeed = reading(0.0)
    fullTurn = reading(0.0)
    docked = event()
    undocked = event()
    answered = event()

    def init(self) -> None:
        """Called by ``new``; nothing happens before ``open``."""
        super().init()
        self._options = SpykeeOptions()
        self._calibration = Calibration(self._options.full_speed, self._options.full_turn)
        self._count = 0
        self._built = self._measured = False
        set_range(self.volume, 0.0, 100.0)
        self.notify_change(self.volume, self._write_volume)

    # ---------------------------------------------------------------- opening

    def open(self, settings: RobotSettings, opened: Opened) -> None:
        """Read the options, then start the worker."""
        self._read_options(settings)
        super().open(settings, opened)

    def configure(self, settings: RobotSettings) -> None:
        """Apply new options and settings, and load the calibration again."""
        self._read_options(settings)
        super().configure(settings)
        self._check_limits()
        if self._built:
            self._load_calibration()

    def _read_options(self, settings: RobotSettings) -> None:
        try:
            self._options = SpykeeOptions.of(settings.options)
        except BadSetting as error:
            raise BadConfig(f"spykee: {error}") from error

    def summary(self) -> str:
        """Return the name of the robot and its charge."""
        power = "charging" if self.charging.sensed else f"battery {self.power.sensed:.0f} %"
        return f"{self.robotName.sensed or self.uid.sensed}, {power}"

    # ---------------------------------------------------------------- what is there

    def on_found(self, message: m.Found) -> None:
        """Make the objects at the first connection; after each later one, restart the sound stream."""
        (info,) = message.devices
        self._identify(info)
        self._check_limits()
        # A robot that was switched off has lost its volume.
        self._send_volume(self._options.volume if not self._built else int(self.volume.sensed))
        if not self._built:
            self._build()
            self.build_tree(Path(__file__).with_name(TREE))
            return
        self.micro.reset_numbers()
        self.limits.send()

    def _identify(self, info: SpykeeRobotInfo) -> None:
        self.uid.sense(info.uid)
        self.robotName.sense(info.name)
        self.identity.show(name=info.name, serial=info.uid)
        self.firmware.sense(info.firmware)
        self.onDock.sense(info.docked)
        self._load_calibration()

    def _build(self) -> None:
        self._built = True
        create, channel = self.host.create, self.channel
        self.tracks = [
            create(SpykeeTrack, name, channel, self.motion, name, self.explain_off) for name in TRACKS
        ]
        for name in p.LEDS:
            create(SpykeeLed, name, channel, name)
        self.camera = create(SpykeeCamera, "camera", channel)
        self.micro = create(SpykeeMicro, "micro", channel)
        self.speaker = create(SpykeeSpeaker, "speaker", channel, self.log)
        self.mp3 = create(SpykeeMp3, "mp3", channel, self.log)
        self.battery = create(SpykeeBattery, "battery")

    def is_complete(self) -> bool:
        """Return whether the tree is built and the robot was measured once."""
        return self.has_tree and self._measured

    def limited_devices(self) -> Mapping[str, LimitedDevice]:
        """Return the two tracks by name."""
        return dict(zip(TRACKS, self.tracks, strict=True)) if self._built else {}

    def _check_limits(self) -> None:
        """Warn of a speed that was meant as a share of 1 or as m/s: with less than 1 % no track runs."""
        for name in TRACKS:
            if self.limits.settings.device(name).speed < 1:
                self.log.warning(
                    "%s = %g is percent of full power, so %s does not run; for a third of full power write 33",
                    self.limits.settings.named("speed", name), self.limits.settings.device(name).speed, name,
                )  # fmt: skip

    # ---------------------------------------------------------------- what the worker says

    def on_samples(self, message: m.Samples) -> None:
        """Show pictures, sound and the battery."""
        if not self._built:
            return
        for device, values in message.values.items():
            stamp = message.times[device] + self.offset
            if device == CAMERA:
                self.camera.show_picture(values["image"], stamp)
            elif device == MICRO:
                self.micro.show_sound(values, stamp)
            elif device == POWER:
                self._show_power(values["level"], stamp)

    def _show_power(self, level: int, stamp: float) -> None:
        self._measured = True
        self.power.sense(float(level), stamp)
        self.charging.sense(level < 0, stamp)
        self.battery.show_level(level, stamp)

    def on_happened(self, message: m.DeviceReport) -> None:
        """Show docking and undocking, and the end of the music."""
        if message.device == "dock":
            docked = message.what == "docked"
            self.onDock.sense(docked)
            (self.docked if docked else self.undocked).emit()
        elif self._built:
            self.mp3.file_ended()

    def on_link_down(self, reason: str) -> None:
        """End the music and the movements: without a link, their progress is unknown."""
        if self._built:
            self.mp3.link_down()
            self._halt_tracks(None)
            self.battery.mark_stale()
            if self.has_tree:
                # A movement is computed from the time alone, so its position is unknown now.
                self.send("Mobility.of(robot).lose;")

    def on_halt(self, reason: str, devices: tuple[Hashable, ...] | None = None) -> None:
        """Set the shown speeds of the stopped tracks to 0."""
        if self._built:
            self._halt_tracks(devices)

    @function("explainOff")
    def explain_off(self) -> str:
        """Return the reason why the tracks do not run, in words; "" if they do."""
        if not self.arrival.is_up():
            return LINK_DOWN
        return DOCKED if self.onDock.sensed else ""

    def _halt_tracks(self, devices: tuple[Hashable, ...] | None) -> None:
        for name, track in zip(TRACKS, self.tracks, strict=True):
            if devices is None or name in devices:
                track.show_stop()

    # ---------------------------------------------------------------- what urbiscript calls

    @function("findBase")
    def find_base(self) -> None:
        """Make the robot search for its base and station on it."""
        self._move_by_itself(p.DOCK)

    @function("cancelFindBase")
    def cancel_find_base(self) -> None:
        """Abort the search for the base."""
        self.channel.write(ENGINE, "move", p.CANCEL, self._warn("cancelFindBase"))

    @function("chargeStop")
    def charge_stop(self) -> None:
        """Make the robot stop charging and leave its charging station."""
        self._move_by_itself(p.UNDOCK)

    def _move_by_itself(self, order: int) -> None:
        self.check_link()
        origin = self.motion.admit(ENGINE)
        self.channel.write(ENGINE, "move", order, self._warn("base"), origin)

    def _write_volume(self) -> None:
        self._send_volume(round(number(self.volume)))

    def _send_volume(self, volume: int) -> None:
        self.volume.sense(float(volume))
        # A robot that is absent gets it when it comes.
        if self.arrival.is_up() or not self.arrival.opening:
            self.channel.write("play", "volume", volume, self._warn("volume"))

    @function("tracksFor")
    def tracks_for(self, x: float, yaw: float) -> list[float]:
        """The speeds of the tracks (left, right; -100..100) for a speed ahead (m/s) and to the left (rad/s)."""
        return list(self._calibration.tracks(finite_number(x), finite_number(yaw)))

    @function("calibrateGo")
    def calibrate_go(self, asked: float, went: float) -> None:
        """Calibrate: ``robot.go(asked)`` went ``went`` m; kept in a file.  Raises ValueError."""
        self._calibrate(self._calibration.after_going(asked, went))

    @function("calibrateTurn")
    def calibrate_turn(self, asked: float, turned: float) -> None:
        """Calibrate: ``robot.turn(asked)`` turned by ``turned`` rad; kept in a file.  Raises ValueError."""
        self._calibrate(self._calibration.after_turning(asked, turned))

    def _calibrate(self, calibration: Calibration) -> None:
        path = calibration_file(self._options.calibration)
        try:
            save(path, str(self.uid.sensed), calibration)
        except OSError as error:
            raise ValueError(f"{path} cannot be written: {error.strerror}; choose another one: calibration") from error
        self._show_calibration(calibration)

    def _load_calibration(self) -> None:
        default = Calibration(self._options.full_speed, self._options.full_turn)
        try:
            found = load(calibration_file(self._options.calibration), str(self.uid.sensed), default)
        except ValueError as error:
            self.log.warning("%s", error)
            found = default
        self._show_calibration(found)

    def _show_calibration(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self.fullSpeed.sense(calibration.speed)
        self.fullTurn.sense(calibration.turn)

    @function("requestInfo")
    def request_info(self, what: str) -> int:
        """Request the "config", the "networks" or the "log" of the robot.

        Returns a number; the event ``answered`` is emitted with it, the answer, and the error ("" for none).
        """
        return self._request(lambda done: self.channel.read(what, "", done))

    @function("requestWrite")
    def request_write(self, key: str, value: str) -> int:
        """Write a row of the configuration; ``answered`` as for ``requestInfo``."""
        return self._request(lambda done: self.channel.write("config", key, value, done))

    def _request(self, send: Any) -> int:
        self.check_link()
        self._count += 1
        number = self._count
        send(lambda reply: self.answered.emit(float(number), reply.value, reply.error))
        return number

    def check_link(self) -> None:
        """Raise ValueError while the link is down."""
        if not self.arrival.is_up():
            raise ValueError(LINK_DOWN)

    def _warn(self, what: str) -> Any:
        def done(reply: m.Reply) -> None:
            if not reply.ok:
                self.log.warning("%s: not done: %s", what, reply.error)

        return done
