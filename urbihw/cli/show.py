"""Show what happened in a recording: lines, filtered; why a device did what it did; values as CSV."""

from __future__ import annotations

import argparse
import math
import os
import re
import sys
from contextlib import suppress
from pathlib import Path
from typing import Final

from urbihw import platforms
from urbihw.cli.options import CliRefused, complain
from urbihw.exitcodes import EX_NOINPUT, EX_OK
from urbihw.kernel.uobject import BadConfig
from urbihw.recording.reading import NO_SENSE, Recording, UnreadableRecording, in_order
from urbihw.recording.reasons import DeviceReasons
from urbihw.recording.showing import KINDS, USUAL, devices_of, line_of, shown_line
from urbihw.recording.table import write_csv
from urbihw.recording.topics import SETTINGS
from urbihw.recording.wire import capture_lines

_SECONDS: Final = re.compile(r"(\d{1,9}(?:\.\d{1,9})?)s?")


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw show``."""
    parser.add_argument("file", type=Path, metavar="FILE", help="a recording of urbihw record")
    parser.add_argument("--kind", action="append", choices=(*KINDS, "all"), metavar="KIND",
                        help=f"what to show, may be given several times: all, {', '.join(KINDS)} "
                             f"(default: {', '.join(USUAL)})")
    parser.add_argument("--device", metavar="ID", help="only what is about this device, named as on the wire")
    parser.add_argument("--from", type=seconds, default=-math.inf, dest="since", metavar="TIME",
                        help="from so many seconds after the beginning")
    parser.add_argument("--to", type=seconds, default=math.inf, dest="until", metavar="TIME", help="up to this time")
    parser.add_argument("--why", metavar="DEVICE", help="why a device (motor3, or 3) did what it did, see --at")
    parser.add_argument("--at", type=seconds, default=math.inf, metavar="TIME",
                        help="the moment of --why, in seconds (default: the end)")
    parser.add_argument("--csv", action="store_true", help="print the measured values as CSV, in SI units")
    parser.add_argument("--raw", action="store_true", help="with --csv: the raw counts of every tick instead")
    parser.add_argument("--values", metavar="NAME,...", default="", help="with --csv: only these, such as 6.position,7")
    parser.add_argument("--capture", action="store_true",
                        help="print the bytes of the wire as a capture, which urbihw trace decodes")


def run(options: argparse.Namespace) -> int:
    """Show the recording; returns the exit code."""
    try:
        return _run(options)
    except UnreadableRecording as error:
        return complain("urbihw show", CliRefused(str(error), EX_NOINPUT))
    except BrokenPipeError:
        # The reader of a pipe (head) has had enough; the interpreter must not try to write the rest.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    except KeyboardInterrupt:
        print()
    return EX_OK


def _run(options: argparse.Namespace) -> int:
    recording = Recording(options.file)
    if options.csv:
        write_csv(recording, [name for name in options.values.split(",") if name], sys.stdout, raw=options.raw)
    elif options.capture:
        for line in capture_lines(recording):
            print(line)
    elif options.why:
        reasons = DeviceReasons(options.why, joint_ids(recording))
        for message in in_order(recording.messages(until=options.at)):
            reasons.hear(message)
        for line in reasons.lines():
            print(shown_line(line))
    else:
        _show(recording, options)
    if recording.damage:
        print(f"urbihw show: {options.file}: {recording.damage}", file=sys.stderr)
    return EX_OK


def joint_ids(recording: Recording) -> dict[str, str]:
    """The ids of the joints by their names: those of the platform, and of the settings in the recording."""
    named: dict[str, object] = {}
    with suppress(BadConfig):
        named.update(platforms.find(recording.head.about.get("platform", "")).joints)
    for message in recording.messages((SETTINGS,)):
        with suppress(*NO_SENSE):
            devices = message.content()["settings"]["devices"]
            named.update({name: row["id"] if isinstance(row, dict) else row for name, row in devices.items()})
    return {str(name): str(number) for name, number in named.items()}


def _show(recording: Recording, options: argparse.Namespace) -> None:
    chosen = options.kind or USUAL
    topics = () if "all" in chosen else [topic for kind in chosen for topic in KINDS[kind]]
    for message in in_order(recording.messages(topics, options.since, options.until)):
        if options.device is None or options.device in devices_of(message):
            print(line_of(message))


def seconds(text: str) -> float:
    found = _SECONDS.fullmatch(text)
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r} is no time in seconds, such as 12.5s")
    return float(found[1])
