"""``urbi-image``: fetch images from a server, to save one or to show them (manual, section 18.4)."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused, GetoptParser, complain, number, whole
from urbihw.cli.pictures import PictureFile
from urbihw.cli.reach import add_server, credentials, server
from urbihw.client.lines import Line
from urbihw.exitcodes import INTERRUPTED

PROGRAM: Final = "urbi-image"
FORMATS: Final = {"rgb": 1, "ycrcb": 2, "jpeg": 3, "ppm": 4}
"""Format -> its number in the slots ``format`` (manual, specs/naming-standard) and ``formatDetail`` (platforms/nao)."""
TIMEOUT_S: Final = 10.0


def parser() -> GetoptParser:
    """The options of ``urbi-image``."""
    made = GetoptParser(PROGRAM, "Fetch images from an urbiscript server, to save one (--output) or to show them.")
    add_server(made)
    made.add_argument("-d", "--device", default="camera", help="query image on DEVICE.val (%(default)s)")
    made.add_argument("-o", "--output", type=Path, metavar="FILE",
                      help="save one image to FILE, in the format of its extension")
    made.add_argument("-p", "--period", type=whole(1, 3_600_000), default=100, metavar="MS",
                      help="time between two images, in ms (%(default)s)")
    made.add_argument("-F", "--format", choices=FORMATS, help="set the format of the camera")
    made.add_argument("-r", "--reconstruct", action="store_true", help="switch reconstruction of the camera on (Aibo)")
    made.add_argument("-j", "--jpeg", type=whole(0, 100), metavar="FACTOR",
                      help="set the JPEG quality of the camera, 0 to 100")
    made.add_argument("-R", "--resolution", type=whole(0, 100), metavar="N",
                      help="set the resolution of the camera (0: the largest)")
    made.add_argument("-s", "--scale", type=number(0.01, 100, "factor"), default=1.0, metavar="FACTOR",
                      help="show images larger or smaller by FACTOR")
    return made


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    options = parser().parse(argv)
    try:
        with LobbyClient(server(options), credentials(options)) as link:
            for setting in settings(options):
                link.ask(setting, TIMEOUT_S)
            if options.output is not None:
                taken = one_picture(link, options.device, options.period)
                taken.save(options.output)
                print(f"{options.output}: {taken.kind}, {taken.width} x {taken.height}, {len(taken.data)} bytes")
            else:
                from urbihw.cli.window import show

                show(pictures(link, options.device, options.period), f"{options.device} of {link.peer}", options.scale)
    except CliRefused as error:
        return complain(PROGRAM, error)
    except KeyboardInterrupt:
        return INTERRUPTED
    return 0


def settings(options: argparse.Namespace) -> list[str]:
    """The urbiscript that configures the camera; only the settings given as options are changed."""
    wanted: list[tuple[tuple[str, ...], int]] = []
    if options.format is not None:
        wanted.append((("formatDetail", "format"), FORMATS[options.format]))
    if options.jpeg is not None:
        wanted.append((("quality", "jpegfactor"), options.jpeg))
    if options.resolution is not None:
        wanted.append((("resolution",), options.resolution))
    if options.reconstruct:
        wanted.append((("reconstruct",), 1))
    return [_set(options.device, slots, value) for slots, value in wanted]


def _set(device: str, slots: Sequence[str], value: int) -> str:
    """The urbiscript that sets the first existing one of some slots; it is an error if there is none."""
    text = f'throw "{device} has no slot {slots[-1]}"'
    for slot in reversed(slots):
        text = f'if ({device}.hasSlot("{slot}")) {{ {device}.{slot} = {value} }} else {{ {text} }}'
    return f"{text}; 1"


def picture(line: Line) -> PictureFile:
    """The image in an answer.  Raises CliRefused if the answer is another value."""
    if not line.binaries:
        raise CliRefused(f"the server answered {line.shown[:60]!r}, which is no image; which device is it (--device)?")
    return PictureFile.of(line.binaries[0])


def pictures(link: LobbyClient, device: str, period: int) -> Iterator[PictureFile]:
    """An endless sequence of images, one every ``period`` ms.  A camera that sends only while it is read has none at
    first."""
    deadline = time.monotonic() + TIMEOUT_S
    for line in link.follow(f"every ({period}ms) answers << {device}.val", TIMEOUT_S + period / 1000):
        if not is_empty(line) or time.monotonic() > deadline:
            yield picture(line)


def one_picture(link: LobbyClient, device: str, period: int) -> PictureFile:
    """One image.  A camera that is off without a reader (slot ``on``) has an old one, so its next one is taken."""
    is_off = link.ask(f'{device}.hasSlot("on") && !{device}.on', TIMEOUT_S).shown == "true"
    line = link.ask(f"{device}.val", TIMEOUT_S)
    if is_off:
        line = next(link.follow(f"at ({device}.val->changed?) answers << {device}.val", TIMEOUT_S))
    return next(pictures(link, device, period)) if is_empty(line) else picture(line)


def is_empty(line: Line) -> bool:
    """Whether an answer is an image without content."""
    return bool(line.binaries) and not line.binaries[0].data


if __name__ == "__main__":
    sys.exit(main())
