"""Simulated chains by text: Dynamixel servos of both protocols, or Feetech servos."""

from __future__ import annotations

from urbihw_fakes.bioloid.kit import Bioloid
from urbihw_fakes.dynamixel.catalogue import make_servos
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.start import servos_of
from urbihw_fakes.feetech.tables import MODELS


def chain_of(text: str) -> Bioloid | FeetechBus:
    """Return the bus of a list such as "AX-12:1,XL330:5".

    Dynamixel servos of both protocols share a bus. Feetech servos do not share it with them: their packets look like
    those of Dynamixel protocol 1.0, but some instructions and all registers differ.

    Raises:
        UnknownRequest: a part of it is no model and id, or it mixes makes.
    """
    makes = {part.strip().partition(":")[0] in MODELS for part in text.split(",")}
    if makes == {True, False}:
        raise UnknownRequest(f"{text!r}: Dynamixel and Feetech servos do not share one bus")
    return FeetechBus(servos_of(text)) if makes == {True} else Bioloid(units=make_servos(text))
