"""Make a film of a script in a simulated world.

The world is served on its own, the script runs, and what it moves is drawn afterwards.  With --platform webots this
takes as long as the simulation needs, and gives the same film each time; a simulated robot on a wire (--fake --world)
is filmed in real time.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from urbihw.cli.options import CliRefused, complain, number, whole
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_RUNTIME, INTERRUPTED
from urbihw.extras import install_command
from urbihw.platforms.scene.library import NoMujoco, import_mujoco
from urbihw.platforms.scene.painting import NoPictures, Painter, ViewPoint
from urbihw.platforms.scene.recording import COMPILED, BadRecording, SceneRecording

FORMATS: Final = (".webp", ".gif", ".png")
QUALITY: Final = 60
"""Quality of WebP, 1 to 100."""
WIDTH, HEIGHT = 480, 360
_PROGRAM: Final = """{fast}worldView.record({rate})|;
var Global.filmProblem = nil|;
{{ try {{ load("{script}") }} catch (var e) {{ filmProblem = e }} }},
sleep({seconds})|;
if (!filmProblem.isNil) throw filmProblem|;
worldView.save("{out}")|;
shutdown;
"""


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw film``."""
    view = ViewPoint()
    parser.add_argument("script", type=Path, metavar="FILE.u", help="program to run; it may go on for ever")
    parser.add_argument("-o", "--output", type=_film, default=Path("film.webp"), metavar="FILE",
                        help="film to write: .webp, .gif or .png (animated), or a folder for pictures (film.webp)")
    parser.add_argument("--platform", default="webots", metavar="NAME", help="which robot (%(default)s)")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--url", help="with webots: mujoco://WORLD or mujoco:///PATH")
    where.add_argument("--fake", action="store_true", help="a simulated robot, in the world --world")
    parser.add_argument("--world", default="room", help="with --fake: the simulated world (%(default)s)")
    parser.add_argument("--seconds", type=number(0.1, 600, "time in s"), default=10.0, metavar="S",
                        help="length of the film (%(default)g)")
    parser.add_argument("--rate", type=number(1, 50, "pictures a second"), default=15.0, metavar="HZ",
                        help="pictures a second (%(default)g)")
    parser.add_argument("--width", type=whole(16, 1920), default=WIDTH, metavar="PIXELS", help="(%(default)s)")
    parser.add_argument("--height", type=whole(16, 1080), default=HEIGHT, metavar="PIXELS", help="(%(default)s)")
    parser.add_argument("--azimuth", type=number(-360, 360, "angle in degrees"), metavar="DEG",
                        default=round(math.degrees(view.azimuth)), help="direction of the look (%(default)g)")
    parser.add_argument("--elevation", type=number(-90, 90, "angle in degrees"), metavar="DEG",
                        default=round(math.degrees(view.elevation)), help="below zero: from above (%(default)g)")
    parser.add_argument("--distance", type=number(0, 1000, "distance in m"), default=0.0, metavar="M",
                        help="of the eye; 0: so that all is seen (%(default)g)")
    parser.add_argument("--target", default="", metavar="BODY", help="the body in the middle (the robot, or the world)")


def _film(text: str) -> Path:
    path = Path(text)
    if path.suffix and path.suffix.lower() not in FORMATS:
        raise argparse.ArgumentTypeError(f"a film ends in {', '.join(FORMATS)}; without an ending it is a folder")
    return path


def run(options: argparse.Namespace) -> int:
    """Make the film; returns the exit code."""
    try:
        with tempfile.TemporaryDirectory(prefix="urbihw-film-") as folder:
            count = draw(record(options, Path(folder)), options, Path(folder))
    except CliRefused as error:
        return complain("urbihw film", error)
    except KeyboardInterrupt:
        return INTERRUPTED
    print(f"{options.output}: {count} pictures")
    return EX_OK


def record(options: argparse.Namespace, folder: Path) -> SceneRecording:
    """Serve the world, run the script, and return the states.  Raises CliRefused."""
    if not options.script.is_file():
        raise CliRefused(f"{options.script}: there is no such file", EX_CONFIG)
    out, program = folder / "states", folder / "film.u"
    fast = 'webots.mode = "fast"|;\n' if options.platform == "webots" else ""
    program.write_text(_PROGRAM.format(
        fast=fast, rate=repr(options.rate), script=_quoted(options.script.resolve()), seconds=repr(options.seconds),
        out=_quoted(out),
    ))  # fmt: skip
    robot = ["--fake", "--world", options.world] if options.fake else ["--url", options.url] if options.url else []
    command = (sys.executable, "-m", "urbihw.cli.main", "serve", "--platform", options.platform, *robot,
               "--port", "0", "--quiet", "--file", str(program))  # fmt: skip
    root = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    done = subprocess.run(command, check=False, env={**os.environ, "PYTHONPATH": path})
    if done.returncode or not out.exists():
        raise CliRefused("there is no film: see the lines above", done.returncode or EX_RUNTIME)
    try:
        return SceneRecording.parse(out.read_bytes())
    except BadRecording as error:
        raise CliRefused(str(error), EX_RUNTIME) from error


def draw(recording: SceneRecording, options: argparse.Namespace, folder: Path) -> int:
    """Draw the pictures into the film; returns their number.  Raises CliRefused."""
    try:
        import PIL.Image  # noqa: F401

        mujoco = import_mujoco()
    except ImportError as error:
        raise CliRefused(f"films need Pillow: {install_command('images')}", EX_CONFIG) from error
    except NoMujoco as error:
        raise CliRefused(f"films need mujoco: {install_command('mujoco')}", EX_CONFIG) from error
    model = recording.model
    if recording.compiled:
        model = folder / f"model{COMPILED}"
        model.write_bytes(recording.compiled)
    view = ViewPoint(math.radians(options.azimuth), math.radians(options.elevation), options.distance, options.target)
    try:
        painter = Painter(mujoco, model, options.width, options.height)
    except NoPictures as error:
        raise CliRefused(str(error), EX_CONFIG) from error
    try:
        return _write(_pictures(painter, recording.states, view), options.output, recording.period)
    except ValueError as error:
        raise CliRefused(str(error), EX_CONFIG) from error
    except OSError as error:
        raise CliRefused(f"{options.output} cannot be written: {error.strerror or error}", EX_CONFIG) from error
    finally:
        painter.close()


def _pictures(painter: Painter, states: Sequence[bytes], view: ViewPoint) -> Iterator[Any]:
    from PIL import Image

    for state in states:
        yield Image.fromarray(painter.draw(state, view))


def _write(pictures: Iterator[Any], output: Path, period: float) -> int:
    """Write a film with a picture every ``period`` s, or a folder of pictures; returns the number of pictures.

    Raises ValueError, OSError.
    """
    count = 0

    def counted() -> Iterator[Any]:
        nonlocal count
        for picture in pictures:
            count += 1
            yield picture

    frames = counted()
    if not output.suffix:
        output.mkdir(parents=True, exist_ok=True)
        for picture in frames:
            picture.save(output / f"{count:05}.png")
    elif (first := next(frames, None)) is not None:
        first.save(output, save_all=True, append_images=frames, duration=round(1000 * period), loop=0, quality=QUALITY,
                   method=4)
    if not count:
        raise ValueError("the simulation gave no states: is the film too short?")
    return count


def _quoted(path: Path) -> str:
    return str(path).replace("\\", "\\\\").replace('"', '\\"')
