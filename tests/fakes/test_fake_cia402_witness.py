"""The simulated drive before an independent witness: canopen's own class for such drives, over a virtual bus."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import can
import canopen
import pytest

from urbihw_fakes.can.node import CanFrame, CanNode
from urbihw_fakes.cia402.dictionary import INCREMENTS, dictionary
from urbihw_fakes.cia402.node import Drive

TIMEOUT_S = 20.0


class Served(can.Listener):
    """A node at the far end of a bus; it lives whenever something passes by."""

    def __init__(self, bus: can.BusABC, node: CanNode) -> None:
        self._bus = bus
        self._node = node

    def on_message_received(self, message: can.Message) -> None:
        """Take a message, and say what there is to say by now."""
        now = time.monotonic()
        frame = CanFrame(message.arbitration_id, bytes(message.data))
        frames = [*self._node.tick(now), *self._node.receive_frame(frame, now)]
        for _, frame in frames:
            self._bus.send(can.Message(arbitration_id=frame.id, data=frame.data, is_extended_id=False))


@pytest.fixture
def master() -> Iterator[Any]:
    """canopen's drive with the number 5, whose process data are those that its class looks for."""
    drive = Drive(5)
    with can.Bus("witness", "virtual") as far:
        notifier = can.Notifier(far, [Served(far, drive)], timeout=0.05)
        # canopen's methods have no types.
        network: Any = canopen.Network()
        network.NOTIFIER_CYCLE = 0.05
        network.connect(channel="witness", interface="virtual")
        kind: Any = canopen.BaseNode402
        node = kind(5, dictionary(5))
        network.add_node(node)
        # Something always passes by, so the drive always lives.
        network.sync.start(0.002)
        try:
            yield node
        finally:
            network.sync.stop()
            network.disconnect()
            notifier.stop()


def set_up(node: Any) -> None:
    node.nmt.state = "PRE-OPERATIONAL"
    for pdo, objects in ((node.tpdo[1], (0x6041, 0x6061, 0x606C)), (node.rpdo[1], (0x6040, 0x6060, 0x60FF))):
        pdo.cob_id = 0x185 if pdo is node.tpdo[1] else 0x205
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.trans_type = 255
        pdo.event_timer = 10 if pdo is node.tpdo[1] else None
        pdo.enabled = True
        pdo.save()
    node.setup_402_state_machine()
    node.nmt.state = "OPERATIONAL"
    node.tpdo[1].wait_for_reception(TIMEOUT_S)


def test_canopens_own_drive_class_walks_it_through_its_states(master: Any) -> None:
    set_up(master)
    master.op_mode = "PROFILED VELOCITY"
    master.state = "OPERATION ENABLED"
    assert (master.state, master.op_mode) == ("OPERATION ENABLED", "PROFILED VELOCITY")
    master.rpdo[1][0x60FF].raw = INCREMENTS
    master.rpdo[1].transmit()
    end = time.monotonic() + TIMEOUT_S
    while master.tpdo[1][0x606C].raw != INCREMENTS:
        assert time.monotonic() < end
        master.tpdo[1].wait_for_reception(TIMEOUT_S)
    assert master.sdo[0x606C].raw == INCREMENTS
    master.state = "SWITCH ON DISABLED"
    assert master.state == "SWITCH ON DISABLED"
    with pytest.raises(canopen.SdoAbortedError):
        master.sdo[0x6041].raw = 0


def test_canopens_own_drive_class_homes_it_and_sets_a_torque(master: Any) -> None:
    set_up(master)
    master.sdo[0x6098].raw = 18
    master.sdo[0x6099][1].raw = 4 * INCREMENTS
    master.sdo[0x6099][2].raw = INCREMENTS
    # On a busy machine an answer may come later than its 0.2 s.
    master.TIMEOUT_CHECK_TPDO = TIMEOUT_S
    master.state = "OPERATION ENABLED"
    assert master.homing(TIMEOUT_S)
    assert abs(master.sdo[0x6064].raw) < INCREMENTS
    master.op_mode = "PROFILED TORQUE"
    master.sdo[0x6071].raw = 100
    end = time.monotonic() + TIMEOUT_S
    while master.sdo[0x606C].raw < INCREMENTS:
        assert time.monotonic() < end
    assert master.sdo[0x6077].raw > 50
    with pytest.raises(canopen.SdoAbortedError, match="0x06090030"):
        master.sdo[0x6060].raw = 99
