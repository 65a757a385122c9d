"""A robot on trial: who asks for motion of which part of its body, and the check that nothing else moves.

A model knows the statements that may move a part, and what they leave behind: a joint that is on its way, a wheel that
turns.  Where nobody has asked for the settling time of the platform (``Plant.settle``), the part must stand and stay.
A part is never faster than what asks for it; one that is being stopped gets no faster.

While a device or the link is lost nothing is asked of the body: no order reaches it.  From its return on, all is.
"""

from __future__ import annotations

import math
import os
import random
import re
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from lab import START
from motions import SPAN, Kind, Scene
from random_model import FASTER, Model
from random_programs import INF, LATE, TICK, Hand, Plant, Push, plant_of
from test_motion_contract import motion_of

from urbihw.buses import messages as m
from urbihw.kernel.uobject import RobotSettings

SEED = int(os.environ.get("URBIHW_SEED", "1"))
BACK = 20.0
"""Seconds in which a device or link that works again must be back."""
UNDER_WAY = 0.1
"""Seconds for which what is on the wire may still make a part faster."""
_WRONG = re.compile(r"syntax error|lookup failed|unexpected|expected ", re.I)
DEAD_MAN = 1.5
"""Seconds of silence that the worker allows, as in life."""
LEAP = 0.05
"""How far a joint that is let go during an emergency stop may move, rad."""
NOTICED = 1.2
"""Seconds in which a motion of another master is noticed while an emergency stop holds."""


@dataclass
class Grip:
    """A hand at a joint: it turns it by ``way`` rad in each tick, for ``ticks``."""

    hand: Hand
    way: float
    ticks: int

    def turn(self, lab: Any) -> None:
        """One tick."""
        if self.ticks:
            self.ticks -= 1
            self.hand.turn(lab, self.way)


def _without(part: int, speeds: tuple[float, ...]) -> tuple[float, ...]:
    """Speeds without that of a part: a hand had it."""
    return tuple(0.0 if index == part else speed for index, speed in enumerate(speeds))


class Trial(Scene):
    """A robot, its clients, what befalls it, and the check at each tick."""

    plant: Plant

    def __init__(self, platform: str, rng: random.Random, folder: Path) -> None:
        self.events: deque[str] = deque(maxlen=30)
        self.plant = plant_of(platform)
        self.model = Model(device_of={part: one for one, parts in self.plant.devices.items() for part in parts})
        self.rng = rng
        self.due: list[tuple[float, Callable[[], None]]] = []
        self.down: dict[Any, bool] = dict.fromkeys(self.plant.devices, False)
        self.missed, self.linked = False, True
        self.sick = 0
        self.dark: set[Any] = set()  # devices without power: they coast, and cannot be braked
        self.faulty: dict[str, float] = {}
        self.clear_at: dict[Any, float] = dict.fromkeys(self.plant.devices, 0.0)
        self.parts = [part for parts in self.plant.devices.values() for part in parts]
        self.free_at = dict.fromkeys(self.parts, 0.0)
        self.spot: dict[int, tuple[float, ...]] = {}
        self.history: deque[tuple[float, tuple[float, ...]]] = deque(maxlen=round(1 / TICK))
        self.trail: deque[tuple[float, tuple[float, ...]]] = deque(maxlen=round(SPAN / TICK) + 1)
        self.grips: dict[int, Grip] = {}
        self.hands = {self.plant.devices[device][0]: hand for device, hand in self.plant.hands.items()}
        self.free_since = dict.fromkeys(self.parts, -START)
        self.stays: dict[int, float] = {}
        self.excused: dict[int, float] = {}
        self.unnoticed: list[tuple[float, Push]] = []
        self.before = dict.fromkeys(self.parts, INF)
        self.came_at = dict.fromkeys(self.parts, 0.0)
        self.count = self.quiet_ticks = 0
        self.befell: Counter[str] = Counter()
        self.way = 0.0
        self.slowest_rest = self.fastest_share = 0.0
        self.checking = False
        super().__init__(motion_of(platform), Kind("", 0.0, make=self.plant.make), folder, [])
        self.lab.robot._handle_message = partial(self.hear, self.lab.robot._handle_message)
        self.control = self.lab.kernel.open_lobby()
        self.clients = {0: self.lab.lobby, 1: self.lab.observer}
        self.set_limits(dict.fromkeys(list(self.plant.limits)[::2], 1.0))
        self.tell(self.control, f"var Global.trip = Event.new|; {self.plant.setup}")
        self.run(2.0)
        self.checking = True

    # ---------------------------------------------------------------- time

    def step(self) -> None:
        """One tick, and the check."""
        now = self.now()
        for when, action in [entry for entry in self.due if entry[0] <= now]:
            self.due.remove((when, action))
            action()
        for grip in self.grips.values():
            grip.turn(self.lab)
        self.lab.step()
        now = self.now()
        speeds, place = self.motion.look(self.lab)
        speeds = self.paces(speeds, place, now)
        self.model.pass_time(now)
        if self.checking:
            self.check(now, speeds, place)
        self.way += max(map(abs, speeds)) * TICK
        self.history.append((now, speeds))

    def paces(self, speeds: tuple[float, ...], place: tuple[float, ...], now: float) -> tuple[float, ...]:
        """The speeds, of joints that hands can take each over ``SPAN``: they go in steps, one for each target."""
        self.trail.append((now, place))
        found = list(speeds)
        for part in self.hands:
            since, old = next(one for one in self.trail if one[0] >= self.free_since[part])
            way = 0.0 if part in self.grips else math.remainder(place[part] - old[part], math.tau)
            found[part] = way / max(SPAN, now - since)
        return tuple(found)

    def check(self, now: float, speeds: tuple[float, ...], place: tuple[float, ...]) -> None:
        """The property."""
        sick = self.sick > 0 or any(self.plant.device(self.lab).faults)
        for what, healed in self.faulty.items():
            self.faulty[what] = now if sick else healed
            self.holds(sick or now < healed + BACK, f"{what} works again, but is not back")
        for device, parts in self.plant.devices.items():
            if self.down[device] or device in self.dark:
                for part in parts:
                    self.unbind(part, now)
                continue
            for part in parts:
                most = self.model.most(part, now)
                if now < self.clear_at[device] + self.plant.settle:
                    most = max(most, self.came_at[part])
                if part in self.grips or now < self.excused.get(part, 0.0):
                    self.unbind(part, now)
                    continue
                most = FASTER * most + self.plant.more[part]
                if part in self.stays and now < self.free_since[part] + 2 * SPAN:
                    most = max(most, LEAP / SPAN)
                self.fastest_share = max(self.fastest_share, abs(speeds[part]) / most)
                self.holds(abs(speeds[part]) <= most, f"part {part} at {speeds[part]:.3f}, asked at most {most:.3f}")
                self.check_part(part, now, speeds[part], place, now < self.clear_at[device])

    def quiet_share(self, seconds: float) -> float:
        """In which share of this time nobody asked for motion."""
        return self.quiet_ticks * TICK / seconds / len(self.parts)

    def unbind(self, part: int, now: float) -> None:
        """This part may move."""
        self.free_at[part] = now
        self.spot.pop(part, None)
        self.before[part] = INF

    def check_part(self, part: int, now: float, speed: float, place: tuple[float, ...], unknown: bool) -> None:
        """Who is not asked to move gets no faster, stands soon, and stays."""
        if not self.model.latched:
            self.stays.pop(part, None)
        elif part in self.stays:
            way = abs(place[part] - self.stays[part])
            self.holds(way <= LEAP, f"part {part} was let go during an emergency stop, and has moved by {way:.3f}")
        if unknown or self.model.asked(part):
            self.unbind(part, now)
            return
        if self.before[part] == INF:
            self.before[part] = self.fastest(part)
        if now - self.free_at[part] <= UNDER_WAY:
            self.before[part] = max(self.before[part], abs(speed))
        most = FASTER * self.before[part] + self.plant.more[part]
        self.holds(abs(speed) <= most, f"part {part} gets faster, though nobody asks: {speed:.3f}")
        quiet = now - self.free_at[part]
        if abs(speed) > self.motion.rest:
            self.slowest_rest = max(self.slowest_rest, quiet)
        if quiet <= self.plant.settle:
            return
        self.quiet_ticks += 1
        self.holds(abs(speed) <= self.motion.rest, f"part {part} moves at {speed:.3f} after {quiet:.2f} s, nobody asks")
        if len(place) == len(self.parts):
            spot = self.spot.setdefault(part, place)
            gone = abs(place[part] - spot[part])
            self.holds(gone <= self.plant.drift, f"part {part} has moved by {gone:.3f}, nobody asks")

    # ---------------------------------------------------------------- hands, other masters, limits

    def grip(self, device: Any, way: float, seconds: float) -> None:
        """A hand takes a joint, and turns it towards the middle of its range by ``way`` rad in some seconds."""
        (part,) = self.plant.devices[device]
        hand = self.plant.hands[device]
        place = self.motion.look(self.lab)[1][part]
        hand.hold(self.lab, True)
        ticks = round(seconds / TICK)
        self.grips[part] = Grip(hand, math.copysign(way / ticks, hand.middle - place), ticks if way else 0)

    def let_go(self, device: Any) -> None:
        """The hand is taken away."""
        (part,) = self.plant.devices[device]
        grip = self.grips.pop(part)
        now = self.now()
        grip.hand.hold(self.lab, False)
        self.note(f"the hand lets {device} go")
        self.free_since[part] = now
        self.history = deque(((at, _without(part, old)) for at, old in self.history), self.history.maxlen)
        if self.model.latched:
            self.stays[part] = self.motion.look(self.lab)[1][part]
        else:
            # Also when it could not be read or written meanwhile: then its own register bounds how fast it comes back.
            self.model.let_go(part, grip.hand.springs, now)

    def pushed(self, push: Push) -> None:
        """Another master moves the robot: while an emergency stop holds, that is noticed."""
        for part in push.parts:
            self.unbind(part, self.now())
            self.stays.pop(part, None)
        if self.model.latched:
            self.excused |= dict.fromkeys(push.parts, self.now() + NOTICED)
            self.unnoticed.append((self.now() + NOTICED, push))
        else:
            self.model.pushed(push, self.now())

    def released(self) -> None:
        """The emergency stop is over: what was not noticed yet goes on."""
        self.model.latched = False
        now = self.now()
        for until, push in self.unnoticed:
            if now < until:
                self.model.pushed(push, now)
        self.unnoticed.clear()

    def set_limits(self, shares: dict[int, float]) -> None:
        """Read the settings, with these shares of the limits of the plant."""
        limits: dict[str, dict[str, float]] = {}
        for part, limit in self.plant.limits.items():
            share = shares.get(part)
            if share is not None:
                limits.setdefault(limit.device, {})[limit.name] = share * limit.most
            most = INF if share is None else share * limit.most * limit.unit + limit.grain
            self.model.limit(part, most, self.now())
        self.note(f"limits are {limits}")
        self.lab.robot.configure(RobotSettings(self.lab.url, 1 / self.lab.tick, dead_man=DEAD_MAN, limits=limits))

    def fastest(self, part: int) -> float:
        """The greatest speed of the last second."""
        return max((abs(old[part]) for _, old in self.history), default=0.0)

    def holds(self, good: bool, why: str) -> None:
        """Fail with the last events if something does not."""
        if not good:
            told = "\n".join(self.events)
            askers = "\n".join(map(str, self.model.askers))
            pytest.fail(f"{self.now():.2f} s: {why}\nURBIHW_SEED={SEED}\n{told}\nasking:\n{askers}", pytrace=False)

    # ---------------------------------------------------------------- the worker

    def hear(self, heard: Callable[[m.FromWorker], None], message: m.FromWorker) -> None:
        """What the worker says of links and devices; it is never believed that something stands."""
        heard(message)
        match message:
            case m.LinkState() if message.up:
                self.linked = True
                for device in self.down:
                    self.is_back(device)
                self.faulty.pop("link", None)
            case m.LinkState() | m.WorkerState():
                self.missed, self.linked = True, False
                self.down = dict.fromkeys(self.down, True)
                self.note(f"  (worker: {message})")
            case m.DeviceState() if message.new == "lost":
                for device in self.members(message.device):
                    self.down[device] = True
                self.note(f"  (worker: {message})")
            case m.DeviceState() if message.new in ("back", "ok"):
                for device in self.members(message.device):
                    self.is_back(device)
            case _:
                pass

    def members(self, device: Any) -> list[Any]:
        """The devices that a name of the worker stands for."""
        return [device] if device in self.down else []

    def is_back(self, device: Any) -> None:
        """A device can be ordered again."""
        if self.down[device]:
            self.note(f"  ({device} is back)")
            self.down[device] = False
            for part in self.plant.devices[device]:
                self.came_at[part] = self.fastest(part)
            self.clear_at[device] = self.now() + LATE
            self.model.back(set(self.plant.devices[device]), self.now())

    # ---------------------------------------------------------------- what is said

    def note(self, text: str) -> None:
        """Remember for the report."""
        self.events.append(f"{self.now():9.2f}  {text}")

    def tell(self, lobby: Any, text: str) -> None:
        """Feed a client's words."""
        self.lab.kernel.feed(lobby, (text + "\n").encode("latin-1"))
        self.lab.run(0)

    def say(self, client: int, text: str) -> None:
        """A client says something."""
        self.note(f"client {client}: {text}")
        self.tell(self.clients[client], text)

    def listen(self) -> None:
        """The programs must be right: what the clients read tells."""
        for number, lobby in (*self.clients.items(), (-1, self.control)):
            for line in lobby.output.take_bytes().decode("latin-1").splitlines():
                if "!!!" in line and "called from" not in line:
                    self.note(f"  client {number} reads {line}")
                    self.holds(not _WRONG.search(line), f"a program of this test is wrong: {line}")
