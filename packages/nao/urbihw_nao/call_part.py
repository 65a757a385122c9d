"""What programs ask of services: their methods, calls, and events of ALMemory."""

from __future__ import annotations

import contextlib
from typing import Any, Final

from urbihw.buses.errors import BadFrame, LinkGone, Unavailable
from urbihw.buses.messages import DeviceReport, FromWorker, Refused, Reply, Request
from urbihw_nao.exchange import LINK_LOST, NaoExchange
from urbihw_nao.finding import LEDS, MEMORY, SONAR
from urbihw_nao.part import Devices, NaoPart
from urbihw_nao.qimessaging.checked import describe_error, to_row, to_text
from urbihw_nao.qimessaging.session import QiCall, QiSubscription
from urbihw_nao.reading import is_bounded

SERVICES: Final = "services"
"""Stands for all that services were told to do, for stops and for who may move."""
BLOCKING_TIMEOUT_S: Final = 1e6
"""Seconds that a call of a program may take."""
HARMLESS: Final = frozenset({
    MEMORY, LEDS, SONAR, "ALBattery", "ALTextToSpeech", "ALVideoDevice", "ALAudioDevice", "ALAudioPlayer", "ALLogger",
    "ALSpeechRecognition", "ServiceDirectory",
})  # fmt: skip
"""Services that move nothing."""
ASKING: Final = ("get", "is", "are", "robotIs", "moveIs", "walkIs", "list", "ping", "version")
"""How methods begin that move nothing."""
BEHAVIOURS: Final = "ALBehaviorManager"
STARTING: Final = ("runBehavior", "startBehavior")
"""Methods that begin a behaviour; the first argument is its name."""
RUNNING: Final = "runBehavior"
"""The one of them that is answered at its end."""
BEGUN: Final = "urbihw/begun"
"""Key of ALMemory under which the robot keeps what was begun here and not stopped since: whether services were told to
do something that may move the robot, and the names of behaviours.  A worker that is killed leaves it to the next one,
and to ``watchdog.py`` on the robot.
"""
MOST_BEGUN: Final = 1000
"""Names that are read from there."""
MOST_EVENTS: Final = 200
STAND_TIMEOUT_S: Final = 3.0
"""Seconds that a walk may need to end in a stop, before ``killAll`` ends everything else."""
ACTIVE_TIMEOUT_S: Final = 0.1
"""Seconds that a stop waits to hear whether the robot walks."""
ENDING: Final = "ending"


def may_move(service: str, method: str) -> bool:
    """Whether a method may move the robot: all of which it is not known that they do not."""
    return service not in HARMLESS and not method.startswith(ASKING)


class CallPart(NaoPart):
    """Requests "describe", "call", "listen" and "unlisten"; see ``driver``."""

    verbs = frozenset({"describe", "call", "listen", "unlisten"})

    def __init__(self, exchange: NaoExchange) -> None:
        super().__init__(exchange)
        self._described: set[str] = set()
        self._events: dict[str, QiSubscription | None] = {}
        self._behaviours: dict[str, None] = {}
        self._moved = False
        self._noted: tuple[bool, tuple[str, ...]] = False, ()
        self._ends_at = 0.0
        self._ends_own = False
        self._ends_behaviours = False
        self._delayed: list[Request] = []

    def begin(self) -> None:
        """See ``Part``: look up again what programs use, and listen to the same events."""
        for name in sorted(self._described):
            # A service that has gone meanwhile, such as that of a program on the robot, fails its own calls only.
            with contextlib.suppress(Unavailable):
                self.exchange.session.look_up(name)
        for key in list(self._events):
            self._listen(key)

    def end(self) -> None:
        """See ``Part``: the subscriptions went with the session."""
        self._events = dict.fromkeys(self._events)
        self._ends_at = 0.0
        self._refuse_delayed(LINK_LOST)

    def request(self, message: Request) -> list[FromWorker]:
        match message.verb:
            case "describe":
                found = self.exchange.session.look_up(str(message.device))
                self._described.add(found.name)
                return [Reply(message.reply_id, True, found.meta.names())]
            case "listen":
                key = str(message.device)
                if self._events.get(key) is None:
                    self._listen(key)
                return [Reply(message.reply_id, True)]
            case "unlisten":
                subscription = self._events.pop(str(message.device), None)
                if subscription is not None:
                    self.exchange.session.stop_listening(subscription)
                return [Reply(message.reply_id, True)]
            case _ if self._ends_at and may_move(str(message.device), message.item):
                self._delayed.append(message)
                return []
            case _:
                self._call(message)
                return []

    def _call(self, message: Request) -> None:
        exchange = self.exchange
        service = exchange.session.look_up(str(message.device))
        begun = self._find_behaviour(message)
        fresh = begun not in self._behaviours

        def answered(call: QiCall) -> None:
            exchange.news.append(Reply(message.reply_id, not call.error, call.value, call.error))
            ended = fresh if call.error else message.item == RUNNING
            if begun and ended and exchange.linked:
                self._behaviours.pop(begun, None)
                self._note_begun()

        if may_move(service.name, message.item):
            # The robot knows it before it begins: the worker may be killed at any moment.
            service.meta.choose(service.name, message.item, message.value)
            self._moved = True
            if begun:
                self._behaviours[begun] = None
            self._note_begun()
        exchange.session.call(service, message.item, *message.value, then=answered, timeout=BLOCKING_TIMEOUT_S)

    def _find_behaviour(self, message: Request) -> str:
        """The name of the behaviour that a call begins, "" if it begins none."""
        if message.device == BEHAVIOURS and message.item in STARTING and message.value:
            return message.value[0] if isinstance(message.value[0], str) else ""
        return ""

    def _note_begun(self) -> None:
        """Tell the robot what was begun here, if that has changed."""
        noted = self.is_moving(), tuple(self._behaviours)
        if noted != self._noted:
            self._noted = noted
            self.exchange.post(self.exchange.memory, "insertData", BEGUN, [noted[0], list(noted[1])])

    def find_moving(self) -> list[Any]:
        """See ``Part``: what was begun by a worker that was killed, or whose daemon was."""
        exchange = self.exchange
        values = to_row(exchange.ask(exchange.memory, "getListData", [BEGUN]), 1)
        try:
            moved, names = to_row(values[0], 2)[:2]
            behaviours = [to_text(name) for name in to_row(names)[:MOST_BEGUN]]
        except BadFrame:
            # There is no such key, or not by us.
            return []
        self._noted = bool(moved), tuple(behaviours)
        if not (moved or behaviours):
            return []
        self._moved = True
        self._behaviours |= dict.fromkeys(behaviours)
        return [SERVICES]

    def _listen(self, key: str) -> None:
        exchange = self.exchange
        if key not in self._events and len(self._events) == MOST_EVENTS:
            raise ValueError(f"{MOST_EVENTS} events of ALMemory are listened to: no more")
        self._events[key] = None
        subscriber = exchange.ask(exchange.memory, "subscriber", key)

        def heard(values: tuple[Any, ...]) -> None:
            if values and is_bounded(values[0]):
                exchange.news.append(DeviceReport("event", key, values[0]))
            else:
                exchange.news.append(Refused("event", key, "its value is too long, or no value for programs"))

        self._events[key] = exchange.session.listen_to_object(subscriber, "signal", heard)

    def stop(self, devices: Devices) -> None:
        """End what services were told to do; a stop of the whole robot ends all motion, also that of other clients.

        The walk ends with its next step.  Everything else ends by ``killAll``, which does not care where the feet are:
        while the robot walks, it is sent as soon as the robot stands.
        """
        if not (devices is None or SERVICES in devices):
            return
        self._refuse_delayed("stopped")
        if devices is not None and not self._moved:
            return
        self._ends_own, self._moved = self._moved, False
        # Behaviours first: they would begin another motion.
        self._stop_behaviours(of_others=devices is None)
        exchange = self.exchange
        exchange.post_motion("stopMove")
        try:
            walks = bool(exchange.ask(exchange.motion, "moveIsActive", timeout=ACTIVE_TIMEOUT_S))
        except (Unavailable, ValueError):
            walks = True
        if walks:
            self._ends_at = exchange.now() + STAND_TIMEOUT_S
        else:
            exchange.post_motion("killAll")
        self._note_begun()

    def stop_again(self, joints_move: bool) -> None:
        """Called while an emergency stop holds: end motions and behaviours that others have begun since the stop."""
        exchange = self.exchange
        if self._ends_at or exchange.busy(ENDING):
            return

        def end_if_moving(answer: QiCall) -> None:
            if joints_move or answer.value:
                self._ends_behaviours = True
                self._ends_own, self._ends_at = False, exchange.now() + STAND_TIMEOUT_S
                exchange.post_motion("stopMove")

        exchange.call(ENDING, exchange.motion, "moveIsActive", then=end_if_moving)

    def send(self) -> None:
        """See ``Part``: end a stop once the robot stands; motions that were asked for meanwhile follow."""
        exchange = self.exchange
        if self._ends_behaviours:
            self._ends_behaviours = False
            self._stop_behaviours(of_others=True)
        if not self._ends_at or exchange.busy(ENDING):
            return
        if exchange.now() >= self._ends_at:
            self._kill_all()
        else:
            exchange.call(ENDING, exchange.motion, "moveIsActive", then=self._end_if_standing)

    def _end_if_standing(self, answer: QiCall) -> None:
        if self._ends_at and not answer.value:
            self._kill_all()

    def _kill_all(self) -> None:
        self._ends_at = 0.0
        self.exchange.post_motion("killAll")
        self._note_begun()
        delayed, self._delayed = self._delayed, []
        for message in delayed:
            try:
                self._call(message)
            except LinkGone:
                raise
            except Exception as error:
                self.exchange.news.append(Reply(message.reply_id, False, error=describe_error(error)))

    def _refuse_delayed(self, reason: str) -> None:
        delayed, self._delayed = self._delayed, []
        self.exchange.news += [Reply(message.reply_id, False, error=reason) for message in delayed]

    def _stop_behaviours(self, of_others: bool) -> None:
        """End the behaviours that were begun here, or all: any of them may move the robot."""
        behaviours, self._behaviours = self._behaviours, {}
        service = self.exchange.find_service(BEHAVIOURS) if behaviours or of_others else None
        if service is None:
            return
        if of_others:
            self.exchange.post(service, "stopAllBehaviors")
        for name in () if of_others else behaviours:
            self.exchange.post(service, "stopBehavior", name)

    def is_moving(self) -> bool:
        """See ``Part``: its end is unknown, so it counts until a stop is over."""
        return self._moved or (self._ends_own and self._ends_at > 0)
