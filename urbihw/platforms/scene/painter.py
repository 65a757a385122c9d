"""The process that draws the pictures of ``worldView``: ``python -m urbihw.platforms.scene.painter MODEL WIDTH
HEIGHT``.

A request is a line of JSON, ``[azimuth, elevation, distance, target, size]``, and a state of ``size`` bytes; an answer
is a line ``jpeg SIZE`` and the picture, or a line ``problem TEXT``.  It ends with its input.
"""

from __future__ import annotations

import io
import json
import os
import sys
from pathlib import Path
from typing import IO, Final

from urbihw.extras import install_command
from urbihw.platforms.scene.library import NoMujoco, import_mujoco
from urbihw.platforms.scene.painting import NoPictures, Painter, ViewPoint

QUALITY: Final = 75
"""Quality of the JPEGs, 1 to 95."""


def main() -> None:
    """Answer requests until the input ends."""
    os.nice(5)  # the robot comes first
    requests, answers = sys.stdin.buffer, sys.stdout.buffer
    try:
        painter = _painter(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
    except NoPictures as error:
        _tell(answers, str(error))
        return
    while line := requests.readline():
        azimuth, elevation, distance, target, size = json.loads(line)
        state = requests.read(size)
        try:
            picture = _jpeg(painter.draw(state, ViewPoint(azimuth, elevation, distance, target)))
        except ValueError as error:
            _tell(answers, str(error))
            continue
        answers.write(b"jpeg %d\n" % len(picture) + picture)
        answers.flush()


def _painter(model: Path, width: int, height: int) -> Painter:
    try:
        import PIL.Image  # noqa: F401

        mujoco = import_mujoco()
    except ImportError as error:
        raise NoPictures(f"pictures of the world need Pillow: {install_command('images')}") from error
    except NoMujoco as error:
        raise NoPictures(f"pictures of the world need mujoco: {install_command('mujoco')}") from error
    return Painter(mujoco, model, width, height)


def _jpeg(pixels: object) -> bytes:
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "JPEG", quality=QUALITY)  # type: ignore[arg-type]
    return out.getvalue()


def _tell(answers: IO[bytes], problem: str) -> None:
    answers.write(b"problem " + " ".join(problem.split()).encode() + b"\n")
    answers.flush()


if __name__ == "__main__":
    main()
