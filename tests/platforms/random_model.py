"""Who asks for motion of which part of a body: statements and what they leave behind, hands, other masters, limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from random_programs import INF, LATE, LEAD, Program, Push

FASTER = 1.1
"""How much faster than what asks for it a part may be."""
FRESH = 0.5
"""What was written so shortly before a device is back may be what moves it then."""
RANGE = 5.3
"""rad, of a joint."""
NOBODY = -1
"""The client of what no client has asked for."""


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
    stretch: float = 1.0

    def asks(self, now: float) -> bool:
        """Whether it may still move its parts."""
        if self.over < INF:
            return now < self.over + self.program.tail * self.stretch
        if self.frozen < INF and not self.program.steered:
            return now < self.frozen + LATE + self.program.tail * self.stretch
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
    bounds: dict[int, float] = field(default_factory=dict)
    last_bounds: dict[int, tuple[float, float]] = field(default_factory=dict)

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
        self.slow_down(made)
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

    def pushed(self, push: Push, now: float) -> None:
        """Another master does something."""
        program = Program("another master", push.parts, 0.0, push.lasts, form="other")
        self.askers.append(Asker(program, NOBODY, {NOBODY}, "", now, now, over=now))

    def let_go(self, part: int, springs: float, now: float) -> None:
        """A hand lets a joint go, which comes back to its goal, or goes on to it."""
        bound = min(springs, self.bound(part, now))
        program = Program("let go by a hand", {part: bound}, 0.0, RANGE / min(bound, 1.0) + LATE, form="hand")
        self.askers.append(Asker(program, NOBODY, {NOBODY}, "", now, now, over=now))

    def delay(self, seconds: float) -> None:
        """The interpreter does nothing for so long: all that goes on ends later."""
        for one in self.askers:
            one.born, one.ends = one.born + seconds, one.ends + seconds
            one.over += seconds

    def limit(self, part: int, most: float, now: float) -> None:
        """The settings have another limit now."""
        self.last_bounds[part] = now, self.bounds.get(part, INF)
        self.bounds[part] = most
        for one in self.askers:
            self.slow_down(one)

    def slow_down(self, one: Asker) -> None:
        """A joint that a limit slows down is longer on its way."""
        slower = (most / self.bounds.get(part, INF) for part, most in one.program.parts.items() if most < INF)
        one.stretch = max(one.stretch, *slower, 1.0)

    def bound(self, part: int, now: float) -> float:
        """The limit that holds for a part, or did a short time ago."""
        changed, last = self.last_bounds.get(part, (-INF, 0.0))
        most = self.bounds.get(part, INF)
        return max(most, last) if now < changed + LATE else most

    def asked(self, part: int) -> bool:
        """Whether anybody asks for motion of a part."""
        return not self.latched and any(part in one.program.parts for one in self.askers)

    def most(self, part: int, now: float) -> float:
        """The greatest speed that anybody asks for, or did a short time ago."""
        all_of = [one for one in (*self.askers, *(old for _, old in self.gone)) if part in one.program.parts]
        bound = self.bound(part, now)
        peaks = [(one.peak(part, now, len(all_of) == 1), one.program.form) for one in all_of]
        return max((peak if form == "other" else min(peak, bound) for peak, form in peaks), default=0.0)
