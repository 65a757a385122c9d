"""Calibrate the joints of a servo chain by hand, compare calibrations, and write one back into the servos.

The torque is off: bring the joints to their middle, then move each through its whole range.  The file is in the format
of LeRobot; former versions are kept beside it, and so is a backup of all registers from before.
"""

from __future__ import annotations

import argparse
import select
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from urbihw import platforms
from urbihw.buses.servos import calibration, registers_file
from urbihw.buses.servos.calibration import JointCalibration
from urbihw.buses.servos.device import ServoDevice
from urbihw.buses.servos.hand_calibration import (
    CalibratedJoint,
    HandCalibration,
    named,
    register_changes,
    write_calibration,
)
from urbihw.buses.servos.registers import ServoError
from urbihw.cli.bars import RangeDisplay
from urbihw.cli.servo import carry_out
from urbihw.cli.servo_verbs import VerbJob, devices, read_backups, tell_problems, title
from urbihw.daemon.config import load
from urbihw.exitcodes import EX_CONFIG, EX_OK
from urbihw.kernel.uobject import BadConfig
from urbihw.settings import one_line
from urbihw.started import as_typed

LOOK_PERIOD_S: Final = 0.05
"""Seconds between two looks at the joints."""
_LEAST_TURN: Final = 10
"""Counts that a joint must be moved to show a direction."""
_DIFFERENT: Final = 1


def options(parser: argparse.ArgumentParser) -> None:
    """The options of ``urbihw calibrate``."""
    parser.add_argument("url", nargs="?", default="", metavar="URL", help="the port, such as /dev/ttyUSB0")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--out", metavar="FILE", help="calibrate, and write this file")
    what.add_argument("--restore", metavar="FILE", help="write homing offsets and limits of a file into the servos")
    what.add_argument("--diff", nargs=2, metavar="FILE", help="show what differs between two files")
    parser.add_argument("--config", type=Path, metavar="FILE",
                        help="settings of the robot, whose [devices] name the joints")
    parser.add_argument("--names", metavar="NAME=ID,...",
                        help="names of the joints (default: those of the arm that the servos are, such as an SO-101, "
                             "else motor and the id)")
    parser.add_argument("--directions", action="store_true", help="ask for the positive direction of each joint, too")
    parser.add_argument("--no-limits", action="store_true", help="with --out: do not write the ranges into the servos")
    parser.add_argument("--yes", action="store_true", help="with --restore: do not ask")


def run(options: argparse.Namespace) -> int:
    """Calibrate, restore or compare; returns the exit code."""
    try:
        if options.diff:
            return _compare(*options.diff)
        if not options.url:
            raise calibration.BadCalibration("which port? Give its url, such as /dev/ttyUSB0")
        names = joint_names(options.names, options.config)
    except (calibration.BadCalibration, BadConfig) as error:
        print(f"urbihw: {one_line(str(error))}", file=sys.stderr)
        return EX_CONFIG
    if options.restore:
        return carry_out(options, restore)
    return carry_out(options, lambda job: calibrate(job, names, RangeDisplay(), typed_line))


def joint_names(names: str | None, config: Path | None) -> dict[str, int]:
    """The ids of the joints by name, from a text or from settings; {} for none. Raises BadCalibration, BadConfig."""
    if config is not None:
        loaded = load(config, {})
        for mistake in loaded.mistakes:
            if mistake.setting in ("", "devices"):  # the file itself, or what is taken from it
                raise BadConfig(mistake.line)
        devices = loaded.config.devices or platforms.find(loaded.config.platform).joints
        return {name: row["id"] if isinstance(row, dict) else row for name, row in devices.items()}
    found: dict[str, int] = {}
    for part in names.split(",") if names else ():
        name, _, number = part.strip().partition("=")
        if not name.isidentifier() or not number.isdecimal() or name in found:
            raise calibration.BadCalibration(f"--names {part.strip()!r}: write each name once, such as hip_l=3")
        found[name] = int(number)
    return found


def names_of_arm(found: Sequence[ServoDevice]) -> Mapping[str, int]:
    """The ids of the joints by the names of the platform whose joints these servos are, all of them; {} for none."""
    ids, models = {device.id for device in found}, {device.name for device in found}
    for manifest in platforms.manifests():
        if manifest.joints and {*manifest.joints.values()} == ids and models <= {manifest.joint_model}:
            return manifest.joints
    return {}


def typed_line() -> str | None:
    """A line of standard input if there is one, "" at its end, None otherwise; it does not wait."""
    return sys.stdin.readline() if select.select([sys.stdin], [], [], 0)[0] else None


def calibrate(job: VerbJob, names: Mapping[str, int], display: RangeDisplay, typed: Callable[[], str | None]) -> None:
    """Lead through a calibration and write its file.  Raises ServoError, BadCalibration."""
    out, link, dialogue = job.options.out, job.line.link, job.dialogue
    found = devices(job)
    servos = named({device.id: device for device in found}, names or names_of_arm(found))
    before = f"{out}.registers.toml"
    registers_file.save(before, read_backups(job, found), title(job.line))
    dialogue.say(f"All registers are in {before}; {as_typed('urbihw servo restore')} brings them back.")
    dialogue.wait(f"Hold the robot: the torque of {len(servos)} joints goes off")
    work = HandCalibration(link, servos)
    work.release()
    if any(joint.has_offset for joint in work.joints):
        dialogue.wait("Bring all joints to the middle of their ranges")
        for problem in work.center():
            dialogue.say(problem)
    _record_ranges(job, work, display, typed)
    if job.options.directions:
        for joint in work.joints:
            if not joint.is_silent:
                _ask_direction(job, joint)
    result = work.result()
    if not result:
        raise ServoError(f"nothing is written: {_what_lacks(work.joints)}")
    kept = calibration.save(out, result)
    dialogue.say(f"{len(result)} joints in {out}" + (f"; the former file is {kept}" if kept else ""))
    left_out = [joint for joint in work.joints if joint.name not in result]
    if left_out:
        dialogue.say(f"NOT calibrated: {_what_lacks(left_out)}; the file has nothing of them, and their servos keep "
                     "the limits that they had")
    if not job.options.no_limits:
        _write_all(job, [(servos[name], joint) for name, joint in result.items()])


def _record_ranges(job: VerbJob, work: HandCalibration, display: RangeDisplay, typed: Callable[[], str | None]) -> None:
    """Record until Enter; with joints that were not moved or do not answer, Enter goes on and q leaves them out."""
    clock = job.line.link.clock
    job.dialogue.say("Move each joint through its whole range; Enter ends.")
    while True:
        work.observe()
        line = typed()
        if line is None:
            display.show(work.joints, clock.now())
        else:
            display.finish(work.joints, clock.now())
            still = [joint for joint in work.joints if joint.is_silent or not joint.is_measured]
            if not still or not line or line.strip().lower() == "q":
                return
            job.dialogue.say(f"Not yet: {_what_lacks(still)}. Move them, then Enter; q leaves them out.")
        clock.sleep_until(clock.now() + LOOK_PERIOD_S)


def _what_lacks(joints: Sequence[CalibratedJoint]) -> str:
    """Which joints were not moved, and which do not answer."""
    unmoved = [joint.name for joint in joints if not joint.is_silent]
    silent = [joint.name for joint in joints if joint.is_silent]
    told = [f"{', '.join(unmoved)} (not moved)"] if unmoved else []
    return ", ".join([*told, f"{', '.join(silent)} (no answer: is the plug loose?)"] if silent else told)


def _ask_direction(job: VerbJob, joint: CalibratedJoint) -> None:
    before = joint.registers.read_one("present_position")
    while True:
        job.dialogue.wait(f"Move {joint.name} a little in its positive direction")
        moved = joint.registers.read_one("present_position") - before
        if abs(moved) >= _LEAST_TURN:
            joint.reversed = moved < 0
            return
        job.dialogue.say(f"{joint.name} has not moved.")


def restore(job: VerbJob) -> None:
    """Write the homing offsets and limits of a file into the servos.  Raises ServoError, BadCalibration."""
    joints = calibration.load(job.options.restore)
    found = devices(job)
    servos = named({device.id: device for device in found}, {name: joint.id for name, joint in joints.items()})
    wanted = [(servos[name], joint) for name, joint in joints.items()]
    changed = False
    for name, joint in joints.items():
        for item, (old, new) in register_changes(job.line.link, servos[name], joint).items():
            changed = True
            job.dialogue.say(f"{name}: {item} {old} -> {new}")
    if not changed:
        job.dialogue.say("the servos are as in the file")
        return
    if not (job.options.yes or job.dialogue.confirm("The torque goes off and these are written. Go on?")):
        raise ServoError("nothing is changed")
    before = f"{job.options.restore}.registers.toml"
    registers_file.save(before, read_backups(job, found), title(job.line))
    job.dialogue.say(f"All registers are in {before}.")
    _write_all(job, wanted)


def _write_all(job: VerbJob, joints: Sequence[tuple[ServoDevice, JointCalibration]]) -> None:
    problems = []
    for device, joint in joints:
        problems += write_calibration(job.line.link, device, joint)
    tell_problems(problems)
    job.dialogue.say(f"{len(joints)} servos have their limits, checked; their torque is off")


def _compare(first: str, second: str) -> int:
    lines = calibration.diff(calibration.load(first), calibration.load(second))
    print("\n".join(lines) if lines else "no difference")
    return _DIFFERENT if lines else EX_OK
