"""The state of a simulated world: the numbers of a model and its data that a picture depends on, as float32.

Little endian, in this order: time (s), ``qpos``, ``mocap_pos``, ``mocap_quat`` of the data; ``geom_rgba``,
``geom_size``, ``site_rgba`` of the model (lamps, crates).  A simulated robot writes the same
(``urbihw_fakes.bodies.scene``).
"""

from __future__ import annotations

import struct
from typing import Any, Final

DATA: Final = ("qpos", "mocap_pos", "mocap_quat")
MODEL: Final = ("geom_rgba", "geom_size", "site_rgba")


def state_of(model: Any, data: Any) -> bytes:
    """Return the state of a model's data as bytes."""
    import numpy

    parts = [[data.time], *(getattr(data, name).ravel() for name in DATA)]
    parts += [getattr(model, name).ravel() for name in MODEL]
    return numpy.concatenate(parts).astype("<f4").tobytes()


def time_of(state: bytes) -> float:
    """Return the time of a state, in seconds of the simulation."""
    return float(struct.unpack_from("<f", state)[0])


def take_state(mujoco: Any, model: Any, data: Any, state: bytes) -> None:
    """Put a state into a model and its data, with all that follows from it.  Raises ValueError for one of another
    model."""
    import numpy

    numbers = numpy.frombuffer(state, "<f4")
    arrays = [*(getattr(data, name) for name in DATA), *(getattr(model, name) for name in MODEL)]
    if len(numbers) != 1 + sum(array.size for array in arrays):
        raise ValueError("the state is that of another model")
    data.time, at = float(numbers[0]), 1
    for array in arrays:
        array.flat[:] = numbers[at : at + array.size]
        at += array.size
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    mujoco.mj_tendon(model, data)
