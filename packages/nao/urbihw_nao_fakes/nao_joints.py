"""The joints of a Nao whose motors move a model: commands and stiffnesses in, angles out.

Choices, as the maker's controllers are not known: the gains, and that the stiffness is the greatest share of the full
voltage.  A slack motor is open: what its turning makes does not brake it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from urbihw_fakes.bodies.simulation import Simulation
from urbihw_nao_fakes.body import STIFF, Joint

STEP = 0.002
"""s of one step of the physics."""
SUBSTEPS = 5
PERIOD = STEP * SUBSTEPS
"""s of a cycle of the motors: as long as that of the robot's DCM."""
GAIN, BRAKE = 12.0, 0.4
"""Share of the full voltage per rad, and per rad/s, that a joint is away from what it is to do."""
COUPLED, COUPLED_TO = "RHipYawPitch", "LHipYawPitch"
"""The hips' two joints with one motor; the left one has it."""


@dataclass
class DrivenJoint(Joint):
    """A joint of the model.

    Attributes:
        held: where its motor holds it just now, on the way to the command: rad. holds_at: how fast that moves, rad/s.
    """

    held: float = 0.0
    holds_at: float = 0.0

    @property
    def driven(self) -> bool:
        """Whether its motor is on."""
        return self.stiffness >= STIFF

    @property
    def arrived(self) -> bool:
        """Whether its motion is over; under a weight it stays a little behind its command."""
        return self.held == self.command

    def hold(self) -> None:
        """Stay where it is."""
        self.command = min(max(self.held if self.driven else self.angle, self.low), self.high)

    def place(self, angle: float) -> None:
        """A hand turns it there."""
        self.angle = self.held = angle
        self.moves_at = self.holds_at = 0.0

    def advance(self, dt: float) -> None:
        """Move the held place on towards the command; the joint itself is moved by the physics."""
        if not self.driven:
            self.held, self.holds_at = self.angle, 0.0
            return
        before, most = self.held, self.fastest * self.share * dt
        way = self.command - before
        self.held = self.command if abs(way) <= most else before + math.copysign(most, way)
        self.holds_at = (self.held - before) / dt


def driven(plain: Joint) -> DrivenJoint:
    """The joint of the model for a plain one."""
    return DrivenJoint(
        plain.name, plain.low, plain.high, plain.fastest, plain.pulled_to, plain.angle, plain.command, held=plain.angle
    )


class Motors:
    """The motors of these joints in a world."""

    def __init__(self, simulation: Simulation, joints: list[DrivenJoint]) -> None:
        # With the package mujoco, which is here if there is a simulation.
        import numpy

        self._numpy, self._simulation = numpy, simulation
        self._joints = joints
        places = [simulation.joint(joint.name) for joint in joints]
        self._places, self.speeds = [place for place, _ in places], [speed for _, speed in places]
        self._turned = [joint for joint in joints if joint.name != COUPLED]
        places = [simulation.joint(joint.name) for joint in self._turned]
        self._turned_places, self._turned_speeds = [place for place, _ in places], [speed for _, speed in places]
        self._actuators = [simulation.actuator(joint.name) for joint in self._turned]
        self._braking = simulation.model.actuator_biasprm[self._actuators, 2].copy()

    def run(self) -> None:
        """Let the physics pass a cycle, in which the motors pull towards the held places; then read the joints."""
        numpy, data = self._numpy, self._simulation.data
        held = numpy.array([joint.held for joint in self._turned])
        holds_at = numpy.array([joint.holds_at for joint in self._turned])
        limits = numpy.array([joint.stiffness if joint.driven else 0.0 for joint in self._turned])
        self._simulation.model.actuator_biasprm[self._actuators, 2] = numpy.where(limits > 0.0, self._braking, 0.0)
        for left in reversed(range(SUBSTEPS)):
            drives = GAIN * (held - holds_at * (left * STEP) - data.qpos[self._turned_places])
            drives += BRAKE * (holds_at - data.qvel[self._turned_speeds])
            data.ctrl[self._actuators] = numpy.clip(drives, -limits, limits)
            self._simulation.step()
        self._read()

    def place(self) -> None:
        """Turn the model's joints to the angles of ours, at rest."""
        data = self._simulation.data
        data.qpos[self._places] = [joint.angle for joint in self._joints]
        data.qvel[self.speeds] = 0.0

    def _read(self) -> None:
        data = self._simulation.data
        angles, speeds = data.qpos[self._places].tolist(), data.qvel[self.speeds].tolist()
        for joint, angle, speed in zip(self._joints, angles, speeds, strict=True):
            joint.angle, joint.moves_at = angle, speed
