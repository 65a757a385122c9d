"""The motions of a robot with joints: records, keeps and plays them for ``teach.u``, which writes to the joints.

A motion that is played is a number here, and so is one that is recorded; both end by ``dropMotion`` and
``endRecording``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from urbihw.kernel.uobject import DevicePart, Motion, Origin, UObject, function
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.teach.course import Course, EndRequest, Key, keys_of, keys_of_pages, repeat_keys
from urbihw.platforms.teach.recording import (
    MAX_RATE_HZ,
    MAX_ROWS,
    BadMotion,
    MotionRecording,
    PoseRow,
    times_of_key_poses,
)
from urbihw.platforms.teach.store import MTN, Store
from urbihw.settings import one_line

MAX_SPEED: Final = 10.0
"""Maximum factor of the speed of a motion."""
KEY_SPEED_RADS: Final = 1.0
"""Speed between key poses that were taken one by one, in rad/s."""
MAX_JOINED: Final = 100
"""Maximum number of motions that are joined."""


class _Taken:
    """A motion that is being recorded, the numbers of its motors, and by whom and when it was begun."""

    def __init__(self, name: str, joints: Sequence[str], motors: frozenset[int], rate: float, origin: Origin) -> None:
        self.name, self.joints, self.motors, self.rate, self.origin = name, tuple(joints), motors, rate, origin
        self.rows: list[PoseRow] = []

    def recording(self, robot: str) -> MotionRecording:
        """The motion as it is written: times from 0."""
        rows = self.rows
        if self.rate:
            times = [row.time - rows[0].time for row in rows]
        else:
            times = times_of_key_poses([row.angles for row in rows], KEY_SPEED_RADS)
        return MotionRecording(
            robot, self.rate, self.joints,
            tuple(PoseRow(round(time, 3), row.angles) for time, row in zip(times, rows, strict=True)),
        )  # fmt: skip


class _Played:
    """A motion that is being played, and the numbers of its motors."""

    def __init__(self, course: Course, motors: frozenset[int]) -> None:
        self.course, self.motors = course, motors


JointPosition = Callable[[int, float], float]
"""Returns the position of a joint in rad for one of its motor, which has a number, from the middle."""


def _as_motor(number: int, position: float) -> float:
    """The position of a joint whose frame is that of its motor."""
    return position


class TaughtMotions(DevicePart):
    """The motions of one robot."""

    def __init__(
        self, device: UObject, name: str, motion: Motion, log: DeviceLog, joint_position: JointPosition = _as_motor
    ) -> None:
        """``name`` is that of the robot, for files."""
        super().__init__(device)
        self._name, self._motion, self._log, self._joint_position = name, motion, log, joint_position
        self._motions = Store(None, "motion")
        self._poses = Store(None, "pose")
        self._played: dict[int, _Played] = {}
        self._taken: dict[int, _Taken] = {}
        self._last_motion = 0

    def use_folder(self, path: str) -> None:
        """Keep the motions in a folder; "" for none."""
        folder = Path(path) if path else None
        self._motions = Store(folder, "motion")
        self._poses = Store(None if folder is None else folder / "poses", "pose")

    # ---------------------------------------------------------------- what there is

    @function("motionNames")
    def motion_names(self) -> list[str]:
        """The names of the motions."""
        return self._motions.names()

    @function("poseNames")
    def pose_names(self) -> list[str]:
        """The names of the poses."""
        return self._poses.names()

    @function("motionPages")
    def motion_pages(self, name: str) -> list[str]:
        """The names of the pages of a file of RoboPlus, those without a name by their number."""
        return [page.name or str(page.number) for page in self._motions.load_pages(name).pages if page.steps]

    # ---------------------------------------------------------------- playing

    @function("planMotion")
    def plan_motion(
        self, kind: str, names: list[str], joints: list[str], motors: list[float], angles: list[float],
        speed: float, times: float, safe_speed: float,
    ) -> list[Any]:
        """Prepare motions (``kind`` "motion"), one after the other, or poses ("pose").

        ``joints`` are all joints of the robot, ``motors`` the numbers of their motors (-1 for none), ``angles`` where
        they are.  Returns the number of the prepared motion, and the places of its joints in ``joints``.
        """  # fmt: skip
        if not 0 < speed <= MAX_SPEED:
            raise ValueError(f"the speed is a factor above 0 up to {MAX_SPEED:g}, not {speed:g}")
        if not times >= 1 or (math.isfinite(times) and times != int(times)):
            raise ValueError(f"the number of repetitions is 1, 2 ... or inf, not {times:g}")
        if not 0 < safe_speed < math.inf:
            raise ValueError(f"blendSpeed is above 0, in rad/s, not {safe_speed:g}")
        if not 0 < len(names) <= MAX_JOINED:
            raise ValueError(f"give 1 to {MAX_JOINED} motions")
        request = EndRequest()
        plan = _Plan(self._joint_position, joints, motors, request, speed)
        parts = [plan.read(self._poses if kind == "pose" else self._motions, name) for name in names]
        used = plan.used
        for place in used:
            if not math.isfinite(angles[place]):
                raise ValueError(f"{joints[place]} has not been read yet")
        keys = repeat_keys(lambda: (key for part in parts for key in part()), times, request)
        course = Course({joints[place]: angles[place] for place in used}, keys, safe_speed, request)
        self._last_motion += 1
        self._played[self._last_motion] = _Played(course, frozenset(int(motors[place]) for place in used))
        return [self._last_motion, used]

    @function("nextPose")
    def next_pose(self, number: int) -> list[float]:
        """The angles of the joints now; [] when the motion is over.  Raises ValueError when a joint is lost."""
        played = self._played.get(number)
        if played is None:
            return []
        self._require_present(played.motors, "the motion has ended")
        return played.course.pose_at(self.host.now())

    def _require_present(self, motors: frozenset[int], end: str) -> None:
        """Raise ValueError when the link or one of these motors is lost."""
        for device, (reason, _) in self._motion.absent.items():
            if device is None or device in motors:
                raise ValueError(f"{reason}: {end}")

    @function("leaveMotion")
    def leave_motion(self, number: int) -> None:
        """Ask a motion to end in good order."""
        if number in self._played:
            self._played[number].course.request.made = True

    @function("dropMotion")
    def drop_motion(self, number: int) -> None:
        """Forget a motion that was played, by its number."""
        self._played.pop(number, None)

    # ---------------------------------------------------------------- recording

    @function("savePoseFile")
    def save_pose_file(self, name: str, joints: list[str], angles: list[float]) -> None:
        """Write a pose to its file."""
        _check_angles(joints, angles)
        self._poses.save(name, MotionRecording(self._name, 0.0, tuple(joints), (PoseRow(0.0, tuple(angles)),)))

    @function("beginRecording")
    def begin_recording(self, name: str, joints: list[str], motors: list[float], rate: float) -> int:
        """Begin a recording of ``rate`` poses in a second, 0 for key poses; nothing is written before its end."""
        self._motions.check_name(name)
        if not 0 <= rate <= MAX_RATE_HZ:
            raise ValueError(f"the rate is 0 (key poses) to {MAX_RATE_HZ:g} Hz, not {rate:g}")
        self._last_motion += 1
        self._taken[self._last_motion] = _Taken(
            name, joints, frozenset(map(int, motors)), rate, self._motion.origin()
        )
        return self._last_motion

    @function("checkRecording")
    def check_recording(self, number: int) -> None:
        """Raise an error when a recording may not go on, nor its joints be switched on at its end: since its begin the
        robot was stopped, the link or a joint was lost, or its client has left.  A hand may hold the joints then."""
        taken = self._taken[number]
        self._motion.check()
        self._require_present(taken.motors, "the recording has ended")
        if not self._motion.is_live(taken.origin):
            reason = self._motion.latched or f"{taken.origin.client} has left, or the robot was stopped"
            raise ValueError(f"{reason}: the recording has ended")

    @function("addPose")
    def add_pose(self, number: int, angles: list[float]) -> bool:
        """Add a pose; returns false when the recording has no room for more.  Raises ValueError when a joint is lost:
        its angle is an old one."""
        taken = self._taken[number]
        self._require_present(taken.motors, "the recording has ended")
        _check_angles(taken.joints, angles)
        now = self.host.now()
        if not taken.rows or now > taken.rows[-1].time:
            taken.rows.append(PoseRow(now, tuple(angles)))
        return len(taken.rows) < MAX_ROWS

    @function("tellJointsOff")
    def tell_joints_off(self, name: str, reason: str) -> None:
        """Log that a recording has left its joints switched off; its client may be gone."""
        self._log.warning("the joints of the recording %s stay off: %s", one_line(name), one_line(reason))

    @function("endRecording")
    def end_recording(self, number: int) -> int:
        """Write a recording, if it has poses; returns their number."""
        taken = self._taken.pop(number)
        if taken.rows:
            self._motions.save(taken.name, taken.recording(self._name))
        return len(taken.rows)


class _Plan:
    """Reads motions for the joints of a robot."""

    def __init__(
        self, position: JointPosition, joints: Sequence[str], motors: Sequence[float], request: EndRequest, speed: float
    ) -> None:
        self._position, self._request, self._speed = position, request, speed
        self._places = {name: place for place, name in enumerate(joints)}
        self._joints = {int(motor): name for motor, name in zip(motors, joints, strict=True) if motor >= 0}
        self._used: set[int] = set()

    @property
    def used(self) -> list[int]:
        """The places of the joints of what was read, in order."""
        return sorted(self._used)

    def read(self, store: Store, name: str) -> Any:
        """Return a function that begins a pass of a motion.  Raises ValueError."""
        file, _, page = name.partition(":")
        if file.endswith(MTN):
            return self._read_pages(store, name, file, page)
        recording = store.load(name)
        self._take(name, recording.joints)

        def begin() -> Iterator[Key]:
            return keys_of(recording, self._speed)

        return begin

    def _read_pages(self, store: Store, name: str, file: str, page: str) -> Any:
        motions = store.load_pages(file)
        first = motions.find(page)
        if first is None:
            raise BadMotion(f"{file} has no page {page!r}: robot.pages(\"{file}\") lists them")
        numbers = sorted({number for each in motions.pages for step in each.steps for number in step.positions})
        missing = [number for number in numbers if number not in self._joints]
        if missing:
            raise BadMotion(f"{name}: this robot has no joint of motor {' '.join(map(str, missing))}")
        self._take(name, [self._joints[number] for number in numbers])

        def joint(number: int, position: float) -> tuple[str, float]:
            return self._joints[number], self._position(number, position)

        def begin() -> Iterator[Key]:
            return keys_of_pages(motions, first, self._speed, self._request, joint)

        return begin

    def _take(self, name: str, joints: Sequence[str]) -> None:
        missing = [joint for joint in joints if joint not in self._places]
        if missing:
            # The names are those of the file, and go to terminals.
            raise BadMotion(f"{name}: this robot has no {one_line(' '.join(missing))}")
        self._used.update(self._places[joint] for joint in joints)


def _check_angles(joints: Sequence[str], angles: Sequence[float]) -> None:
    unread = [name for name, angle in zip(joints, angles, strict=True) if not math.isfinite(angle)]
    if unread:
        raise ValueError(f"not read yet: {' '.join(unread)}")
