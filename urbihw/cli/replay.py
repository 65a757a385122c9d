"""Play the wire of a recording: a robot that answers each request as the recorded one did, for a daemon to serve."""

from __future__ import annotations

import argparse
import asyncio
import os
import shlex
import signal
import sys
import tempfile
import threading
from pathlib import Path

from urbihw.cli.options import CliRefused, complain, number, port
from urbihw.daemon.fake import Fake
from urbihw.exitcodes import EX_CONFIG, EX_NOINPUT, EX_OK
from urbihw.kernel.uobject import NotReady
from urbihw.recording.reading import Recording, UnreadableRecording
from urbihw.recording.wire import capture_lines
from urbihw.settings import escape_unprintable


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw replay``."""
    parser.add_argument("file", type=Path, metavar="FILE", help="a recording of urbihw record")
    where = parser.add_mutually_exclusive_group()
    where.add_argument("--pty", metavar="PATH", help="the name of the pseudo terminal (default: one in /tmp)")
    where.add_argument("--tcp", type=port, metavar="PORT", help="a TCP port of this machine instead")
    parser.add_argument("--speed", type=number(0, 1e6, "factor"), default=1.0, metavar="FACTOR",
                        help="answer so many times as fast, 0 at once (%(default)g)")
    parser.add_argument("--strict", action="store_true", help="answer only as long as requests come as recorded")


def run(options: argparse.Namespace) -> int:
    """Play until Ctrl-C or SIGTERM; returns the exit code."""
    try:
        with tempfile.TemporaryDirectory(prefix="urbihw-replay-") as folder:
            capture = Path(folder) / "capture.hex"
            platform = _write_capture(options.file, capture)
            return _play(capture, platform, options)
    except UnreadableRecording as error:
        return complain("urbihw replay", CliRefused(str(error), EX_NOINPUT))
    except (NotReady, OSError) as error:
        return complain("urbihw replay", CliRefused(str(error), EX_CONFIG))


def _write_capture(file: Path, capture: Path) -> str:
    """Write the wire of a recording into a file; returns the platform.  Raises UnreadableRecording, OSError."""
    recording = Recording(file)
    with open(capture, "x", encoding="ascii", opener=lambda path, flags: os.open(path, flags, 0o600)) as opened:
        opened.writelines(f"{line}\n" for line in capture_lines(recording))
    if recording.damage:
        print(f"urbihw replay: {file}: {recording.damage}", file=sys.stderr)
    return recording.head.about.get("platform", "")


def serve_command(platform: str, url: str) -> str:
    """The command that serves a replay, to be copied into a shell; the platform is what the file says."""
    return f"urbihw serve --platform {shlex.quote(escape_unprintable(platform)) if platform else 'NAME'} --url {url}"


def _play(capture: Path, platform: str, options: argparse.Namespace) -> int:
    where = ("--tcp", str(options.tcp)) if options.tcp else ("--pty", *filter(None, (options.pty,)))
    strict = ("--strict",) if options.strict else ()
    ended = threading.Event()
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, lambda *_: ended.set())
    fake = Fake(("replay", str(capture), *where, "--speed", f"{options.speed:g}", *strict, "--until-eof"))
    try:
        url = asyncio.run(fake.url())
        print(f"{url}  ({serve_command(platform, url)})", flush=True)
        while not ended.wait(3600.0):
            pass
        print(fake.tell("compare"))
    finally:
        fake.close()
    return EX_OK
