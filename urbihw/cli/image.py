"""``urbi-image``: fetch images from a server, to save one or to show them (manual, section 18.4)."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final

from urbihw.cli.lines import Line
from urbihw.cli.link import Link
from urbihw.cli.options import INTERRUPTED, Parser, Refused, complain
from urbihw.cli.pictures import Picture
from urbihw.cli.reach import add_server, credentials, server

PROGRAM: Final = "urbi-image"
FORMATS: Final = {"rgb": 1, "ycrcb": 2, "jpeg": 3, "ppm": 4}
"""Format -> its number in the slots ``format`` (manual, specs/naming-standard) and ``formatDetail`` (platforms/nao)."""
PATIENCE: Final = 10.0


def parser() -> Parser:
    """The options of ``urbi-image``."""
    made = Parser(PROGRAM, "Fetch images from an urbiscript server, to save one (--output) or to show them.")
    add_server(made)
    made.add_argument("-d", "--device", default="camera", help="query image on DEVICE.val (%(default)s)")
    made.add_argument("-o", "--output", type=Path, metavar="FILE", help="save one image to FILE; its ending says how")
    made.add_argument("-p", "--period", type=_number(1, 3_600_000), default=100, metavar="MS",
                      help="time between two images, in ms (%(default)s)")
    made.add_argument("-F", "--format", choices=FORMATS, help="tell the camera to give this format")
    made.add_argument("-r", "--reconstruct", action="store_true", help="tell the camera to reconstruct (Aibo)")
    made.add_argument("-j", "--jpeg", type=_number(0, 100), metavar="FACTOR",
                      help="tell the camera this JPEG quality, 0 to 100")
    made.add_argument("-R", "--resolution", type=_number(0, 100), metavar="N",
                      help="tell the camera this resolution (0: the biggest)")
    made.add_argument("-s", "--scale", type=_scale, default=1.0, metavar="FACTOR",
                      help="show images larger or smaller by FACTOR")
    return made


def _number(least: int, most: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if not text.isdigit() or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is no whole number from {least} to {most}")
        return int(text)

    return read


def _scale(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.01 <= value <= 100:
        raise argparse.ArgumentTypeError(f"{text!r} is no factor from 0.01 to 100")
    return value


def main(argv: Sequence[str] | None = None) -> int:
    """The command; returns the exit code."""
    options = parser().parse(argv)
    try:
        with Link(server(options), credentials(options)) as link:
            for setting in settings(options):
                link.ask(setting, PATIENCE)
            if options.output is not None:
                taken = picture(link.ask(f"{options.device}.val", PATIENCE))
                taken.save(options.output)
                print(f"{options.output}: {taken.kind}, {taken.width} x {taken.height}, {len(taken.data)} bytes")
            else:
                from urbihw.cli.window import show

                show(pictures(link, options.device, options.period), f"{options.device} of {link.peer}", options.scale)
    except Refused as error:
        return complain(PROGRAM, error)
    except KeyboardInterrupt:
        return INTERRUPTED
    return 0


def settings(options: argparse.Namespace) -> list[str]:
    """The urbiscript that sets up the camera as the options want it: only what was asked for is changed."""
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
    """Set the first of the slots that the device has; an error if it has none."""
    text = f'throw "{device} has no slot {slots[-1]}"'
    for slot in reversed(slots):
        text = f'if ({device}.hasSlot("{slot}")) {{ {device}.{slot} = {value} }} else {{ {text} }}'
    return f"{text}; 1"


def picture(line: Line) -> Picture:
    """The image in an answer.  Raises Refused for another value."""
    if not line.binaries:
        raise Refused(f"the server answered {line.shown[:60]!r}, which is no image; which device is it (--device)?")
    return Picture.of(line.binaries[0])


def pictures(link: Link, device: str, period: int) -> Iterator[Picture]:
    """Images without end, one every ``period`` ms."""
    for line in link.follow(f"every ({period}ms) answers << {device}.val", PATIENCE + period / 1000):
        yield picture(line)


if __name__ == "__main__":
    sys.exit(main())
