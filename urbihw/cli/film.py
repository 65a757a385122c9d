"""Make a film of a script in a simulated world.

The world is served on its own, the script runs, and what it moves is drawn afterwards.  With --platform webots this
takes as long as the simulation needs, and gives the same film each time; a simulated robot on a wire (--fake --world)
is filmed in real time.
"""

from __future__ import annotations

import argparse
import bisect
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
from urbihw.platforms.scene.state import time_of
from urbihw.settings import one_line

FORMATS: Final = (".webp", ".gif", ".png")
QUALITY: Final = 60
"""Quality of WebP, 1 to 100."""
WIDTH, HEIGHT = 480, 360
SEEN: Final = 24
"""Levels of 255 by which a pixel must change to be seen."""
STATES_PER_PICTURE: Final = 4
"""States that are recorded for a picture: the one at its time is drawn."""
MOST_STATES_HZ: Final = 100
_PROGRAM: Final = """{fast}worldView.record({rate})|;
var Global.filmProblem = nil|;
{{ try {{ load("{script}") }}
  catch (var e if e.isA(Exception) && !e.isA(Exception.Syntax)) {{ filmProblem = "%s: %s" % [e.location, e.message] }}
  catch (var e) {{ filmProblem = "%s" % [e] }} }},
sleep({seconds})|;
if (!filmProblem.isNil) File.save("{problem}", filmProblem)|;
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
    out, problem, program = folder / "states", folder / "problem", folder / "film.u"
    fast = 'webots.mode = "fast"|;\n' if options.platform == "webots" else ""
    program.write_text(_PROGRAM.format(
        fast=fast, rate=repr(min(STATES_PER_PICTURE * options.rate, MOST_STATES_HZ)),
        script=_quoted(options.script.resolve()), seconds=repr(options.seconds), out=_quoted(out),
        problem=_quoted(problem),
    ))  # fmt: skip
    robot = ["--fake", "--world", options.world] if options.fake else ["--url", options.url] if options.url else []
    command = (sys.executable, "-m", "urbihw.cli.main", "serve", "--platform", options.platform, *robot,
               "--port", "0", "--quiet", "--file", str(program))  # fmt: skip
    root = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    done = subprocess.run(command, check=False, env={**os.environ, "PYTHONPATH": path})
    if problem.exists():
        raise CliRefused(one_line(problem.read_text("utf-8", "replace")), EX_RUNTIME)
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
        return _write(_pictures(painter, chosen(recording, options.rate), view), options.output, options.rate)
    except ValueError as error:
        raise CliRefused(str(error), EX_CONFIG) from error
    except OSError as error:
        raise CliRefused(f"{options.output} cannot be written: {error.strerror or error}", EX_CONFIG) from error
    finally:
        painter.close()


def chosen(recording: SceneRecording, rate: float) -> list[bytes]:
    """The states that are drawn, ``rate`` of them in a second: of those that were recorded the nearest to each time.

    Raises ValueError if the simulation has not so many.
    """
    states = recording.states
    if len(states) < 2:
        return states
    if recording.period > 1.001 / rate:
        raise ValueError(f"the simulation gives {1 / recording.period:.3g} states a second: --rate is at most that")
    times = [time_of(state) for state in states]
    number = max(1, round((times[-1] - times[0]) * rate))
    return [states[_nearest(times, times[0] + index / rate)] for index in range(number)]


def _nearest(times: Sequence[float], time: float) -> int:
    """The index of the time that is nearest, of rising ones."""
    index = min(bisect.bisect(times, time), len(times) - 1)
    return index - 1 if index and time - times[index - 1] <= times[index] - time else index


def _pictures(painter: Painter, states: Sequence[bytes], view: ViewPoint) -> Iterator[Any]:
    from PIL import Image

    for state in states:
        yield Image.fromarray(painter.draw(state, view))


def _write(pictures: Iterator[Any], output: Path, rate: float) -> int:
    """Write a film with so many pictures a second, or a folder of pictures; returns the number of pictures.

    Raises ValueError, OSError.
    """
    count, changes = 0, False
    begin: Any = None

    def counted() -> Iterator[Any]:
        nonlocal count, begin, changes
        for picture in pictures:
            count += 1
            begin = begin or picture
            changes = changes or _differ(begin, picture)
            yield picture

    frames = counted()
    if not output.suffix:
        output.mkdir(parents=True, exist_ok=True)
        for picture in frames:
            picture.save(output / f"{count:05}.png")
    elif (first := next(frames, None)) is not None:
        first.save(output, save_all=True, append_images=frames, duration=round(1000 / rate), loop=0, quality=QUALITY,
                   method=4)
    if not count:
        raise ValueError("the simulation gave no states: is the film too short?")
    if count > 1 and not changes:
        if output.suffix:
            output.unlink()
        raise ValueError(f"the film shows nothing: its {count} pictures are the same; does the script move anything?")
    return count


def _differ(one: Any, other: Any) -> bool:
    """Whether one sees that two pictures are not the same: some pixel differs by more than a settling world's noise."""
    from PIL import ImageChops

    most: float = ImageChops.difference(one, other).convert("L").getextrema()[1]  # type: ignore[assignment]
    return most > SEEN


def _quoted(path: Path) -> str:
    return str(path).replace("\\", "\\\\").replace('"', '\\"')
