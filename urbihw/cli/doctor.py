"""Check whether this machine is ready for a robot."""

from __future__ import annotations

import argparse
import grp
import os
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from pathlib import Path
from typing import Final, Literal

from urbihw import platforms
from urbihw.buses.ports import SerialPort, serial_ports
from urbihw.exitcodes import EX_CONFIG
from urbihw.kernel.uobject import BadConfig

Verdict = Literal["ok", "note", "bad"]
LATENCY: Final = Path("/sys/bus/usb-serial/devices")


@dataclass(frozen=True)
class Finding:
    """One line of the report; a ``bad`` one tells what to do."""

    verdict: Verdict
    text: str


def options(parser: argparse.ArgumentParser) -> None:
    """``urbihw doctor`` takes none."""


def run(options: argparse.Namespace) -> int:
    """Print the findings; 78 if one of them is a problem."""
    findings = [
        *python(sys.version_info[:2]),
        *packages(version),
        *adapters(serial_ports()),
        *dialout(os.getgroups()),
    ]
    for finding in findings:
        print(f"{finding.verdict:5} {finding.text}")
    return EX_CONFIG if any(finding.verdict == "bad" for finding in findings) else 0


def python(found: tuple[int, int]) -> Iterable[Finding]:
    """Check whether this Python is recent enough."""
    shown = ".".join(map(str, found))
    if found >= (3, 11):
        yield Finding("ok", f"Python {shown}")
    else:
        yield Finding("bad", f"Python {shown}: install 3.11 or later")


def packages(version_of: Callable[[str], str]) -> Iterable[Finding]:
    """Check which required packages and which extras are installed."""
    for line in requires("urbihw") or ():
        name = line.split(";")[0].split("[")[0].strip()
        for sign in "<>=!~":
            name = name.split(sign)[0]
        extra = line.partition("extra ==")[2].strip(" \"'")
        if extra == "dev":
            continue
        try:
            yield Finding("ok", f"{name} {version_of(name)}")
        except PackageNotFoundError:
            if extra:
                yield Finding("note", f"{name} is not installed; for what needs it: pip install 'urbihw[{extra}]'")
            else:
                yield Finding("bad", f"{name} is missing: pip install {name}")


def adapters(ports: Iterable[SerialPort]) -> Iterable[Finding]:
    """List the serial ports with their adapters, and check the permission to open them."""
    known = _known_adapters()
    found = False
    for port in ports:
        found = True
        adapter = known.get((port.vendor or 0, port.product or 0), port.description)
        if os.access(port.device, os.R_OK | os.W_OK):
            yield Finding("ok", f"{port.device}: {adapter}")
        else:
            yield Finding("bad", f"{port.device}: {adapter}: no permission; sudo usermod -aG dialout $USER, "
                                 "then log in again")
        latency = LATENCY / Path(port.device).name / "latency_timer"
        if latency.is_file() and int(latency.read_text("ascii")) > 1:
            yield Finding("note", f"{port.device}: the adapter keeps answers for {latency.read_text('ascii').strip()} "
                                  f"ms; make it faster: echo 1 | sudo tee {latency}")
    if not found:
        yield Finding("note", "no serial port found: plug the adapter in, or try --fake")


def dialout(groups: Iterable[int]) -> Iterable[Finding]:
    """Check whether the user is in the group that owns serial ports on Debian."""
    try:
        group = grp.getgrnam("dialout").gr_gid
    except KeyError:
        yield Finding("note", "this system has no group dialout; see who owns the serial ports: ls -l /dev/ttyUSB*")
        return
    if group in groups or os.geteuid() == 0:
        yield Finding("ok", "serial ports may be opened (group dialout)")
    else:
        yield Finding("note", "you are not in the group dialout: sudo usermod -aG dialout $USER, then log in again")


def _known_adapters() -> dict[tuple[int, int], str]:
    known = {}
    for folder in platforms.folders():
        try:
            manifest = platforms.read(folder)
        except BadConfig:
            # ``urbihw platforms`` reports its error.
            continue
        for usb in manifest.usb:
            known[usb.vendor, usb.product] = f"{usb.name} ({manifest.name})"
    return known
