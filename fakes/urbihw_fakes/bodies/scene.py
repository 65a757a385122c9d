"""What a picture of a world depends on, for who draws it elsewhere: the word ``scene`` of the console.

A state is float32, little endian, in base64: time (s), ``qpos``, ``mocap_pos``, ``mocap_quat`` of MuJoCo's data;
``geom_rgba``, ``geom_size``, ``site_rgba`` of its model.
"""

from __future__ import annotations

import base64
from collections.abc import Callable

from urbihw_fakes.bodies.simulation import Simulation
from urbihw_fakes.console import Command


def scene_word(simulation: Simulation, advance: Callable[[], None]) -> dict[str, Command]:
    """The word; ``advance`` brings the robot up to the present time."""

    def scene(words: list[str]) -> str:
        if words:
            simulation.save_model(" ".join(words))
            return "ok"
        advance()
        return base64.b64encode(state_of(simulation)).decode("ascii")

    return {"scene": Command("[FILE]", "show the state of the world, or write its model to a file (.mjb)", scene)}


def state_of(simulation: Simulation) -> bytes:
    """The state: see the top of this file."""
    import numpy

    model, data = simulation.model, simulation.data
    arrays = (data.qpos, data.mocap_pos, data.mocap_quat, model.geom_rgba, model.geom_size, model.site_rgba)
    return bytes(numpy.concatenate([[data.time], *(array.ravel() for array in arrays)]).astype("<f4").tobytes())


