"""`urbihw film`: which of the recorded states are drawn, and a film in which nothing is to be seen."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from urbihw.cli import film
from urbihw.platforms.scene.recording import SceneRecording
from urbihw.platforms.scene.state import time_of


def recording(step: float, seconds: float) -> SceneRecording:
    """States of a simulation, each with its time."""
    made = SceneRecording(Path("model.xml"), 1 / step)
    for index in range(round(seconds / step) + 1):
        made.add(struct.pack("<f", 100 + index * step))
    return made


@pytest.mark.parametrize(("step", "rate"), [(0.016, 15), (0.016, 24), (0.01, 30), (0.002, 50), (0.04, 25)])
def test_a_film_has_the_pictures_a_second_that_were_asked_for(step: float, rate: float) -> None:
    times = [time_of(state) - 100 for state in film.chosen(recording(step, 4.0), rate)]
    assert len(times) == 4 * rate
    assert all(abs(time - index / rate) <= step / 2 + 1e-4 for index, time in enumerate(times))


def test_a_rate_that_the_simulation_does_not_have_is_refused() -> None:
    with pytest.raises(ValueError, match=r"gives 25 states a second: --rate is at most that"):
        film.chosen(recording(0.04, 4.0), 30)


def test_a_film_that_shows_nothing_fails(tmp_path: Path) -> None:
    image = pytest.importorskip("PIL.Image")

    def write(*levels: int) -> int:
        pictures = iter([image.new("RGB", (16, 16), (level,) * 3) for level in levels])
        return film._write(pictures, tmp_path / "film.webp", 10)

    assert write(0, 0, 200, 0) == 4
    with pytest.raises(ValueError, match="the film shows nothing: its 3 pictures are the same"):
        write(100, 103, 100)
    assert not (tmp_path / "film.webp").exists()
