"""The checks of ``urbihw doctor`` on the machine: processor, clock, space, memory, udev rules; nothing is changed.

All files are read below a root folder, so that tests can show other machines.  None needs special rights.
"""

from __future__ import annotations

import getpass
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Final, Literal

from urbihw.buses.processor import PRIORITY, may_claim
from urbihw.frozen import frozen
from urbihw.started import as_typed

Verdict = Literal["ok", "note", "bad"]
Run = Callable[[Sequence[str]], str]
"""Runs a program and returns what it prints, "" if there is none or it fails."""

ROOT: Final = Path("/")
_MIB: Final = 1 << 20
_LITTLE_SPACE, _NO_SPACE = 500 * _MIB, 50 * _MIB
_LITTLE_MEMORY, _NO_MEMORY = 0.10, 0.03
_JUMP_S: Final = 0.01
_THROTTLED: Final = {
    0: "voltage too low", 1: "processor slowed down by low voltage or heat", 2: "processor throttled",
    3: "near the highest temperature",
}  # fmt: skip
"""Bit of the word of vcgencmd (Raspberry Pi) -> what is so now; 16 bits higher: what was so since the start."""
_THROTTLED_FILE: Final = "sys/devices/platform/soc/soc:firmware/get_throttled"
_RULES: Final = ("etc/udev/rules.d", "run/udev/rules.d", "usr/lib/udev/rules.d", "lib/udev/rules.d")
_STEADY: Final = {"performance", "schedutil", "userspace"}


@frozen(slots=False)
class ReportLine:
    """One line of the report; a ``bad`` one tells what to do."""

    verdict: Verdict
    text: str


def check_machine(root: Path = ROOT, run: Run | None = None) -> Iterator[ReportLine]:
    """All checks of this module."""
    execute = run_program if run is None else run
    yield from udev_rules(root)
    yield from governor(root)
    yield from throttling(root, execute)
    yield from clock(root, execute)
    yield from space(root)
    yield from memory(root)
    yield from load(root, os.cpu_count() or 1)
    yield from real_time(root, may_claim())


def run_program(words: Sequence[str]) -> str:
    """What a program prints; "" if there is none, or it fails."""
    if shutil.which(words[0]) is None:
        return ""
    try:
        done = subprocess.run(words, capture_output=True, text=True, timeout=5, stdin=subprocess.DEVNULL)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip() if done.returncode == 0 else ""


def udev_rules(root: Path) -> Iterator[ReportLine]:
    """Check whether the udev rules are installed."""
    for folder in _RULES:
        for file in sorted((root / folder).glob("*urbihw*.rules")):
            yield ReportLine("ok", f"udev rules: /{file.relative_to(root)}")
            return
    yield ReportLine("note", "the udev rules are not installed (names and rights of adapters, 1 ms latency): "
                          f"sudo {as_typed('urbihw install-service')} NAME --platform PLATFORM")


def governor(root: Path) -> Iterator[ReportLine]:
    """Check the frequency governor of the processor."""
    files = (root / "sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor")
    found = {_read(file) for file in files}
    slow = sorted(found - _STEADY - {""})
    if slow:
        yield ReportLine("note", f"processor governor {', '.join(slow)}: a processor that sleeps answers later; "
                              "echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor")
    else:
        yield ReportLine("ok", f"processor governor {', '.join(sorted(found - {''})) or 'none'}")


def throttling(root: Path, run: Run) -> Iterator[ReportLine]:
    """Check whether a Raspberry Pi is throttled, or was; nothing on other machines."""
    text = _read(root / _THROTTLED_FILE) or run(("vcgencmd", "get_throttled")).rpartition("=")[2]
    try:
        word = int(text, 16)
    except ValueError:
        return
    now = [words for bit, words in _THROTTLED.items() if word >> bit & 1]
    once = [words for bit, words in _THROTTLED.items() if word >> bit + 16 & 1]
    if now:
        yield ReportLine(
            "bad", f"Raspberry Pi: {', '.join(now)}: take a stronger supply and a shorter cable, or cool it"
        )
    elif once:
        yield ReportLine("note", f"Raspberry Pi, since its start: {', '.join(once)}: check its supply and cooling")
    else:
        yield ReportLine("ok", "Raspberry Pi: not throttled since its start")


def clock(root: Path, run: Run) -> Iterator[ReportLine]:
    """Check whether the clock is set by NTP."""
    synchronized = (root / "run/systemd/timesync/synchronized").exists()
    told = "yes" if synchronized else run(("timedatectl", "show", "--property=NTPSynchronized", "--value"))
    if told == "yes":
        yield ReportLine("ok", "the clock is synchronized")
    elif told == "no":
        yield ReportLine("note", "the clock is not synchronized: times of the log may be wrong; "
                              "sudo timedatectl set-ntp true")
    else:
        yield ReportLine("note", "whether the clock is synchronized is not known (no timedatectl)")


def clock_jump(before: float, after: float) -> Iterator[ReportLine]:
    """Check the difference of wall clock and steady clock, in seconds, before and after the other checks."""
    if abs(after - before) > _JUMP_S:
        yield ReportLine("note", f"the clock jumped by {after - before:+.3f} s meanwhile: is it set by two programs?")


def space(
    root: Path, free_of: Callable[[Path], int] = lambda path: shutil.disk_usage(path).free
) -> Iterator[ReportLine]:
    """Check the free space where the daemon writes."""
    for place in ("var/lib/urbihw", "var/log", "tmp"):
        if not (root / place).is_dir():
            continue
        free = free_of(root / place)
        text = f"/{place}: {free // _MIB} MB free"
        if free < _NO_SPACE:
            yield ReportLine("bad", f"{text}: delete something; sudo journalctl --vacuum-size=100M")
        elif free < _LITTLE_SPACE:
            yield ReportLine("note", f"{text}: it will be full soon")
        else:
            yield ReportLine("ok", text)


def memory(root: Path) -> Iterator[ReportLine]:
    """Check memory and swap."""
    rows = {}
    for line in _read(root / "proc/meminfo").splitlines():
        name, _, rest = line.partition(":")
        number = rest.split()[:1]
        rows[name] = int(number[0]) if number and number[0].isdigit() else 0
    total, free = rows.get("MemTotal", 0), rows.get("MemAvailable", 0)
    if not total:
        return
    text = f"memory: {free // 1024} of {total // 1024} MB free"
    if free < _NO_MEMORY * total:
        yield ReportLine("bad", f"{text}: end other programs")
    else:
        yield ReportLine("note" if free < _LITTLE_MEMORY * total else "ok", text)
    used = rows.get("SwapTotal", 0) - rows.get("SwapFree", 0)
    if used > 0.1 * total:
        yield ReportLine("note", f"swap: {used // 1024} MB in use: a robot program that is swapped out reacts late")


def load(root: Path, processors: int) -> Iterator[ReportLine]:
    """Check the load of the last minute."""
    try:
        number = float(_read(root / "proc/loadavg").split()[0])
    except (IndexError, ValueError):
        return
    text = f"load: {number:.2f} on {processors} processors"
    if number > processors:
        yield ReportLine("note", f"{text}: other programs hold up the robot; see top")
    else:
        yield ReportLine("ok", text)


def real_time(root: Path, may_be_one: bool) -> Iterator[ReportLine]:
    """Check the kernel's limit for real-time programs, and whether a bus worker of this user may be one."""
    text = _read(root / "proc/sys/kernel/sched_rt_runtime_us")
    if text == "-1":
        yield ReportLine("note", "the kernel does not limit real-time programs: one in a loop stops the machine; "
                              "sudo sysctl kernel.sched_rt_runtime_us=950000")
    elif text.isdigit():
        yield ReportLine("ok", f"real-time programs get at most {int(text) / 10000:.0f} % of a processor")
    if may_be_one:
        yield ReportLine("ok", "a bus worker of this user may run in real time")
    else:
        row = f"{getpass.getuser()} - rtprio {PRIORITY}"
        yield ReportLine("note", "a bus worker of this user may not run in real time, that of the service may; to "
                              f"allow it: '{row}' in /etc/security/limits.d/urbihw.conf")


def _read(file: Path) -> str:
    try:
        return file.read_text("ascii", "replace").strip()
    except OSError:
        return ""
