"""Walking of a Nao in a world, without steps: the maker's way of walking is not known.

While it walks, its soles glide, and a force that is spread over its whole body, as if the floor leant, brings it to the
speeds that it was told.  It takes no more than ``MOST_PUSH`` and ``MOST_TWIST``: a wall stops it, and it pushes what is
light.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from urbihw_fakes.bodies.simulation import Simulation

FRICTION = 0.02
"""Friction of soles that glide."""
PULL = 50.0
"""1/s: how hard it pulls towards a speed."""
MOST_PUSH, MOST_TWIST = 2.0, 8.0
"""m/s2, rad/s2."""


class Glide:
    """The gliding of the robot whose body is ``base``, on these soles (geoms)."""

    def __init__(self, simulation: Simulation, base: str, soles: Iterable[str]) -> None:
        # With the package mujoco, which is here if there is a simulation.
        import numpy

        self._numpy, self._simulation = numpy, simulation
        self._base = simulation.body(base)
        _, self._root = simulation.joint(base)
        self._parts = numpy.flatnonzero(simulation.model.body_rootid == self._base)
        self._soles = [simulation.geom(name) for name in soles]
        self._friction = simulation.model.geom_friction[self._soles, 0].copy()

    def push(self, walk: Sequence[float] | None) -> None:
        """Walk with these speeds for the coming steps: ahead, to the left, turning, m/s, m/s, rad/s; None: stand."""
        model, data, numpy = self._simulation.model, self._simulation.data, self._numpy
        data.xfrc_applied[self._parts] = 0.0
        model.geom_friction[self._soles, 0] = self._friction if walk is None else FRICTION
        if walk is None:
            return
        _, _, heading = self._simulation.pose(self._base)
        cos, sin = numpy.cos(heading), numpy.sin(heading)
        forward, left, turn = walk
        wanted = numpy.array([forward * cos - left * sin, forward * sin + left * cos])
        root = self._root
        pull = numpy.clip(PULL * (wanted - data.qvel[root : root + 2]), -MOST_PUSH, MOST_PUSH)
        twist = numpy.clip(PULL * (turn - data.qvel[root + 5]), -MOST_TWIST, MOST_TWIST)
        masses, places = model.body_mass[self._parts], data.xipos[self._parts]
        arms = places - masses @ places / masses.sum()
        data.xfrc_applied[self._parts, 0] = masses * (pull[0] - twist * arms[:, 1])
        data.xfrc_applied[self._parts, 1] = masses * (pull[1] + twist * arms[:, 0])
