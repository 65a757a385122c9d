"""Walking by speeds: ``ALMotion.move``, its end, and the odometry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from urbihw.buses.errors import BadValue
from urbihw.buses.messages import FromWorker, Reply, Request
from urbihw_nao.exchange import NaoExchange
from urbihw_nao.part import Devices, NaoPart
from urbihw_nao.qimessaging.checked import to_number, to_row
from urbihw_nao.qimessaging.session import QiCall

WALK: Final = "walk"
AXES: Final = ("x", "y", "yaw")
FASTEST: Final[Mapping[str, float]] = {"x": 0.12, "y": 0.08, "yaw": 0.6}
"""m/s and rad/s that NAOqi walks at most, about; it limits them itself too."""
PLACE_CYCLES: Final = 5
"""The place of a robot that does not walk is read in each such cycle."""


class WalkPart(NaoPart):
    """Targets "x", "y" (m/s), "yaw" (rad/s) of ``WALK``; values "x", "y" (m), "theta" (rad), "walks" and "others"
    (whether it walks, and whether somebody else lets it), "speeds" (m/s, m/s, rad/s, measured); "write" of "config":
    the foot-step parameters, names and values.
    """

    verbs = frozenset({"write"})

    def __init__(self, exchange: NaoExchange, begun_here: Callable[[], bool]) -> None:
        """``begun_here``: whether another part has begun what may let it walk."""
        super().__init__(exchange)
        self._begun_here = begun_here
        self._ours = False
        """Whether the present walk, or the last one, was begun here; a walk that was ended goes on to its next step."""
        self._speeds = dict.fromkeys(AXES, 0.0)
        self._config: list[list[Any]] = []
        self._due = self._walks = self._asked = False
        self._cycle = 0

    def begin(self) -> None:
        """See ``Part``: a speed that was not sent before is not sent now."""
        self._due = self._asked = False

    def owns(self, device: Any) -> bool:
        return bool(device == WALK)

    def set_target(self, device: Any, item: str, value: float) -> str:
        if item not in AXES:
            return "no such target"
        self._speeds[item] = value
        self._due = True
        return ""

    def send(self) -> None:
        exchange = self.exchange
        if exchange.busy(WALK):
            return
        if self._asked and exchange.last_error(WALK) and not self._due:
            # It was told already.  The robot stands, and the next speed begins anew.
            self._speeds = dict.fromkeys(AXES, 0.0)
        self._asked = False
        if not self._due:
            return
        self._due = False
        if any(self._speeds.values()):
            self._walks = self._asked = self._ours = True
            steps = [self._config] if self._config else []
            exchange.call(WALK, exchange.motion, "move", *self._speeds.values(), *steps)
        else:
            # Also while it does not walk for us: somebody else may let it walk.
            self._walks = False
            exchange.call(WALK, exchange.motion, "stopMove")

    def request(self, message: Request) -> list[FromWorker]:
        """See ``Part``: the steps of the walk that goes on, too."""
        if message.item != "config":
            raise BadValue(f"walking has no setting {message.item}")
        self._config = [[str(name), float(value)] for name, value in message.value]
        self._due = self._due or self._walks
        return [Reply(message.reply_id, True)]

    def read(self) -> None:
        exchange = self.exchange
        slow = self._cycle % PLACE_CYCLES == 0
        self._cycle += 1
        if (slow or self._walks) and not exchange.busy("place"):
            exchange.call("place", exchange.motion, "getRobotPosition", True, then=self._show_place)
        if slow and not exchange.busy("walking"):
            exchange.call("walking", exchange.motion, "moveIsActive", then=self._show_walking)

    def _show_place(self, call: QiCall) -> None:
        place = map(to_number, to_row(call.value, 3)[:3])
        self._values().update(zip(("x", "y", "theta"), place, strict=True))

    def _show_walking(self, call: QiCall) -> None:
        walks = bool(call.value)
        self._ours = self._walks or self._ours and walks or self._begun_here()
        self._values().update(walks=walks, others=walks and not self._ours)
        if walks:
            self.exchange.call("speeds", self.exchange.motion, "getRobotVelocity", then=self._show_speeds)
        else:
            self._values()["speeds"] = [0.0, 0.0, 0.0]

    def _show_speeds(self, call: QiCall) -> None:
        self._values()["speeds"] = [*map(to_number, to_row(call.value, 3)[:3])]

    def _values(self) -> dict[str, Any]:
        return self.exchange.values.setdefault(WALK, {})

    def drop_targets(self, devices: Devices) -> None:
        if devices is None or WALK in devices:
            self._speeds = dict.fromkeys(AXES, 0.0)
            self._due = False

    def stop(self, devices: Devices) -> None:
        """End a walk with its next step; a stop of the whole robot ends also one that somebody else has begun."""
        if devices is None or (self._walks and WALK in devices):
            self._walks = False
            self.exchange.post_motion("stopMove")

    def is_moving(self) -> bool:
        return self._walks or self._due and any(self._speeds.values())

    def find_moving(self) -> list[Any]:
        """See ``Part``: whether somebody lets it walk."""
        self._walks = bool(self.exchange.ask(self.exchange.motion, "moveIsActive"))
        return [WALK] if self._walks else []
