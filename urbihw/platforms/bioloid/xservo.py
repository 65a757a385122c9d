"""The class XServo: servos of protocol 2.0, whose operating mode selects between joint and wheel."""

from __future__ import annotations

from urbihw.buses.messages import Reply
from urbihw.buses.servos import units
from urbihw.buses.servos.device import DeviceInfo
from urbihw.kernel.uobject import Motion, function, set_range
from urbihw.platforms.bioloid import slots
from urbihw.platforms.bioloid.devices import Refused
from urbihw.platforms.bioloid.motors import Servo, Step
from urbihw.platforms.channel import DeviceChannel

_REBOOT_S = 1.0
"""Seconds to wait for the restart of a servo; it takes about 0.3."""
_HARDWARE_ERRORS = {0: "input voltage", 2: "overheating", 3: "encoder", 4: "electrical shock", 5: "overload"}
_POSITION, _VELOCITY = 3, 1


class XServo(Servo):
    """An X-series servo: XL330, XC330, XL430, XC430, XM430."""

    limits = ("min_position_limit", "max_position_limit")
    hidden = (("operating_mode", slots.RARE), ("hardware_error", slots.SLOW), ("velocity_limit", slots.RARE))

    def init(self, channel: DeviceChannel, info: DeviceInfo, refused: Refused, motion: Motion) -> None:  # type: ignore[override]
        """Select the slots: the XL430 family reports its load, the others measure their current."""
        self.rows = slots.XL430 if info.family == "XL430" else slots.X_CURRENT
        super().init(channel, info, refused, motion)

    def prepare(self) -> None:
        """Watch the hardware error register; the torque limit is unsigned."""
        super().prepare()
        self.on_change("hardware_error", self._show_hardware_error)
        set_range(self.variables["torqueLimit"], 0.0, self.facts.stall_torque)

    def mode_items(self) -> tuple[str, ...]:
        """The operating mode is a register of its own."""
        return ("operating_mode",)

    def reads_wheel(self) -> bool:
        """True in velocity mode."""
        return self.raw["operating_mode"] == _VELOCITY

    def speed_range(self, wheel: bool) -> tuple[float, float]:
        """Up to its velocity limit."""
        item = self.table.item("velocity_limit")
        fastest = units.to_si(item, self.raw.get("velocity_limit", item.default or item.high))
        return (-fastest if wheel else 0.0), fastest

    def speed_target(self, value: float, wheel: bool) -> Step:
        """The goal velocity of a wheel, the profile velocity of a joint."""
        item = self.table.item("goal_velocity" if wheel else "profile_velocity")
        return item.name, units.from_si(item, value)

    def speed_of(self, raw: int) -> float:
        """The inverse of ``speed_target``."""
        return units.to_si(self.table.item("goal_velocity"), raw)

    def plan_on(self) -> list[Step]:
        """Torque on only: the servo itself sets its goal to the present position."""
        return [("torque_enable", 1)]

    def plan_limits(self, wheel: bool, least: float, most: float) -> list[Step]:
        """Mode and limits can only be written while the torque is off."""
        values = {"operating_mode": _VELOCITY if wheel else _POSITION}
        if not wheel:
            for item, si in zip(self.limits, (least, most), strict=True):
                values[item] = units.from_si(self.table.item(item), si)
        steps: list[Step] = [(item, raw) for item, raw in values.items() if self.raw.get(item) != raw]
        if not steps or self.raw.get("torque_enable") == 0:
            return steps
        return [("torque_enable", 0), *steps, ("torque_enable", 1)]

    def explain_error(self, error: str) -> str:
        """Add the advice for EEPROM registers, which can only be written while the torque is off."""
        if "access" in error and self.raw.get("torque_enable"):
            return f"{error}; switch the motor off first: motor{self.number}.load = 0"
        return error

    def explain_alarm(self) -> str:
        """Return the advice after an alarm: only a restart brings the torque back."""
        if not self.raw.get("hardware_error"):
            return ""
        return f"motor {self.number} gives no torque since an alarm ({self.alarm.sensed}): motor{self.number}.reboot"

    @function
    def reboot(self) -> None:
        """Restart the servo, the only way to get its torque back after an alarm; it goes limp."""
        self.channel.send_request("reboot", self.number, self._handle_reboot)

    def _handle_reboot(self, reply: Reply) -> None:
        if not reply.ok:
            self.refused("reboot", reply.error)
            return
        handle = 0

        def started() -> None:
            self.remove_timer(handle)
            self.restore()

        # Its RAM is reset as after power on: restore the settings when it has started.
        handle = self.set_timer(_REBOOT_S, started)

    def _show_hardware_error(self, raw: int, stamp: float) -> None:
        self.show_alarm(", ".join(word for bit, word in _HARDWARE_ERRORS.items() if raw >> bit & 1))
