"""Sixteen sonars in two arrays: where they sit, which fires when, and what it hears."""

from __future__ import annotations

import math

from urbihw_fakes.p3dx.body import Body

FRONT = ((69, 136, 90), (114, 119, 50), (148, 78, 30), (166, 27, 10),
         (166, -27, -10), (148, -78, -30), (114, -119, -50), (69, -136, -90))  # fmt: skip
REAR = ((-157, -136, -90), (-203, -119, -130), (-237, -78, -150), (-255, -27, -170),
        (-255, 27, 170), (-237, 78, 150), (-203, 119, 130), (-157, 136, 90))  # fmt: skip
PLACES = tuple((x / 1000, y / 1000, math.radians(angle)) for x, y, angle in (*FRONT, *REAR))
FARTHEST = 5.0
NEAREST = 0.0
BEAM = (-math.radians(10), 0.0, math.radians(10))


class Sonars:
    """The arrays: each fires one of its sonars per cycle, in the order of POLLING."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self.on = True
        self.orders: list[list[int]] = [list(range(8)), list(range(8, 16))]
        self._turn = [0, 0]

    def poll(self, numbers: bytes) -> None:
        """A new firing order, numbered from 1; arrays that are not named keep theirs."""
        for array in range(2):
            mine = [number - 1 for number in numbers if number and (number - 1) // 8 == array]
            if mine:
                self.orders[array] = mine

    def fire(self, shots: int) -> list[tuple[int, float]]:
        """Return the echoes of ``shots`` shots of each array: (number, m)."""
        heard = {}
        if self.on:
            for array, order in enumerate(self.orders):
                for _ in range(min(shots, len(order))):
                    number = order[self._turn[array] % len(order)]
                    self._turn[array] += 1
                    heard[number] = self.distance(number)
        return sorted(heard.items())

    def distance(self, number: int) -> float:
        """Return the distance in m of the nearest echo in the beam of one sonar."""
        x, y, angle = PLACES[number]
        px, py, heading = self._body.pose
        sx = px + x * math.cos(heading) - y * math.sin(heading)
        sy = py + x * math.sin(heading) + y * math.cos(heading)
        ray = self._body.world.ray
        return max(NEAREST, min(ray(sx, sy, heading + angle + part, FARTHEST) for part in BEAM))
