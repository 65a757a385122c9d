"""Show the traffic of a robot's bus, decoded, one packet a line; nothing is sent to the robot.

With the url of a robot that a daemon serves, or without any, the daemon shows what its bus worker writes and reads.
With another url (a serial line or a CAN bus) the command only listens there.  With a file it decodes a capture: one of
its own (--save), which says how, the output of spy://, or a log of candump.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Final, TextIO

from urbihw import buses, platforms
from urbihw.buses.capture import CaptureHead, capture_line, lines_of, read_capture
from urbihw.buses.errors import BadFrame, BadUrl, LinkGone, Unavailable
from urbihw.buses.link import Link, Port, Url
from urbihw.buses.trace import Chunk, MakeDecoder, TraceDecoder, TracedPacket
from urbihw.cli.options import CliRefused, number, whole
from urbihw.cli.tracing import open_traffic, platform_of, traffic_of
from urbihw.cli.urls import check_url
from urbihw.exitcodes import EX_CONFIG, EX_NOINPUT, EX_OK, EX_UNAVAILABLE
from urbihw.frozen import frozen
from urbihw.kernel.uobject import BadConfig
from urbihw.started import as_typed

SILENCE_S: Final = 0.5
"""Seconds without a packet that are worth a line."""
_LISTEN: Final = {"serial", "can", "pipe"}
"""Kinds of ports where listening says nothing to the robot."""
_MOST_FRAMES: Final = 1000

Item = Chunk | str | int
"""A chunk, the name of an exchange in a capture, or how many chunks were lost."""


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw trace``."""
    parser.add_argument("where", nargs="?", default="", metavar="URL|FILE",
                        help="a port, or a capture; default: the robot that is served on this machine")
    parser.add_argument("--socket", type=Path, metavar="PATH", help="control socket of the robot")
    parser.add_argument("--platform", metavar="NAME", help="how to decode it (default: as the daemon's robot)")
    parser.add_argument("--count", type=whole(1, 10**9, "number of packets"), metavar="N", help="end after N packets")
    parser.add_argument("--seconds", type=number(0.001, 1e9, "time in seconds"), metavar="S",
                        help="end after S seconds")
    parser.add_argument("--bytes", action="store_true", help="show the bytes of each packet, too")
    parser.add_argument("--save", type=Path, metavar="FILE",
                        help="write the undecoded traffic to FILE; it may contain passwords")
    parser.add_argument("--json", action="store_true", help="print each packet as a line of JSON")


def run(options: argparse.Namespace) -> int:
    """Show the traffic; returns the exit code."""
    try:
        return _run(options)
    except CliRefused as error:
        print(f"urbihw: {error}", file=sys.stderr)
        return error.code
    except (BadConfig, BadUrl) as error:
        print(f"urbihw: {error}", file=sys.stderr)
        return EX_CONFIG
    except (BadFrame, Unavailable, LinkGone) as error:
        print(f"urbihw: {error}", file=sys.stderr)
        return EX_NOINPUT if isinstance(error, BadFrame) else EX_UNAVAILABLE


@frozen(slots=False)
class TrafficSource:
    """Where the traffic comes from.

    Attributes:
        items: the traffic.
        head: how it is decoded.
        until: the time (``time.monotonic``) at which it is cut off.
    """

    items: Iterable[Item]
    head: CaptureHead
    until: float = math.inf


def _run(options: argparse.Namespace) -> int:
    until = time.monotonic() + options.seconds if options.seconds else math.inf
    where, wanted = options.where, options.platform or ""
    if where and Path(where).is_file():
        if options.save is not None and options.save.exists() and options.save.samefile(where):
            raise CliRefused(f"--save: {options.save} is what is read: name another file", EX_CONFIG)
        try:
            with open(where, encoding="ascii", errors="replace") as file:
                return _show_file(file, wanted, options)
        except OSError as error:
            raise CliRefused(f"{where}: {error.strerror}", EX_NOINPUT) from error
    if where:
        check_url(where)
    traffic = open_traffic(options.socket) if options.socket is not None else traffic_of(where)
    if traffic is not None:
        with traffic:
            told = _with_platform(str(traffic.path), CaptureHead(platform_of(traffic.path), traffic.devices), wanted)
            return _show(TrafficSource(traffic.chunks(until), told, until), options)
    if not where:
        serve = as_typed("urbihw serve")
        raise CliRefused(f"no daemon answers; start one ({serve}), or name a port or a capture", EX_UNAVAILABLE)
    if _names_no_port(where):
        raise CliRefused(f"no such file or port: {where}", EX_NOINPUT)
    head = _with_platform(where, CaptureHead(_guess(where), guessed=True), wanted)
    return _show(TrafficSource(listen(where, until), head, until), options)


def _show_file(file: TextIO, wanted: str, options: argparse.Namespace) -> int:
    """Show a capture.  Raises CliRefused, BadConfig, BadFrame."""
    lines = lines_of(file)
    first = next(lines, "")
    head = _with_platform(options.where, CaptureHead.parse(first), wanted)
    return _show(TrafficSource(read_capture(itertools.chain((first,), lines)), head), options)


def _names_no_port(where: str) -> bool:
    """Whether a text that names nothing there was rather meant as a file than as a serial port."""
    path = Path(where.partition("?")[0])
    return "://" not in where and path.parent != Path("/dev") and not path.exists()


def _with_platform(source: str, head: CaptureHead, wanted: str) -> CaptureHead:
    """Return how traffic is decoded, by what is known of it, and what the user wants.

    Raises CliRefused for another kind of robot than it comes from, BadConfig for one that there is not.
    """
    if not wanted:
        return head
    known = "" if head.guessed else head.platform
    if known and _decoder_of(wanted) is not _decoder_of(known):
        raise CliRefused(f"{source} is the traffic of a {known}, not of a {wanted}: leave --platform out", EX_CONFIG)
    return CaptureHead(known or wanted, head.devices)


def _guess(url: str) -> str:
    """The platform for a port that no daemon serves: servos on a serial line."""
    return "chain" if Url.parse(url).scheme == "serial" else ""


def _decoder_of(name: str) -> MakeDecoder:
    """Return what makes the decoder of a platform.  Raises CliRefused, BadConfig."""
    if not name:
        known = ", ".join(manifest.name for manifest in platforms.manifests() if manifest.trace)
        raise CliRefused(f"how is it decoded? Give --platform, one of: {known}", EX_CONFIG)
    return platforms.load_trace(platforms.find(name))


def listen(url: str, until: float) -> Iterator[Chunk]:
    """Yield what arrives on a port, without writing to it.  Raises BadUrl, CliRefused, Unavailable, LinkGone."""
    scheme = Url.parse(url).scheme
    if scheme not in _LISTEN:
        raise CliRefused(f"no daemon serves {url}, and {scheme}:// cannot listen only: start a daemon", EX_CONFIG)
    with closing(buses.open(url)) as port:
        while (now := port.clock.now()) < until:
            for data in _read(port, min(until, now + 1.0)):
                yield Chunk(port.clock.now(), "<", data)


def _read(port: Port, deadline: float) -> Iterable[bytes]:
    if isinstance(port, Link):
        data = port.read(4096, deadline)
        return [data] if data else []
    from urbihw.buses.can.port import can_port  # It needs python-can, which not everybody has.

    return [frame.id.to_bytes(2, "big") + frame.data for frame in can_port(port).receive(_MOST_FRAMES, deadline)]


def _show(source: TrafficSource, options: argparse.Namespace) -> int:
    """Print the packets until the end, or the number that is wanted."""
    make = _decoder_of(source.head.platform)
    printer = Printer(sys.stdout, options.bytes, options.json, options.count or 0)
    try:
        if options.save is None:
            _print(source, make, printer, None)
        else:
            with open(options.save, "w", encoding="ascii", opener=_private) as save:
                save.write(source.head.line() + "\n")
                _print(source, make, printer, save)
    except KeyboardInterrupt:
        print()
    except BrokenPipeError:
        # The reader of a pipe (head) has had enough; the interpreter must not try to write the rest.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EX_OK
    except OSError as error:
        if options.save is None or isinstance(error, Unavailable | LinkGone):
            raise
        raise CliRefused(f"{options.save}: {error.strerror}", EX_CONFIG) from error
    if not options.json:
        print(printer.summary(), file=sys.stderr)
    return EX_OK


def _private(path: str, flags: int) -> int:
    """Open a file that only its owner can read: messages to robots may contain passwords."""
    return os.open(path, flags, 0o600)


def _print(source: TrafficSource, make: MakeDecoder, printer: Printer, save: TextIO | None) -> None:
    devices = source.head.devices
    decoder: TraceDecoder = make(devices)
    for item in source.items:
        if isinstance(item, Chunk):
            if save is not None:
                save.write(capture_line(item) + "\n")
            printer.show(decoder.feed(item))
        else:
            printer.show(decoder.flush())
            decoder = make(devices)
            printer.note(f"[{item}]" if isinstance(item, str) else f"{item} pieces of the traffic were lost")
        if printer.is_full:
            return
    rest = decoder.flush()
    if time.monotonic() >= source.until:
        # The answer to the last question may still have been on its way.
        rest = [packet for packet in rest if packet.what != "no answer"]
    printer.show(rest)


class Printer:
    """Prints packets.

    Attributes:
        is_full: the wanted number of packets is printed.
    """

    def __init__(self, stream: TextIO, with_bytes: bool, as_json: bool, most: int) -> None:
        self._stream = stream
        self._with_bytes = with_bytes
        self._as_json = as_json
        self._most = most
        self._first: float | None = None
        self._last = 0.0
        self._count = self._damaged = self._silent = 0
        self.is_full = False

    def show(self, packets: Iterable[TracedPacket]) -> None:
        """Print packets, one line for each."""
        for packet in packets:
            if self.is_full:
                return
            self._count += 1
            self._damaged += packet.what == "?"
            self._silent += packet.what == "no answer"
            if self._first is None:
                self._first = self._last = packet.time
            gap = packet.time - self._last
            if gap >= SILENCE_S:
                self.note(f"nothing for {gap:.2f} s")
            self._write(self._json(packet) if self._as_json else self.line(packet, gap))
            self._last = max(self._last, packet.time)
            self.is_full = bool(self._most) and self._count >= self._most
        self._stream.flush()

    def note(self, text: str) -> None:
        """Print something that is no packet."""
        self._write(json.dumps({"note": text}) if self._as_json else f"-- {text}")

    def line(self, packet: TracedPacket, gap: float) -> str:
        """One packet as a line: time, time since the last one, direction, device, instruction, values, verdict."""
        cells = (
            f"{packet.time - (self._first or 0.0):11.6f} {max(gap, 0.0) * 1000:+9.3f} ms", packet.direction,
            f"{packet.device:>3}", f"{packet.what:12}", packet.detail,
            {"ok": "checksum ok", "bad": "", "": ""}[packet.check],
            f"!! {packet.problem}" if packet.problem else "",
            f"[{packet.data.hex(' ').upper()}]" if self._with_bytes and packet.data else "",
        )  # fmt: skip
        return "  ".join(cell for cell in cells if cell).rstrip()

    def summary(self) -> str:
        """What was printed, in one line."""
        seconds = self._last - (self._first or 0.0)
        return (f"{self._count} packets in {seconds:.3f} s, {self._damaged} damaged, "
                f"{self._silent} requests without an answer")

    @staticmethod
    def _json(packet: TracedPacket) -> str:
        return json.dumps({
            "time": packet.time, "direction": packet.direction, "device": packet.device, "what": packet.what,
            "detail": packet.detail, "check": packet.check, "problem": packet.problem, "data": packet.data.hex(),
        })  # fmt: skip

    def _write(self, text: str) -> None:
        # What robots send goes to a terminal: no control characters.
        print("".join(sign if sign.isprintable() else "?" for sign in text), file=self._stream)
