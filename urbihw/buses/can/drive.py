"""One CiA 402 drive on a network: how it is set up, walked through its states, aimed and read.

Process data carry what is needed each tick (`cia402.RECEIVED`, `SENT`); all else goes by SDO, while setting up. A drive
that does not let its process data be mapped so cannot be used here, and says why.

So that it stops when this process dies, it is asked to watch our heartbeat (0x1016) and to brake when that ends
(0x6007); drives that cannot do that are taken all the same, and `watches` is False.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

from canopen import SdoAbortedError, SdoCommunicationError
from canopen.nmt import NMT_STATES

from urbihw.buses.can import cia402 as c
from urbihw.buses.can.network import PortNetwork
from urbihw.buses.can.options import LAST_NODE
from urbihw.buses.can.profile import ProfileSpeed
from urbihw.buses.errors import Unavailable
from urbihw.frozen import frozen

MASTER: Final = LAST_NODE + 1
"""Our number on the bus, under which our heartbeat goes out."""
HEARTBEAT_PERIOD_S: Final = 0.1
"""Seconds between heartbeats, ours and theirs."""
HEARTBEAT_TIMEOUT_S: Final = 0.5
"""Seconds without a word after which either side is lost."""
RESEND_AFTER_S: Final = 0.1
"""Seconds after which a control word without effect is sent again."""
_QUICK_STOP_ON_LOSS = 3
_OPERATIONAL = 5
_SdoError = (SdoAbortedError, SdoCommunicationError)


@frozen
class DriveInfo:
    """The description of a drive in `Found`.

    Attributes:
        id: number of the node.
        name: its device name (0x1008).
        modes: bits of 0x6502.
        increments: of one turn (0x608F); nan if unknown.
        low, high: software limits of the position (0x607D), in increments; -inf and inf if it has none.
        most_speed: in increments/s (0x607F); inf if unknown.
        rated_torque: of the motor (0x6076), in N m; nan if unknown, or if the drive has no torque mode.
        watches: it supervises the master's heartbeat and stops by itself when that ends.
    """

    id: int
    name: str
    modes: int
    increments: float = math.nan
    low: float = -math.inf
    high: float = math.inf
    most_speed: float = math.inf
    rated_torque: float = math.nan
    watches: bool = False


class CanDrive:
    """A drive that was set up.

    Attributes:
        info: its description.
        heard_at: time of its last message.
        wanted: True for power on, False for off, None to leave it as it is.
        resets: a fault is to be reset.
        booted: it reported a restart; its configuration is lost.
        displaced: the NMT state, other than OPERATIONAL, into which another master has put it; "" if none has. Our
            process data do not reach it there (CiA 301, "NMT states and communication objects").
        profile: the speed with which it goes to a position.
        emergencies: (code, register) of its emergency messages, until `DrivesDriver` posts them.
    """

    def __init__(
        self, network: PortNetwork, number: int, period: float, now: float, *, brakes: bool = False
    ) -> None:
        """Set it up; with `brakes`, make it brake and power off before that. Raises Unavailable."""
        self.heard_at = now
        self.wanted: bool | None = None
        self.resets = False
        self.booted = False
        self.displaced = ""
        self.emergencies: list[tuple[int, int]] = []
        self._network = network
        self._node = network.add_remote_node(number, c.dictionary())
        # A heartbeat that was sent before the drive got our NMT command may follow the set-up: one is ignored.
        self._ignored_heartbeats = 1
        self._control = 0
        self._mode = 0
        self._halted = False
        self._leaves = False
        """It is about to go to a position, and has not got the point yet."""
        self._point: int | None = None
        self._point_sent = False
        self._goal: int | None = None
        self._sent: tuple[int, int] | None = None
        self._sent_at = -math.inf
        self._quick = False
        self._homing = False
        self._sent_pdos: dict[int, tuple[int, ...]] = dict(c.SENT)
        if brakes:
            self._brake(number)
        self.info = self._set_up(number, period)
        # Only now: heartbeats and emergencies during the set-up are ignored.
        self._node.nmt.add_heartbeat_callback(self._on_heartbeat)
        self._node.emcy.add_callback(self._on_emergency)
        self._now = now

    # ---------------------------------------------------------------- setting up

    def _brake(self, number: int) -> None:
        """Quick stop by SDO, for a drive that may not receive process data; there is no SDO in STOPPED (CiA 301)."""
        try:
            self._node.nmt.state = "PRE-OPERATIONAL"
            self.write_object(c.CONTROL, 0, c.QUICK)
        except _SdoError as error:
            raise Unavailable(f"drive {number} cannot be stopped: {error}") from error

    def _set_up(self, number: int, period: float) -> DriveInfo:
        """Configure the drive over SDO and read its description. Raises Unavailable when it cannot be used."""
        try:
            kind = self._read_device_type()
            if kind & 0xFFFF != c.SERVO:
                raise Unavailable(f"node {number} is no drive after CiA 402 (device type 0x{kind:08X})")
            self._node.nmt.state = "PRE-OPERATIONAL"
            self._map_process_data(c.RECEIVED, c.SENT, period)
            modes = int(self._read_optional(c.SUPPORTED, 0, 0))
            if modes & c.CAN_PUSH:
                self._map_torque(period)
            self._node.sdo[c.HEARTBEAT].raw = round(HEARTBEAT_PERIOD_S * 1000)
            info = self._read_info(number, modes)
            self.profile = ProfileSpeed(self)
            self._node.nmt.state = "OPERATIONAL"
        except _SdoError as error:
            raise Unavailable(f"drive {number} cannot be set up: {error}") from error
        return info

    def _read_device_type(self) -> int:
        try:
            return int(self.read_object(0x1000, 0))
        except SdoCommunicationError:
            # A node in STOPPED answers no SDO (CiA 301); another master may have left it there.
            self._node.nmt.state = "PRE-OPERATIONAL"
            return int(self.read_object(0x1000, 0))

    def _map_process_data(
        self, received: Mapping[int, tuple[int, ...]], sent: Mapping[int, tuple[int, ...]], period: float
    ) -> None:
        for number, objects in received.items():
            self._map_pdo(self._node.rpdo[number], objects, 0x100 + 0x100 * number)
        for number, objects in sent.items():
            pdo = self._node.tpdo[number]
            pdo.event_timer = max(1, round(period * 1000))
            self._map_pdo(pdo, objects, 0x80 + 0x100 * number)

    def _map_torque(self, period: float) -> None:
        try:
            self._map_process_data(c.RECEIVED_TORQUE, c.SENT_TORQUE, period)
        except SdoAbortedError:
            # A drive with fewer process data can be used without its torque mode.
            return
        self._sent_pdos |= c.SENT_TORQUE

    def _map_pdo(self, pdo: Any, objects: tuple[int, ...], base: int) -> None:
        pdo.cob_id = base + self._node.id
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.trans_type = 255
        pdo.enabled = True
        pdo.save()

    def _read_info(self, number: int, modes: int) -> DriveInfo:
        rated = self._read_optional(c.RATED_TORQUE, 0, 0) if self.has_torque else 0
        turns = self._read_optional(0x608F, 2, 1.0) or 1.0
        return DriveInfo(
            id=number,
            name=str(self._read_optional(0x1008, 0, "")).strip("\0 "),
            modes=modes,
            increments=self._read_optional(0x608F, 1, math.nan) / turns,
            low=self._read_optional(0x607D, 1, -math.inf),
            high=self._read_optional(0x607D, 2, math.inf),
            most_speed=self._read_optional(0x607F, 0, math.inf),
            rated_torque=rated / 1000 or math.nan,
            watches=self._enable_heartbeat_watch(),
        )

    def _read_optional(self, index: int, sub: int, otherwise: Any) -> Any:
        """Read an object that not every drive has; `otherwise` if this one has not."""
        try:
            return self.read_object(index, sub)
        except SdoAbortedError:
            return otherwise

    def _enable_heartbeat_watch(self) -> bool:
        try:
            self.write_object(c.WATCHED, 1, MASTER << 16 | round(HEARTBEAT_TIMEOUT_S * 1000))
            self.write_object(c.CONNECTION_LOST, 0, _QUICK_STOP_ON_LOSS)
        except SdoAbortedError:
            return False
        return True

    def read_object(self, index: int, sub: int) -> Any:
        """An object of `cia402.dictionary`. Raises SdoAbortedError, SdoCommunicationError, KeyError."""
        variable = self._node.sdo[index]
        return (variable[sub] if sub or hasattr(variable, "values") else variable).raw

    def write_object(self, index: int, sub: int, value: int) -> None:
        """Write an object; raises the same."""
        variable = self._node.sdo[index]
        (variable[sub] if sub or hasattr(variable, "values") else variable).raw = value

    # ---------------------------------------------------------------- reading

    @property
    def status(self) -> int:
        """The status word that the drive has sent last."""
        return int(self._process_value(1, c.STATUS))

    @property
    def state(self) -> str:
        """The state of the drive by its status word."""
        return c.state_of(self.status)

    @property
    def has_torque(self) -> bool:
        """Whether it has the torque mode."""
        return len(self._sent_pdos) > len(c.SENT)

    @property
    def heard(self) -> bool:
        """Whether all its process data have arrived since it was set up."""
        return all(self._node.tpdo[number].is_received for number in self._sent_pdos)

    def values(self) -> dict[str, int]:
        """Return the measured items, in increments, increments/s, and thousandths of the rated torque."""
        torque = {"torque": int(self._process_value(3, c.TORQUE_SHOWN))} if self.has_torque else {}
        return torque | {
            "status": self.status,
            "mode": int(self._process_value(1, c.MODE_SHOWN)),
            "position": int(self._process_value(2, c.PLACE)),
            "velocity": int(self._process_value(2, c.SPEED)),
        }

    def _process_value(self, number: int, index: int) -> Any:
        pdo = self._node.tpdo[number]
        # A message shorter than the mapping was sent by another program.
        return pdo[index].raw if len(pdo.data) * 8 >= pdo.length else 0

    # ---------------------------------------------------------------- targets

    def enable(self) -> None:
        """Power on at standstill; earlier targets are dropped."""
        self.wanted, self._halted, self._quick, self._point = True, False, False, None
        self._mode = c.POSITION if self.info.modes and not self.info.modes & c.CAN_TURN else c.VELOCITY
        self._homing, self._goal = False, None
        self._send_object(2, c.TARGET_SPEED, 0)

    def set_velocity(self, speed: int) -> None:
        """Turn at a velocity, in increments/s."""
        self._mode, self._halted, self._point, self._homing = c.VELOCITY, False, None, False
        self._send_object(2, c.TARGET_SPEED, speed)

    def set_torque(self, torque: int) -> None:
        """Push with a torque, in thousandths of the rated one."""
        self._mode, self._halted, self._point, self._homing = c.TORQUE, False, None, False
        self._send_object(4, c.TARGET_TORQUE, torque)

    def set_position(self, place: int) -> None:
        """Go to a position, in increments."""
        self._leaves = self._leaves or self._halted or self._mode != c.POSITION
        self._mode, self._halted, self._homing = c.POSITION, False, False
        self._send_object(3, c.TARGET_PLACE, place)
        self._point, self._point_sent, self._goal = place, False, place

    def bound_speed(self, most: float) -> None:
        """Go to positions no faster than `most`, in increments/s, or than the drive's own setting if that is slower."""
        if not self.profile.bound(most) or self._goal is None or self._mode != c.POSITION or self._halted:
            return
        if not self.wanted or self.state != c.ENABLED or self.status & c.REACHED:
            return
        if self.profile.problem:
            self.halt()
        else:
            # It is on its way, and a drive takes the profile velocity when it takes a point.
            self.set_position(self._goal)

    def start_homing(self, method: int) -> None:
        """Look for the home position by a method of 0x6098. Raises SdoAbortedError, SdoCommunicationError."""
        self.write_object(c.HOMING_METHOD, 0, method)
        self._mode, self._halted, self._point, self._homing = c.HOMING, False, None, True

    def homing_result(self) -> bool | None:
        """Whether homing has found the position, or failed or been ended; None while it goes on."""
        if not self._homing:
            return False
        if self._sent is None or self._sent[1] != c.HOMING or not self._sent[0] & c.START_HOMING:
            return None
        status = self.status
        if status & c.HOMING_ERROR:
            self._homing = False
            return False
        found = c.HOME_FOUND | c.REACHED
        if self._now - self._sent_at < RESEND_AFTER_S or status & found != found:
            return None
        self._homing = False
        return True

    def halt(self) -> None:
        """Brake and hold; in torque mode by the speed 0, because a torque of 0 lets it run out.

        The control word is sent even if it was the last one: another master may have sent one since.
        """
        self._halted, self._point, self._homing, self._sent = True, None, False, None
        self._send_object(2, c.TARGET_SPEED, 0)
        if self._mode == c.TORQUE:
            self._mode = c.VELOCITY
            self._send_object(4, c.TARGET_TORQUE, 0)

    def quick_stop(self) -> None:
        """Brake as hard as the drive can, then power off."""
        self._quick, self.wanted, self._point, self._homing, self._sent = True, None, None, False, None

    def send_control_word(self, now: float) -> None:
        """Send the next control word, if it differs from the last one or that one had no effect."""
        self._now = now
        word = self._next_control_word()
        if word is None:
            return
        mode = self._mode
        if (word, mode) != self._sent or (self._unsettled(word) and now - self._sent_at > RESEND_AFTER_S):
            self._sent, self._sent_at = (word, mode), now
            self._node.rpdo[1][c.MODE].raw = mode
            self._send_object(1, c.CONTROL, word)

    def _next_control_word(self) -> int | None:
        state = self.state
        if state == c.FAULT:
            return self._reset_word()
        if self._quick:
            if not self.heard:
                # Its state is not known yet; a drive that is off accepts this word, too.
                return c.QUICK
            self._quick = state in (c.ENABLED, c.QUICK_STOP)
            return c.QUICK if self._quick else None
        if self.wanted is None:
            return None
        word = c.control_towards(self.wanted, state)
        return self._moving_word(word) if word is not None and state == c.ENABLED and self.wanted else word

    def _reset_word(self) -> int | None:
        """A rising edge of bit 7: first the word without it, then with it."""
        if not self.resets:
            return None
        last = self._sent[0] if self._sent is not None else 0
        return c.RESET if not last & c.RESET else 0

    def _moving_word(self, word: int) -> int:
        if self._halted:
            word |= c.HALT
        if self._homing and self._process_value(1, c.MODE_SHOWN) == c.HOMING:
            word |= c.START_HOMING
        if self._mode == c.POSITION:
            word |= c.AT_ONCE
            if self._point is not None and self._process_value(1, c.MODE_SHOWN) == c.POSITION:
                word |= self._point_bit()
            self._leaves = self._leaves and not word & c.NEW_POINT
            if self._leaves:
                # Until the drive takes the point it would go to the last one that it had, however long ago.
                word |= c.HALT
        return word

    def _point_bit(self) -> int:
        """Return bit "new set-point": a rising edge starts a point; the next edge comes after its acknowledgement."""
        taken = bool(self.status & c.POINT_TAKEN)
        raised = self._sent is not None and bool(self._sent[0] & c.NEW_POINT)
        if self._point_sent and taken:
            self._point = None
            return 0
        self._point_sent = self._point_sent or not (taken or raised)
        return c.NEW_POINT if self._point_sent else 0

    def _unsettled(self, word: int) -> bool:
        if self.state == c.FAULT:
            return self.resets
        return self._point is not None or (self.wanted is not None and (self.state == c.ENABLED) != self.wanted)

    def _send_object(self, number: int, index: int, value: int) -> None:
        pdo = self._node.rpdo[number]
        pdo[index].raw = value
        pdo.transmit()

    # ---------------------------------------------------------------- unsolicited messages

    def update_heard_at(self, now: float) -> None:
        """Update `heard_at` from the time stamps of the messages received."""
        stamps = [self._node.tpdo[number].timestamp for number in self._sent_pdos]
        stamps.append(self._node.nmt.timestamp)
        self.heard_at = max([self.heard_at, *(stamp for stamp in stamps if stamp is not None)])
        # canopen stores every emergency without bound; a drive may send many.
        self._node.emcy.reset()

    def listen(self) -> None:
        """Receive heartbeats again, after another `CanDrive` could not be set up in its place."""
        self._network[self.info.id] = self._node

    def _on_heartbeat(self, state: int) -> None:
        if state == 0:
            self.booted = True
        elif state == _OPERATIONAL:
            self._ignored_heartbeats = 0
        elif self._ignored_heartbeats:
            self._ignored_heartbeats -= 1
        else:
            self.displaced = NMT_STATES.get(state, str(state))

    def _on_emergency(self, entry: Any) -> None:
        if len(self.emergencies) < 100:
            self.emergencies.append((entry.code, entry.register))
