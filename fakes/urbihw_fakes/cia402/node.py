"""The node: a LocalNode of canopen, which answers SDO and keeps the dictionary, and what that leaves out.

    boot-up and heartbeat as it should be; a reset by the master brings back the settings of power on: those of the
    communication (1000 to 1FFF), so that its heartbeat ends, or all of them
    no SDO, PDO and emergency in STOPPED (CiA 301, NMT states and communication objects)
    values that a drive refuses: a mode or a homing method that it does not have
    process data (PDO): sent by their event timer, taken into the drive, both only in OPERATIONAL
    the watch over the master (0x1016): without its heartbeat an enabled drive does what 0x6007 says

No thread and no clock: frames and times come in through `CanNode`, and what canopen wants to send is gathered.
"""

from __future__ import annotations

import contextlib
from typing import Any

import canopen
from canopen.pdo.base import PdoMap

from urbihw_fakes.can.node import CanFrame, CanNode, Timed
from urbihw_fakes.cia402 import machine as mc
from urbihw_fakes.cia402.dictionary import INCREMENTS, dictionary

STEP = 0.002
"""Seconds of one step of the motor."""
HEARTBEAT_LOST, OVERLOAD = 0x8130, 0x3210
_PREOPERATIONAL, _RESET, _RESET_COMMUNICATION = 128, 129, 130
_COMMUNICATION_OBJECTS = range(0x1000, 0x2000)
_VALUE_RANGE_EXCEEDED = 0x06090030
_CATCH_UP = 500
_MEASURED = frozenset((0x1001, 0x603F, 0x6041, 0x6061, 0x6064, 0x606C, 0x6077))
# What the connection's end does, by 0x6007: nothing, a fault, power off, a quick stop.
_NOTHING, _FAULT, _OFF, _QUICK_STOP = range(4)


class _Task:
    """A message that is sent periodically."""

    def __init__(self, net: _Net, identifier: int, data: bytes, period: float) -> None:
        self._net = net
        self.identifier, self.data, self.period = identifier, bytes(data), period
        self.due = net.now + period

    def stop(self) -> None:
        """End the periodic sending."""
        self._net.tasks.discard(self)

    def update(self, data: bytes) -> None:
        self.data = bytes(data)


class _Net(canopen.Network):
    """canopen's network without a bus: what is sent is kept."""

    def __init__(self) -> None:
        super().__init__()
        self.now = 0.0
        self.sent: list[Timed] = []
        self.tasks: set[_Task] = set()

    def send_message(self, can_id: int, data: Any, remote: bool = False) -> None:
        self.sent.append(Timed(self.now, CanFrame(can_id, bytes(data))))

    def send_periodic(self, can_id: int, data: Any, period: float, remote: bool = False) -> Any:
        task = _Task(self, can_id, bytes(data), period)
        self.tasks.add(task)
        return task

    def pop_sent(self) -> list[Timed]:
        """Return the messages sent since the last call."""
        sent, self.sent = self.sent, []
        return sent


class Drive(CanNode):
    """A drive with this number, switched on.

    Attributes:
        refused: objects that it does not let anybody write, as makers leave some out.
    """

    def __init__(self, number: int = 5) -> None:
        self.number = number
        self.refused: set[int] = set()
        self.powered = True
        self._start()

    def _start(self) -> None:
        self.machine = mc.Machine(INCREMENTS)
        self._net = _Net()
        # canopen's methods have no types.
        node: Any = self._net.create_node(self.number, dictionary(self.number))
        node.add_read_callback(self._read)
        node.add_write_callback(self._write)
        self._node = node
        self._next: float | None = None
        self._sent_at: dict[int, float] = {}
        self._timed: list[tuple[int, Any]] = []
        self._operational = False
        self._booted = False
        self._master_at: float | None = None

    # --- the bus --------------------------------------------------------------------------------------------------

    def receive_frame(self, frame: CanFrame, now: float) -> list[Timed]:
        """Receive a frame of the bus; return the answers."""
        if not self.powered:
            return []
        self._net.now = now
        identifier, data = frame
        if identifier == 0 and data in self._resets():
            self._reset(data[0])
        elif self._is_heard(identifier) and (identifier != 0 or len(data) == 2):
            self._receive_heartbeat(identifier, now)
            try:
                self._net.notify(identifier, bytearray(data), now)
            except Exception:
                # A frame that makes no sense to canopen is one that the drive does not understand.
                pass
        self._update_pdo_state()
        return self._net.pop_sent()

    def _is_heard(self, identifier: int) -> bool:
        """Whether its NMT state lets it hear a message: no SDO in STOPPED, process data in OPERATIONAL only."""
        if identifier == 0x600 + self.number:
            return bool(self._node.nmt.state != "STOPPED")
        return self._operational or not 0x200 <= identifier < 0x580

    def tick(self, now: float) -> list[Timed]:
        """Advance to `now`; return the frames sent until then."""
        if not self.powered:
            self._next = None
            return []
        if self._next is None or now - self._next > _CATCH_UP * STEP:
            self._next = now
        while self._next <= now + 1e-9:
            self._net.now = self._next
            self.machine.step(STEP)
            self._check_master(self._next)
            self._send(self._next)
            self._next += STEP
        return self._net.pop_sent()

    def due(self) -> float | None:
        """Return the end of the present step."""
        if not self.powered:
            return None
        return 0.0 if self._next is None else self._next

    def power_off(self, now: float) -> None:
        """Switch off: the drive loses its configuration."""
        self.powered = False

    def power_on(self, now: float) -> None:
        """Switch the drive on again; it starts anew."""
        if not self.powered:
            self.powered = True
            self._start()

    def fault(self, code: int = OVERLOAD) -> None:
        """Cause a fault with this code; the drive sends an emergency."""
        self.machine.fault(code)
        self._send_emergency(code, 1)

    def _send_emergency(self, code: int, register: int) -> None:
        """Emergencies are sent in PRE-OPERATIONAL and OPERATIONAL only."""
        if self._node.nmt.state != "STOPPED":
            self._node.emcy.send(code, register)

    def _reset(self, command: int) -> None:
        """Take back settings to those of power on; after a reset of the application its power is off, too."""
        self._booted = self._operational = False
        self._timed, self._master_at = [], None
        self._node.nmt.stop_heartbeat()
        stored = self._node.data_store
        for index in [index for index in stored if command == _RESET or index in _COMMUNICATION_OBJECTS]:
            del stored[index]
        if command == _RESET:
            old, self.machine = self.machine, mc.Machine(INCREMENTS)
            self.machine.position, self.machine.speed = old.position, old.speed
            self.machine.switches = old.switches

    def _resets(self) -> list[bytes]:
        """The NMT commands that reset it: application or communication, addressed to it or to all nodes."""
        return [bytes((code, node)) for code in (_RESET, _RESET_COMMUNICATION) for node in (0, self.number)]

    # --- what canopen leaves out ----------------------------------------------------------------------------------

    def _send(self, now: float) -> None:
        if not self._booted:
            # First the boot-up frame, then PRE-OPERATIONAL, from which on heartbeats are sent.
            self._booted = True
            self._operational = False
            self._node.nmt.send_command(_RESET)
            self._node.nmt.send_command(_PREOPERATIONAL)
        for task in sorted(self._net.tasks, key=lambda task: task.identifier):
            while task.due <= now:
                self._net.send_message(task.identifier, task.data)
                task.due += task.period
        if self._operational:
            for number, pdo in self._timed:
                if now >= self._sent_at.get(number, 0.0) + pdo.event_timer / 1000 - 1e-9:
                    self._sent_at[number] = now
                    self._transmit(pdo)

    def _transmit(self, pdo: PdoMap) -> None:
        for variable in pdo:
            variable.raw = self._value(variable.index)
        pdo.transmit()

    def _update_pdo_state(self) -> None:
        """Process data begin and end with OPERATIONAL; their settings are read when it begins."""
        operational = self._node.nmt.state == "OPERATIONAL"
        if operational and not self._operational:
            self._node.tpdo.read()
            self._node.rpdo.read()
            self._timed = [(number, pdo) for number, pdo in self._node.tpdo.items() if pdo.enabled and pdo.event_timer]
            for pdo in self._node.rpdo.values():
                if pdo.enabled and self._store_pdo not in pdo.callbacks:
                    pdo.add_callback(self._store_pdo)
        self._operational = operational

    def _store_pdo(self, pdo: PdoMap) -> None:
        if len(pdo.data) * 8 >= pdo.length:
            for variable in pdo:
                # A value that the drive refuses leaves the object as it was, without an answer.
                with contextlib.suppress(canopen.SdoAbortedError):
                    self._node.set_data(variable.index, variable.subindex, variable.data)

    # --- the watch over the master --------------------------------------------------------------------------------

    def _receive_heartbeat(self, identifier: int, now: float) -> None:
        node, period = self._heartbeat_consumer()
        if period and identifier == 0x700 + node:
            self._master_at = now

    def _heartbeat_consumer(self) -> tuple[int, float]:
        setting = int.from_bytes(self._node.get_data(0x1016, 1), "little")
        return setting >> 16 & 0x7F, (setting & 0xFFFF) / 1000

    def _check_master(self, now: float) -> None:
        period = self._heartbeat_consumer()[1]
        if self._master_at is None or not period or now - self._master_at <= period:
            return
        self._master_at = None
        self._send_emergency(HEARTBEAT_LOST, 0x10)
        action = int.from_bytes(self._node.get_data(0x6007, 0), "little", signed=True)
        if action == _FAULT:
            self.machine.fault(HEARTBEAT_LOST)
        elif action == _OFF:
            self.machine.control(0x0000)
        elif action == _QUICK_STOP:
            self.machine.control(0x0002)

    # --- the dictionary -------------------------------------------------------------------------------------------

    def _value(self, index: int) -> int:
        machine = self.machine
        values = {
            0x1001: int(machine.error != 0),
            0x603F: machine.error,
            0x6041: machine.status(),
            0x6061: machine.mode,
            0x6064: round(machine.position),
            0x606C: round(machine.speed),
            0x6077: max(-0x8000, min(0x7FFF, round(machine.torque))),
        }
        return values[index]

    def _read(self, index: int, subindex: int, od: Any) -> int | None:
        return self._value(index) if index in _MEASURED else None

    def _write(self, index: int, subindex: int, od: Any, data: bytes) -> None:
        value, machine = od.decode_raw(data), self.machine
        _refuse_unless(index not in self.refused)
        match index:
            case 0x1016:
                # The watch begins with the first heartbeat after it was set (CiA 301, object 0x1016).
                self._master_at = None
            case 0x6040:
                machine.control(value)
            case 0x6060:
                _refuse_unless(value in mc.MODES)
                machine.mode = value
            case 0x6071:
                machine.target_torque = value
            case 0x6072:
                machine.most_torque = value
            case 0x6098:
                _refuse_unless(value in mc.HOMING_METHODS)
                machine.homing_method = value
            case 0x6099:
                fast, slow = machine.homing_speeds
                machine.homing_speeds = (value, slow) if subindex == 1 else (fast, value)
            case 0x607C:
                machine.home_offset = value
            case 0x607A:
                machine.target_position = value
            case 0x607D:
                low, high = machine.limits
                machine.limits = (value, high) if subindex == 1 else (low, value)
            case 0x607F:
                machine.most_speed = value
            case 0x6081:
                machine.profile_speed = value
            case 0x6083:
                machine.acceleration = value
            case 0x6085:
                machine.quick_deceleration = value
            case 0x60FF:
                machine.target_speed = value


def _refuse_unless(possible: bool) -> None:
    """Abort the transfer of a value that the object does not take. Raises SdoAbortedError."""
    if not possible:
        raise canopen.SdoAbortedError(_VALUE_RANGE_EXCEEDED)
