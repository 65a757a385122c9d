"""Check whether this machine and its robot are well.

Without a url: the machine.  With the url of a robot: its bus, too; with --mend, return delays of servos are written.
"""

from __future__ import annotations

import argparse
import grp
import json
import os
import sys
import time
from collections.abc import Callable, Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from urbihw import platforms
from urbihw.buses.errors import BadUrl, LinkGone, Unavailable
from urbihw.buses.link import Url
from urbihw.buses.ports import SerialPort, serial_ports
from urbihw.cli.dialogue import Dialogue
from urbihw.cli.machine import ReportLine, check_machine, clock_jump
from urbihw.cli.options import CliRefused
from urbihw.cli.ports_in_use import open_line
from urbihw.cli.robot_check import BusReport, check_line, check_served, mend_delays, mend_latency
from urbihw.cli.scan_ports import adapter_name
from urbihw.cli.tracing import traffic_of
from urbihw.cli.urls import check_url
from urbihw.exitcodes import EX_CONFIG
from urbihw.extras import required_packages

LATENCY: Final = Path("/sys/bus/usb-serial/devices")
_MEASURED: Final = {"serial", "pipe", "socket"}
"""Kinds of ports whose servos can be asked without a daemon."""


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw doctor``."""
    parser.add_argument("url", nargs="?", default="", metavar="URL",
                        help="of a robot, such as /dev/ttyUSB0?baud=1000000")
    parser.add_argument("--mend", action="store_true",
                        help="after a question each, set the adapter's latency timer and the servos' return delays")
    parser.add_argument("--json", action="store_true", help="print the findings as JSON")


def run(options: argparse.Namespace) -> int:
    """Print the findings; 78 if one of them is a problem."""
    if options.mend and (not options.url or options.json):
        print("urbihw: --mend takes the url of a bus of servos, and no --json", file=sys.stderr)
        return EX_CONFIG
    if options.url:
        try:
            check_url(options.url)
        except BadUrl as error:
            print(f"urbihw: {error}", file=sys.stderr)
            return EX_CONFIG
    before = time.time() - time.monotonic()
    report = BusReport()
    findings: list[ReportLine] = []

    def tell(found: Iterable[ReportLine]) -> None:
        for finding in found:
            findings.append(finding)
            if not options.json:
                print(f"{finding.verdict:5} {finding.text}", flush=True)

    tell(python(sys.version_info[:2]))
    tell(packages(version, "urbihw"))
    folders = platforms.folders()
    tell(robots(folders))
    for wheel in sorted({folder.wheel for folder in folders if folder.wheel}):
        tell(packages(version, wheel))
    tell(adapters(serial_ports()))
    tell(dialout(os.getgroups()))
    tell(check_machine())
    if options.url:
        report = robot(options.url, options.mend, tell)
    tell(clock_jump(before, time.time() - time.monotonic()))
    if options.json:
        print(json.dumps(as_json(findings, report), indent=2))
    return EX_CONFIG if any(finding.verdict == "bad" for finding in findings) else 0


def robot(url: str, mend: bool, tell: Callable[[Iterable[ReportLine]], None]) -> BusReport:
    """Check a robot: by the daemon that serves it, else on its port."""
    report = BusReport()
    try:
        traffic = traffic_of(url)
        if traffic is not None:
            with traffic:
                report = check_served(traffic)
            tell(report.findings)
            if mend:
                tell([ReportLine("bad", "a daemon serves this robot: stop it, then --mend")])
        elif Url.parse(url).scheme not in _MEASURED:
            tell([ReportLine("note", f"no daemon serves {url}: start a daemon, then its bus is measured")])
        else:
            with open_line(url) as line:
                report = check_line(line)
                tell(report.findings)
                if mend:
                    tell(mend_latency(Url.parse(url).target, Dialogue()))
                    tell(mend_delays(line, report.servos, Dialogue()))
    except (BadUrl, Unavailable, LinkGone, CliRefused) as error:
        tell([ReportLine("bad", str(error))])
    return report


def as_json(findings: Iterable[ReportLine], report: BusReport) -> dict[str, Any]:
    """The report for programs; times in seconds."""
    rows = [{"verdict": finding.verdict, "text": finding.text} for finding in findings]
    return {"findings": rows, "bus": report.numbers}


def python(found: tuple[int, int]) -> Iterable[ReportLine]:
    """Check whether this Python is recent enough."""
    shown = ".".join(map(str, found))
    if found >= (3, 11):
        yield ReportLine("ok", f"Python {shown}")
    else:
        yield ReportLine("bad", f"Python {shown}: install 3.11 or later")


def packages(version_of: Callable[[str], str], wheel: str) -> Iterable[ReportLine]:
    """Check which required packages and which extras of a wheel are installed."""
    there, absent = [], []
    for name, _, extra in required_packages(wheel):
        if extra in ("dev", "all"):
            continue
        try:
            there.append(f"{name} {version_of(name)}")
        except PackageNotFoundError:
            if extra:
                absent.append(f"{name} (extra {extra})")
            else:
                yield ReportLine("bad", f"{name} is missing: pip install {name}")
    if there:
        yield ReportLine("ok", f"packages of {wheel}: {', '.join(there)}")
    if absent:
        # What needs one of them says so, and how to install it.
        yield ReportLine("ok", f"not installed, and not needed by every robot: {', '.join(absent)}")


def robots(folders: Iterable[platforms.PlatformFolder]) -> Iterable[ReportLine]:
    """Check whether the platforms of other packages can be read, with their options."""
    for folder in folders:
        if not folder.wheel:
            continue
        try:
            manifest = platforms.read(folder)
            platforms.load_options(manifest)
            yield ReportLine("ok", f"platform {manifest.name} of {manifest.wheel}")
        except platforms.BadManifest as error:
            yield ReportLine("bad", str(error))


def adapters(ports: Iterable[SerialPort]) -> Iterable[ReportLine]:
    """List the serial ports with their adapters, and check the permission to open them."""
    found = False
    for port in ports:
        found = True
        adapter = adapter_name(port)
        if os.access(port.device, os.R_OK | os.W_OK):
            yield ReportLine("ok", f"{port.device}: {adapter}")
        else:
            yield ReportLine("bad", f"{port.device}: {adapter}: no permission; sudo usermod -aG dialout $USER, "
                                 "then log in again")
        latency = LATENCY / Path(port.device).name / "latency_timer"
        if latency.is_file() and int(latency.read_text("ascii")) > 1:
            yield ReportLine(
                "note",
                f"{port.device}: the adapter keeps answers for {latency.read_text('ascii').strip()} "
                f"ms; make it faster: echo 1 | sudo tee {latency}",
            )
    if not found:
        yield ReportLine("note", "no serial port found: plug the adapter in, or try --fake")


def dialout(groups: Iterable[int]) -> Iterable[ReportLine]:
    """Check whether the user is in the group that owns serial ports on Debian."""
    try:
        group = grp.getgrnam("dialout").gr_gid
    except KeyError:
        yield ReportLine("note", "this system has no group dialout; see who owns the serial ports: ls -l /dev/ttyUSB*")
        return
    if group in groups or os.geteuid() == 0:
        yield ReportLine("ok", "serial ports may be opened (group dialout)")
    else:
        yield ReportLine("note", "you are not in the group dialout: sudo usermod -aG dialout $USER, then log in again")
