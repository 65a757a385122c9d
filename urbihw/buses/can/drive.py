"""One CiA 402 drive on a network: how it is set up, walked through its states, aimed and read.

Process data carry what is needed each tick (`cia402.RECEIVED`, `SENT`); all else goes by SDO, while setting up. A drive
that does not let its process data be mapped so cannot be used here, and says why.

So that it stops when this process dies, it is asked to watch our heartbeat (0x1016) and to brake when that ends
(0x6007); drives that cannot do that are taken all the same, and `watches` is False.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

from canopen import SdoAbortedError, SdoCommunicationError

from urbihw.buses.can import cia402 as c
from urbihw.buses.can.network import PortNetwork
from urbihw.buses.can.options import LAST_NODE
from urbihw.buses.errors import Unavailable

MASTER: Final = LAST_NODE + 1
"""Our number on the bus, under which our heartbeat goes out."""
BEAT: Final = 0.1
"""Seconds between heartbeats, ours and theirs."""
PATIENCE: Final = 0.5
"""Seconds without a word after which either side is lost."""
STEP: Final = 0.1
"""Seconds until a control word that had no effect is sent again."""
_QUICK_STOP_ON_LOSS = 3
_CAN_TURN = 0x04  # in 0x6502: profile velocity
_SdoError = (SdoAbortedError, SdoCommunicationError)


@dataclass(frozen=True, slots=True)
class DriveInfo:
    """A drive as `Found` tells of it.

    Attributes:
        id: number of the node.
        name: what it calls itself.
        modes: bits of 0x6502.
        increments: of one turn (0x608F); nan if it does not say.
        low, high: software limits of the position (0x607D), in increments; -inf and inf if it has none.
        most_speed: in increments/s (0x607F); inf if it does not say.
        watches: it stops by itself when we die.
    """

    id: int
    name: str
    modes: int
    increments: float = math.nan
    low: float = -math.inf
    high: float = math.inf
    most_speed: float = math.inf
    watches: bool = False


class Drive:
    """A drive that was set up.

    Attributes:
        info: what it told of itself.
        heard_at: when it last said anything.
        wanted: True for power on, False for off, None for what it is.
        resets: a fault is to be reset.
        booted: it said that it has started; what it was told is gone.
        emergencies: (code, register) of what it reported, until taken.
    """

    def __init__(self, network: PortNetwork, number: int, period: float, now: float) -> None:
        self.heard_at = now
        self.wanted: bool | None = None
        self.resets = False
        self.booted = False
        self.emergencies: list[tuple[int, int]] = []
        self._node = network.node(number, c.dictionary())
        self._control = 0
        self._mode = 0
        self._halted = False
        self._point: int | None = None
        self._point_sent = False
        self._sent: tuple[int, int] | None = None
        self._sent_at = -math.inf
        self._quick = False
        self.info = self._set_up(number, period)
        # From now on: what it says while it is being set up is of no interest.
        self._node.nmt.add_heartbeat_callback(self._beat)
        self._node.emcy.add_callback(self._emergency)
        self._now = now

    # ---------------------------------------------------------------- setting up

    def _set_up(self, number: int, period: float) -> DriveInfo:
        """Raises Unavailable when it cannot be used."""
        try:
            kind = self._node.sdo[0x1000].raw
            if kind & 0xFFFF != c.SERVO:
                raise Unavailable(f"node {number} is no drive after CiA 402 (device type 0x{kind:08X})")
            self._node.nmt.state = "PRE-OPERATIONAL"
            self._map(period)
            self._node.sdo[c.HEARTBEAT].raw = round(BEAT * 1000)
            info = self._ask(number)
            self._node.nmt.state = "OPERATIONAL"
        except _SdoError as error:
            raise Unavailable(f"drive {number} cannot be set up: {error}") from error
        return info

    def _map(self, period: float) -> None:
        for number, objects in c.RECEIVED.items():
            self._map_one(self._node.rpdo[number], objects, 0x100 + 0x100 * number)
        for number, objects in c.SENT.items():
            pdo = self._node.tpdo[number]
            pdo.event_timer = max(1, round(period * 1000))
            self._map_one(pdo, objects, 0x80 + 0x100 * number)

    def _map_one(self, pdo: Any, objects: tuple[int, ...], base: int) -> None:
        pdo.cob_id = base + self._node.id
        pdo.clear()
        for index in objects:
            pdo.add_variable(index)
        pdo.trans_type = 255
        pdo.enabled = True
        pdo.save()

    def _ask(self, number: int) -> DriveInfo:
        turns = self._get(0x608F, 2, 1.0) or 1.0
        return DriveInfo(
            id=number,
            name=str(self._get(0x1008, 0, "")).strip("\0 "),
            modes=int(self._get(c.SUPPORTED, 0, 0)),
            increments=self._get(0x608F, 1, math.nan) / turns,
            low=self._get(0x607D, 1, -math.inf),
            high=self._get(0x607D, 2, math.inf),
            most_speed=self._get(0x607F, 0, math.inf),
            watches=self._watch_us(),
        )

    def _get(self, index: int, sub: int, otherwise: Any) -> Any:
        """An object that not every drive has."""
        try:
            return self.read(index, sub)
        except SdoAbortedError:
            return otherwise

    def _watch_us(self) -> bool:
        try:
            self.write(c.WATCHED, 1, MASTER << 16 | round(PATIENCE * 1000))
            self.write(c.CONNECTION_LOST, 0, _QUICK_STOP_ON_LOSS)
        except SdoAbortedError:
            return False
        return True

    def read(self, index: int, sub: int) -> Any:
        """An object of `cia402.dictionary`. Raises SdoAbortedError, SdoCommunicationError, KeyError."""
        variable = self._node.sdo[index]
        return (variable[sub] if sub or hasattr(variable, "values") else variable).raw

    def write(self, index: int, sub: int, value: int) -> None:
        """Write an object; raises the same."""
        variable = self._node.sdo[index]
        (variable[sub] if sub or hasattr(variable, "values") else variable).raw = value

    # ---------------------------------------------------------------- reading

    @property
    def status(self) -> int:
        """The status word."""
        return int(self._process(1, c.STATUS))

    @property
    def state(self) -> str:
        """Its state."""
        return c.state_of(self.status)

    @property
    def heard(self) -> bool:
        """Whether all its process data have come since it was set up."""
        return all(self._node.tpdo[number].is_received for number in c.SENT)

    def values(self) -> dict[str, int]:
        """What it measures, in increments."""
        return {
            "status": self.status,
            "mode": int(self._process(1, c.MODE_SHOWN)),
            "position": int(self._process(2, c.PLACE)),
            "velocity": int(self._process(2, c.SPEED)),
        }

    def _process(self, number: int, index: int) -> Any:
        pdo = self._node.tpdo[number]
        # A message that is shorter than what was mapped is none of ours.
        return pdo[index].raw if len(pdo.data) * 8 >= pdo.length else 0

    # ---------------------------------------------------------------- aiming

    def enable(self) -> None:
        """Power on, standing still, whatever it was told before."""
        self.wanted, self._halted, self._quick, self._point = True, False, False, None
        self._mode = c.POSITION if self.info.modes and not self.info.modes & _CAN_TURN else c.VELOCITY
        self._put(2, c.TARGET_SPEED, 0)

    def run(self, speed: int) -> None:
        """Turn with a speed."""
        self._mode, self._halted, self._point = c.VELOCITY, False, None
        self._put(2, c.TARGET_SPEED, speed)

    def go(self, place: int) -> None:
        """Go to a position."""
        self._mode, self._halted = c.POSITION, False
        self._put(3, c.TARGET_PLACE, place)
        self._point, self._point_sent = place, False

    def halt(self) -> None:
        """Brake and hold."""
        self._halted, self._point = True, None
        self._put(2, c.TARGET_SPEED, 0)

    def quick_stop(self) -> None:
        """Brake as hard as it can, then power off."""
        self._quick, self.wanted, self._point = True, None, None

    def work(self, now: float) -> None:
        """Send the control word that the moment asks for, if it is not the last one or had no effect."""
        self._now = now
        word = self._word()
        if word is None:
            return
        mode = self._mode
        if (word, mode) != self._sent or (self._unsettled(word) and now - self._sent_at > STEP):
            self._sent, self._sent_at = (word, mode), now
            self._node.rpdo[1][c.MODE].raw = mode
            self._put(1, c.CONTROL, word)

    def _word(self) -> int | None:
        state = self.state
        if state == c.FAULT:
            return self._reset_word()
        if self._quick:
            if not self.heard:
                # What it does is not known yet; one that is off takes this, too.
                return c.QUICK
            self._quick = state in (c.ENABLED, c.QUICK_STOP)
            return c.QUICK if self._quick else None
        if self.wanted is None:
            return None
        word = c.control_towards(self.wanted, state)
        return self._moving_word(word) if word is not None and state == c.ENABLED and self.wanted else word

    def _reset_word(self) -> int | None:
        """An edge of bit 7: without it, then with it."""
        if not self.resets:
            return None
        last = self._sent[0] if self._sent is not None else 0
        return c.RESET if not last & c.RESET else 0

    def _moving_word(self, word: int) -> int:
        if self._halted:
            word |= c.HALT
        if self._mode == c.POSITION:
            word |= c.AT_ONCE
            if self._point is not None and self._process(1, c.MODE_SHOWN) == c.POSITION:
                word |= self._point_bit()
        return word

    def _point_bit(self) -> int:
        """A new point is told by an edge of this bit, which the drive acknowledges; only then comes the next edge."""
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

    def _put(self, number: int, index: int, value: int) -> None:
        pdo = self._node.rpdo[number]
        pdo[index].raw = value
        pdo.transmit()

    # ---------------------------------------------------------------- what it says unasked

    def listen(self, now: float) -> None:
        """Look whether it has said anything."""
        stamps = [self._node.tpdo[number].timestamp for number in c.SENT]
        stamps.append(self._node.nmt.timestamp)
        self.heard_at = max([self.heard_at, *(stamp for stamp in stamps if stamp is not None)])
        # canopen keeps every emergency; a drive may send many.
        self._node.emcy.reset()

    def _beat(self, state: int) -> None:
        if state == 0:
            self.booted = True

    def _emergency(self, entry: Any) -> None:
        if len(self.emergencies) < 100:
            self.emergencies.append((entry.code, entry.register))
