"""A robot on trial: who asks for motion of which part of its body, and the check that nothing else moves.

A model knows the statements that may move a part, and what they leave behind: a joint that is on its way, a wheel that
turns.  Where nobody has asked for the settling time of the platform (``Plant.settle``), the part must stand and stay.
A part is never faster than what asks for it; one that is being stopped gets no faster.

While a device or the link is lost nothing is asked of the body: no order reaches it.  From its return on, all is.
"""

from __future__ import annotations

import os
import random
import re
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from motions import Kind, Scene
from random_programs import INF, LATE, LEAD, TICK, Plant, Program, plant_of
from test_motion_contract import motion_of

from urbihw.buses import messages as m

SEED = int(os.environ.get("URBIHW_SEED", "1"))
FASTER = 1.1
"""How much faster than what asks for it a part may be."""
BACK = 20.0
"""Seconds in which a device or link that works again must be back."""
UNDER_WAY = 0.1
"""Seconds for which what is on the wire may still make a part faster."""
_WRONG = re.compile(r"syntax error|lookup failed|unexpected|expected ", re.I)
FRESH = 0.5
"""What was written so shortly before a device is back may be what moves it then."""


@dataclass(eq=False)
class Asker:
    """A statement, and what it leaves behind."""

    program: Program
    client: int
    owners: set[int]
    tag: str
    born: float
    ends: float
    over: float = INF
    frozen: float = INF

    def asks(self, now: float) -> bool:
        """Whether it may still move its parts."""
        if self.over < INF:
            return now < self.over + self.program.tail
        if self.frozen < INF and not self.program.steered:
            return now < self.frozen + LATE + self.program.tail
        return True

    def peak(self, part: int, now: float, alone: bool) -> float:
        """The greatest speed that it asks for at a time."""
        most = self.program.parts[part]
        return most if alone and now > self.born + LEAD else max(most, self.program.begins)


@dataclass
class Model:
    """Who asks for motion of which part of the body."""

    askers: list[Asker] = field(default_factory=list)
    armed: list[Asker] = field(default_factory=list)
    device_of: dict[int, Any] = field(default_factory=dict)
    gone: list[tuple[float, Asker]] = field(default_factory=list)
    latched: bool = False

    def begin(self, program: Program, client: int, tag: str, now: float) -> None:
        """A client says a program."""
        made = Asker(program, client, {client}, tag, now, now + program.lasts)
        if program.form == "at":
            self.armed.append(made)
        else:
            self._add(made, now)

    def trip(self, now: float) -> None:
        """The event of each ``at``."""
        for one in self.armed:
            body = Asker(one.program, one.client, {one.client}, one.tag, now, now + one.program.lasts)
            body.frozen = now if one.frozen < INF else INF
            self._add(body, now)

    def _add(self, made: Asker, now: float) -> None:
        for other in self.askers:
            if self.devices(other) & self.devices(made) and other.client != made.client:
                # The one who wrote last has the device; the model does not know who that will be.
                other.owners.add(made.client)
                if other.over == INF:
                    made.owners.add(other.client)
        self.askers.append(made)
        if not made.program.lasts:
            made.over = now + LATE

    def devices(self, one: Asker) -> set[Any]:
        """Whom it writes to."""
        return {self.device_of[part] for part in one.program.parts}

    def pass_time(self, now: float) -> None:
        """Statements end by themselves; what they moved may go on for a while."""
        for one in self.askers:
            if one.over == INF and one.frozen == INF and now > one.ends + LATE:
                one.over = -INF if one.program.rests else now
        self._keep(lambda one: one.asks(now), now)
        self.gone = [(at, one) for at, one in self.gone if now - at <= LEAD]

    def _keep(self, stays: Callable[[Asker], bool], now: float) -> None:
        self.gone += [(now, one) for one in self.askers if not stays(one)]
        self.askers = [one for one in self.askers if stays(one)]

    def stop(self, now: float) -> None:
        """The robot was stopped."""
        self._keep(lambda one: False, now)

    def stood(self, parts: set[int], now: float) -> None:
        """Zero was written to some parts."""
        self._keep(lambda one: one.over == INF or not one.program.parts.keys() <= parts, now)

    def back(self, parts: set[int], now: float) -> None:
        """A device is back: it holds, but for statements that still go on."""
        self._keep(lambda one: one.over > now - FRESH or not one.program.parts.keys() & parts, now)

    def closed(self, client: int, now: float) -> None:
        """A connection ended."""
        self.armed = [one for one in self.armed if one.client != client]
        for one in self.askers:
            one.owners.discard(client)
            if one.client == client:
                one.over = min(one.over, now)
        self._keep(lambda one: bool(one.owners), now)

    def tag_stopped(self, tag: str, now: float) -> None:
        """Whatever has this tag ended."""
        self.armed = [one for one in self.armed if one.tag != tag]
        for one in self.askers:
            if one.tag == tag:
                one.over = min(one.over, now)

    def freeze(self, tag: str, now: float, on: bool) -> None:
        """Whatever has this tag stands still, or goes on."""
        for one in (*self.askers, *self.armed):
            if one.tag == tag and on:
                one.frozen = min(one.frozen, now)
            elif one.tag == tag and one.frozen < INF:
                one.ends, one.frozen = one.ends + now - one.frozen, INF

    def asked(self, part: int) -> bool:
        """Whether anybody asks for motion of a part."""
        return not self.latched and any(part in one.program.parts for one in self.askers)

    def most(self, part: int, now: float) -> float:
        """The greatest speed that anybody asks for, or did a short time ago."""
        all_of = [one for one in (*self.askers, *(old for _, old in self.gone)) if part in one.program.parts]
        return max((one.peak(part, now, len(all_of) == 1) for one in all_of), default=0.0)


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
        self.before = dict.fromkeys(self.parts, INF)
        self.came_at = dict.fromkeys(self.parts, 0.0)
        self.count = self.quiet_ticks = 0
        self.way = 0.0
        self.slowest_rest = 0.0
        self.checking = False
        super().__init__(motion_of(platform), Kind("", 0.0, make=self.plant.make), folder, [])
        self.lab.robot._handle_message = partial(self.hear, self.lab.robot._handle_message)
        self.control = self.lab.kernel.open_lobby()
        self.clients = {0: self.lab.lobby, 1: self.lab.observer}
        self.watch_master()
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
        self.lab.step()
        now = self.now()
        speeds, place = self.motion.look(self.lab)
        self.model.pass_time(now)
        if self.checking:
            self.check(now, speeds, place)
        self.way += max(map(abs, speeds)) * TICK
        self.history.append((now, speeds))

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
                most = FASTER * most + self.plant.more[part]
                self.holds(abs(speeds[part]) <= most, f"part {part} at {speeds[part]:.3f}, asked at most {most:.3f}")
                self.check_part(part, now, speeds[part], place, now < self.clear_at[device])

    def unbind(self, part: int, now: float) -> None:
        """This part may move."""
        self.free_at[part] = now
        self.spot.pop(part, None)
        self.before[part] = INF

    def check_part(self, part: int, now: float, speed: float, place: tuple[float, ...], unknown: bool) -> None:
        """Who is not asked to move gets no faster, stands soon, and stays."""
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
