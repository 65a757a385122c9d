"""A servo that is silent while a new worker looks for the devices of the last one: it is lost, and found again."""

from __future__ import annotations

from pathlib import Path

import pytest
import so101_lab
from bioloid_lab import BAUD, MOTION, Lab
from motions import Kind, Scene

from urbihw_fakes.bioloid import Bioloid


@pytest.mark.parametrize("limits", [{}, {"speed": 1.0}], ids=["", "limit"])
@pytest.mark.parametrize("platform", ["bioloid", "so101"])
def test_a_servo_that_is_silent_while_a_worker_is_replaced_obeys_when_it_answers(
    platform: str, limits: dict[str, float], tmp_path: Path
) -> None:
    def make() -> Lab | so101_lab.Lab:
        if platform == "so101":
            return so101_lab.Lab.ready(limits=limits)
        return Lab.ready(Bioloid(servos=(6, 7), sensors=(), baud=BAUD), limits=limits)

    motion, number, slot = (MOTION, 6, "motor6") if platform == "bioloid" else (so101_lab.MOTION, 1, "shoulder_pan")
    scene = Scene(motion, Kind("", 0.0, make=make), tmp_path, [])
    lab = scene.lab
    lab.say(f"{slot}.load = 1|; {slot}.val = 0.2|;", 1.0)
    lab.kit.faults.start("silence", number)
    scene.worker_killed(0.1)
    scene.run(1.0)
    lab.say(f"{slot}.val = -0.3|;", 0.5)
    assert "lost" in lab.look(f"{slot}.state")
    lab.kit.faults.stop("silence", number)
    scene.run(4.0)
    assert "lost" not in lab.look(f"{slot}.state")
    lab.say(f"{slot}.load = 1|; {slot}.val = 0.5|;", 2.0)
    assert abs(lab.number(f"{slot}.val") - 0.5) < 0.03
