"""The file of a motion or of a pose: lines of JSON.

The first line says what the others mean, and each other line is one pose: seconds since the begin, then one angle for
each joint, in rad::

    {"robot": "bioloid", "unit": "rad", "rate": 25, "joints": ["joint[1]", "joint[2]"]}
    [0.000, -0.2050, 0.1411]
    [0.040, -0.2080, 0.1470]

``rate`` is the number of poses in a second, 0 for key poses taken one by one.  Empty lines, and lines that begin with
``#``, are skipped.  A pose is a motion of one line.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from urbihw.frozen import frozen

MAX_BYTES: Final = 4 * 1024 * 1024
"""Maximum size of a file of motions."""
MAX_ROWS: Final = 10_000
"""Maximum number of poses of a motion: 6.6 minutes at 25 Hz."""
MAX_JOINTS: Final = 200
MAX_NAME: Final = 100
"""Maximum length of the name of a joint."""
MAX_RATE_HZ: Final = 100.0
MAX_SECONDS: Final = 86_400.0
MAX_ANGLE: Final = 1000.0
"""Maximum of an angle in rad: a joint of several turns has more than one."""
UNIT: Final = "rad"
_KEYS: Final = frozenset({"robot", "unit", "rate", "joints"})
_NUMBERS: Final = frozenset({int, float})
_DECODER: Final = json.JSONDecoder()


class BadMotion(ValueError):
    """A file that is no motion; the message is one line that tells the place and what belongs there."""


class PoseRow(NamedTuple):
    """One pose: seconds since the begin, and the angle of each joint in rad."""

    time: float
    angles: tuple[float, ...]


@frozen(slots=False)
class MotionRecording:
    """A motion.

    Attributes:
        robot: the name of the robot that it was recorded with.
        rate: poses in a second, 0 for key poses.
        joints: the compact names of the joints.
        rows: the poses, at least one, in order of their times.
    """

    robot: str
    rate: float
    joints: tuple[str, ...]
    rows: tuple[PoseRow, ...]

    @property
    def seconds(self) -> float:
        """Duration from the first pose to the last."""
        return self.rows[-1].time - self.rows[0].time

    def text(self) -> str:
        """Return the content of the file."""
        head = {"robot": self.robot, "unit": UNIT, "rate": self.rate, "joints": list(self.joints)}
        lines = [json.dumps(head)]
        form = "[%.3f" + ", %.4f" * len(self.joints) + "]"
        lines += [form % (row.time, *row.angles) for row in self.rows]
        return "\n".join(lines) + "\n"


def parse(text: str, where: str) -> MotionRecording:
    """Return the motion of a file; ``where`` is its name for messages.  Raises BadMotion."""
    head: dict[str, Any] | None = None
    rows: list[PoseRow] = []
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if not line or line.startswith("#"):
            continue
        place = f"{where}:{number}"
        if head is None:
            head = _head(_value(line, place), place)
            continue
        if len(rows) == MAX_ROWS:
            raise BadMotion(f"{place}: a motion has at most {MAX_ROWS} poses")
        rows.append(_row(_value(line, place), len(head["joints"]), rows[-1].time if rows else -math.inf, place))
    if head is None or not rows:
        raise BadMotion(f"{where}: a motion has a first line with robot, unit, rate and joints, then at least one pose")
    return MotionRecording(head["robot"], float(head["rate"]), tuple(head["joints"]), tuple(rows))


def _value(line: str, place: str) -> Any:
    try:
        return _DECODER.decode(line)
    except json.JSONDecodeError as error:
        raise BadMotion(f"{place}: this is not JSON: {error.msg}") from error
    except RecursionError as error:
        raise BadMotion(f"{place}: this is not JSON: too deep") from error
    except ValueError as error:
        # Python reads integers of at most sys.get_int_max_str_digits() digits.
        raise BadMotion(f"{place}: a number has too many digits") from error


def _head(value: Any, place: str) -> dict[str, Any]:
    if not isinstance(value, dict) or value.keys() != _KEYS:
        raise BadMotion(f"{place}: the first line has the keys {', '.join(sorted(_KEYS))}, and no others")
    if value["unit"] != UNIT:
        raise BadMotion(f"{place}: the unit of angles is {UNIT}")
    if not isinstance(value["robot"], str):
        raise BadMotion(f"{place}: robot is a text")
    if not _is_number(value["rate"]) or not 0 <= value["rate"] <= MAX_RATE_HZ:
        raise BadMotion(f"{place}: rate is a number from 0 to {MAX_RATE_HZ:g}")
    joints = value["joints"]
    if not isinstance(joints, list) or not all(isinstance(name, str) and 0 < len(name) <= MAX_NAME for name in joints):
        raise BadMotion(f"{place}: joints is a list of names")
    if not 0 < len(joints) <= MAX_JOINTS or len(set(joints)) < len(joints):
        raise BadMotion(f"{place}: joints are 1 to {MAX_JOINTS} different names")
    return value


def _row(value: Any, joints: int, after: float, place: str) -> PoseRow:
    # A file has up to 10000 poses, and the kernel waits.
    if type(value) is not list or len(value) != joints + 1 or not _NUMBERS.issuperset(map(type, value)):
        raise BadMotion(f"{place}: a pose is a list of {joints + 1} numbers: seconds, then rad of each joint")
    time, *angles = value
    if not after < time <= MAX_SECONDS or time < 0:
        raise BadMotion(f"{place}: the times increase from 0 to at most {MAX_SECONDS:g} s")
    # The sum is nan if an angle is.
    if not (max(angles) <= MAX_ANGLE and min(angles) >= -MAX_ANGLE and math.isfinite(sum(angles))):
        raise BadMotion(f"{place}: an angle is within {MAX_ANGLE:g} rad of 0")
    return PoseRow(float(time), tuple(angles))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e9


def times_of_key_poses(poses: Sequence[Sequence[float]], speed: float, least: float = 0.5) -> list[float]:
    """Return times for poses that were taken one by one, so that no joint goes faster than ``speed`` in rad/s.

    ``least`` is the minimum of seconds between two of them.
    """
    times = [0.0]
    for before, after in zip(poses, poses[1:], strict=False):
        way = max((abs(new - old) for old, new in zip(before, after, strict=True)), default=0.0)
        times.append(times[-1] + max(way / speed, least))
    return times[: len(poses)]
