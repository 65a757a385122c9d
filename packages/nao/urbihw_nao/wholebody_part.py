"""The hands in space (manual, "Whole body motion"): ALMotion moves the whole body so that a hand comes to a place.

The first place that is written switches the balancer of NAOqi on, with both feet fixed; a stop switches it off, and so
does ``IDLE_S`` without a new place.  The arms then hold where they are.  NAOqi comes as near to a place as it can keep
its balance.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.buses.messages import FromWorker, Reply, Request
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.finding import MOTION
from urbihw_nao.part import Devices, NaoPart
from urbihw_nao.qimessaging.checked import to_number, to_row
from urbihw_nao.qimessaging.session import QiCall

EFFECTORS: Final[Mapping[str, str]] = {"LHand": "LArm", "RHand": "RArm"}
"""The hands, and the effectors that they are to NAOqi."""
HANDS: Final = "hands"
"""The device whose watch lets the places of both hands be read often."""
ROBOT_FRAME: Final = 2
"""The frame between the feet: x ahead, y to the left, z up, m."""
STEP_S: Final = 0.2
"""Seconds between two places for one hand at least: NAOqi advises so."""
IDLE_S: Final = 10.0
"""Seconds without a new place after which the balancer is switched off."""
READ_S: Final = 0.1
"""Seconds between two readings of a hand while it is watched, or moved."""
SLOW_READ_S: Final = 1.0
"""The same otherwise."""
KIND: Final = "wholebody"

_Step = tuple[str, tuple[Any, ...]]


class WholeBodyPart(NaoPart):
    """Requests "write" of "pos" (x, y, z in m) of an effector; its values "x", "y", "z"."""

    verbs = frozenset({"write"})

    def __init__(self, exchange: NaoExchange) -> None:
        super().__init__(exchange)
        self._goals: dict[str, tuple[float, ...]] = {}
        self._steps: deque[_Step] = deque()
        self._asked = False
        # What the former worker has left is unknown.
        self._may_be_on = True
        self._is_on = False
        self._controlled: dict[str, float] = {}
        self._wrote_at = -math.inf
        self._hands: tuple[str, ...] = ()
        self._methods: frozenset[str] = frozenset()
        self._watched = False
        self._read_at = -math.inf

    def begin(self) -> None:
        """See ``Part``: which hands there are."""
        info = self.exchange.info
        names = {joint.name for joint in info.joints}
        self._hands = tuple(effector for hand, effector in EFFECTORS.items() if hand in names)
        self._methods = frozenset(info.methods.get(MOTION, ()))
        self._read_at = -math.inf

    def end(self) -> None:
        self._goals.clear()
        self._steps.clear()
        self._asked = False

    def owns(self, device: Any) -> bool:
        return device == HANDS or device in EFFECTORS.values()

    def watch(self, on: bool) -> None:
        self._watched = on

    def set_target(self, device: Any, item: str, value: float) -> str:
        """See ``Part``: there are requests only, for a place is three numbers."""
        return "no such target"

    def request(self, message: Request) -> list[FromWorker]:
        effector = str(message.device)
        if effector not in self._hands or message.item != "pos":
            raise BadValue(f"there is no hand of {effector}")
        if "wbSetEffectorControl" not in self._methods:
            raise BadValue("this robot has no whole body control")
        goal = tuple(map(float, message.value))
        if len(goal) != 3 or not all(map(math.isfinite, goal)):
            raise BadValue("a place is three numbers")
        self._goals[effector] = goal
        self._wrote_at = self.exchange.now()
        return [Reply(message.reply_id, True)]

    # ---------------------------------------------------------------- the cycle

    def send(self) -> None:
        """See ``Part``: one call a tick, for each must have worked before the next one makes sense."""
        exchange = self.exchange
        if exchange.busy(KIND):
            return
        if self._asked:
            self._asked = False
            if exchange.last_error(KIND):
                # It was told already.  The next place begins from the beginning.
                self._switch_off()
                return
        now = exchange.now()
        if not self._steps:
            self._plan(now)
        if self._steps:
            method, arguments = self._steps.popleft()
            exchange.call(KIND, exchange.motion, method, *arguments)
            self._asked = True
        elif self._is_on and not self._goals and now - self._wrote_at > IDLE_S:
            self._switch_off()

    def _plan(self, now: float) -> None:
        """The calls for the next place that is due."""
        due = [effector for effector in self._goals if now - self._controlled.get(effector, -math.inf) >= STEP_S]
        if not due:
            return
        effector = due[0]
        if not self._is_on:
            self._is_on = self._may_be_on = True
            self._steps += [("wbEnable", (True,)), ("wbFootState", ("Fixed", "Legs"))]
            self._steps.append(("wbEnableBalanceConstraint", (True, "Legs")))
        if effector not in self._controlled:
            self._steps.append(("wbEnableEffectorControl", (effector, True)))
        self._steps.append(("wbSetEffectorControl", (effector, list(self._goals.pop(effector)))))
        self._controlled[effector] = now

    def _switch_off(self) -> None:
        exchange = self.exchange
        self._goals.clear()
        self._steps.clear()
        for effector in self._controlled:
            exchange.post_motion("wbEnableEffectorControl", effector, False)
        self._controlled.clear()
        self._is_on = self._may_be_on = False
        if "wbEnable" in self._methods:
            exchange.post_motion("wbEnable", False)

    def read(self) -> None:
        """See ``Part``: where the hands are."""
        exchange, now = self.exchange, self.exchange.now()
        period = READ_S if self._watched or self._is_on else SLOW_READ_S
        if now - self._read_at < period or "getPosition" not in self._methods:
            return
        self._read_at = now
        for effector in self._hands:
            if not exchange.busy(effector):
                self._ask_place(effector)

    def _ask_place(self, effector: str) -> None:
        def show(call: QiCall) -> None:
            place = map(to_number, to_row(call.value, 6)[:3])
            self.exchange.values[effector] = dict(zip(("x", "y", "z"), place, strict=True))

        exchange = self.exchange
        exchange.call(effector, exchange.motion, "getPosition", effector, ROBOT_FRAME, True, then=show)

    # ---------------------------------------------------------------- stops

    def drop_targets(self, devices: Devices) -> None:
        for effector in list(self._goals):
            if devices is None or effector in devices:
                del self._goals[effector]
        if devices is None:
            self._steps.clear()

    def stop(self, devices: Devices) -> None:
        """Switch the balancer off; the other hand of a stopped one loses it too."""
        if devices is None:
            meant = self._may_be_on
        else:
            meant = any(effector in devices for effector in self._controlled)
        if meant:
            self._switch_off()

    def is_moving(self) -> bool:
        """See ``Part``: while the balancer is on, NAOqi moves what it wants."""
        return self._is_on
