"""Files of motions: our own, and those of RoboPlus; what is read, what is refused, where a joint is at each moment."""

from __future__ import annotations

import math
from itertools import islice
from pathlib import Path

import pytest

from urbihw.platforms.teach import mtn
from urbihw.platforms.teach.course import LONGEST_STEP_S, Course, EndRequest, Key, keys_of, keys_of_pages, repeat_keys
from urbihw.platforms.teach.recording import BadMotion, MotionRecording, PoseRow, parse, times_of_key_poses
from urbihw.platforms.teach.store import Store

BOW = Path(__file__).parents[2] / "docs" / "examples" / "bow.mtn"
HEAD = '{"robot": "r", "unit": "rad", "rate": 25, "joints": ["a", "b"]}\n'


def test_a_motion_survives_its_file() -> None:
    motion = MotionRecording("r", 25.0, ("a", "joint[2]"), (PoseRow(0.0, (0.5, -1.25)), PoseRow(0.04, (0.625, 3.0))))
    assert parse(motion.text(), "x") == motion


def test_a_file_edited_by_hand_may_have_comments() -> None:
    assert parse(f"# my wave\n\n{HEAD}# up\n[0, 1, 2]\n[0.5, 3, 4.5]\n", "x").rows == (
        PoseRow(0.0, (1.0, 2.0)),
        PoseRow(0.5, (3.0, 4.5)),
    )


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "x: a motion has a first line"),
        (HEAD, "x: a motion has a first line"),
        ("[0, 1, 2]", "x:1: the first line has the keys joints, rate, robot, unit, and no others"),
        (HEAD + "[0, 1, 2", "x:2: this is not JSON"),
        (HEAD + "[0, 1]", "x:2: a pose is a list of 3 numbers"),
        (HEAD + "[0, 1, true]", "x:2: a pose is a list of 3 numbers"),
        (HEAD + "[0, 1, NaN]", "x:2: an angle is within 1000 rad"),
        (HEAD + "[0, NaN, 1]", "x:2: an angle is within 1000 rad"),
        (HEAD + "[NaN, 1, 2]", "x:2: the times increase"),
        (HEAD + "[0, 1, 1001]", "x:2: an angle is within 1000 rad"),
        (HEAD + "[0, 1, 2]\n[0, 1, 2]", "x:3: the times increase"),
        (HEAD + "[-1, 1, 2]", "x:2: the times increase"),
        (HEAD.replace("rad", "deg"), "x:1: the unit of angles is rad"),
        (HEAD.replace('"b"', '"a"'), "x:1: joints are 1 to 200 different names"),
        (HEAD.replace("25", "1e9"), "x:1: rate is a number from 0 to 100"),
        ("[" * 100_000, "x:1: this is not JSON"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(text: str, problem: str) -> None:
    with pytest.raises(BadMotion) as refused:
        parse(text, "x")
    assert str(refused.value).startswith(problem) and "\n" not in str(refused.value)


def test_names_stay_in_the_folder(tmp_path: Path) -> None:
    store = Store(tmp_path / "motions", "motion")
    assert store.names() == []
    motion = MotionRecording("r", 0.0, ("a",), (PoseRow(0.0, (1.0,)),))
    store.save("wave", motion)
    (tmp_path / "motions" / "bow.mtn").write_bytes(BOW.read_bytes())
    (tmp_path / "motions" / ".wave.jsonl").write_text("")
    assert store.names() == ["bow.mtn", "wave"]
    assert store.load("wave") == motion
    for name in ("../wave", "", "a/b", "a\0", ".", "x" * 65):
        with pytest.raises(ValueError, match="1 to 64 letters"):
            store.save(name, motion)
    with pytest.raises(ValueError, match=r"there is no motion 'wafe'; did you mean wave\?"):
        store.load("wafe")


def test_key_poses_are_as_far_apart_as_their_angles() -> None:
    assert times_of_key_poses([(0.0, 0.0), (2.0, -3.0), (2.1, -3.0)], 1.5) == [0.0, 2.0, 2.5]


# ---------------------------------------------------------------- RoboPlus


def test_the_pages_of_a_file_of_roboplus() -> None:
    motions = mtn.parse(BOW.read_bytes(), "bow.mtn")
    assert [page.name for page in motions.pages] == ["Ready", "Bow", "", "March", "March on", "Halt"]
    bow = motions.find("Bow")
    assert bow is not None and bow is motions.find("2")
    assert (bow.next, bow.exit, bow.repeat, bow.speed) == (1, 0, 2, 2.0)
    assert bow.steps[0].time == 1.6 and bow.steps[0].pause == 0.4
    # 300 degrees are 1023 steps, and 511.5 is the middle (AX-12A, Goal Position).
    assert {number: round(math.degrees(angle), 2) for number, angle in bow.steps[0].positions.items()} == {
        1: round((612 - 511.5) * 300 / 1023, 2), 2: round((412 - 511.5) * 300 / 1023, 2), 3: 0.15,
    }  # fmt: skip
    assert motions.find("3") is None, "an empty page"
    assert motions.find("Nod") is None


def test_byte_order_mark_and_check_sum_are_no_text() -> None:
    """As RoboPlus writes it (robosavvy.com, "Motion File Editing Issue")."""
    data = b"\xef\xbb\xbf" + BOW.read_bytes().replace(b"\n", b"\r\n") + b"\x1c\xf0"
    assert mtn.parse(data, "x") == mtn.parse(BOW.read_bytes(), "x")


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("type=motion", "PNG", "x: a motion file of RoboPlus begins with type=motion"),
        ("version=1.01", "version=2.0", "x:2: only version 1.01"),
        ("enable=0 1", "enable=1", "x:3: this line has 26 numbers"),
        ("step=512 612", "step=512 2048", "x:15: positions are 0 to 1023"),
        ("step=512 612", "step=512 nan", "x:15: this line has 28 numbers"),
        ("0.400 1.600", "0.400 1e9", "x:15: times are 0 to 60 s"),
        ("1 0 2 2.0 32", "1 0 2 0 32", "x:17: 0 to 255 repetitions, a speed up to 10"),
        ("page_end", "", "x:11: at most 255 pages, none inside another"),
    ],
)
def test_a_bad_file_of_roboplus_is_refused_in_one_line(old: str, new: str, problem: str) -> None:
    with pytest.raises(BadMotion) as refused:
        mtn.parse(BOW.read_text().replace(old, new, 1).encode(), "x")
    assert str(refused.value).startswith(problem) and "\n" not in str(refused.value)


def _pages(first: str, request: EndRequest, speed: float = 1.0) -> list[tuple[float, dict[str, int]]]:
    motions = mtn.parse(BOW.read_bytes(), "x")
    page = motions.find(first)
    assert page is not None
    keys = keys_of_pages(motions, page, speed, request, lambda number, position: (str(number), position))
    shown = []
    for key in islice(keys, 100):
        counts = {name: round(angle / mtn.RAD_PER_COUNT + 511.5) for name, angle in key.pose.items()}
        shown.append((key.seconds, counts))
        if len(shown) == 5 and first == "March":
            request.made = True
    return shown


def test_pages_follow_one_another_with_repetitions_and_speed() -> None:
    up, nod, ready = {"1": 612, "2": 412, "3": 512}, {"1": 512, "2": 512, "3": 562}, dict.fromkeys("123", 512)
    assert _pages("Bow", EndRequest()) == [(0.8, up), (0.2, up), (0.8, nod)] * 2 + [(1.0, ready)]
    assert _pages("Bow", EndRequest(), 2.0)[0] == (0.4, up)


def test_a_request_to_end_leads_to_the_exit_page() -> None:
    assert [pose["3"] for _, pose in _pages("March", EndRequest())] == [512] * 5 + [462]


# ---------------------------------------------------------------- where a joint is at each moment


def _recording(*rows: tuple[float, float]) -> MotionRecording:
    return MotionRecording("r", 25.0, ("a",), tuple(PoseRow(time, (angle,)) for time, angle in rows))


def _track(course: Course, seconds: float, period: float = 0.01) -> list[float]:
    found = []
    for step in range(round(seconds / period)):
        pose = course.pose_at(step * period)
        if not pose:
            break
        found.append(pose[0])
    return found


def test_the_way_to_the_begin_is_slow_and_gentle_and_the_motion_as_it_was() -> None:
    motion = _recording((3.0, 1.0), (4.0, 2.0), (4.5, 1.0))
    track = _track(Course({"a": 0.0}, keys_of(motion, 1.0), 0.5, EndRequest()), 10)
    speeds = [(new - old) / 0.01 for old, new in zip(track, track[1:], strict=False)]
    begin = round(math.pi / 2 / 0.5 * 100)
    assert max(speeds[:begin]) == pytest.approx(0.5, rel=0.01)
    assert speeds[0] < 0.05 and speeds[begin - 2] < 0.05
    assert track[begin + 50] == pytest.approx(1.5, abs=0.02)
    assert track[begin + 125] == pytest.approx(1.5, abs=0.02)
    assert track[-1] == 1.0 and len(track) == pytest.approx(begin + 150, abs=3)


def test_the_speed_is_a_factor() -> None:
    motion = _recording((0.0, 0.0), (2.0, 1.0))
    assert len(_track(Course({"a": 0.0}, keys_of(motion, 0.5), 1.0, EndRequest()), 9)) == pytest.approx(400, abs=2)


def test_a_motion_goes_on_where_it_was_after_a_pause() -> None:
    course = Course({"a": 0.0}, keys_of(_recording((0.0, 0.0), (10.0, 10.0)), 1.0), 1.0, EndRequest())
    course.pose_at(0.0)
    before = course.pose_at(0.04)[0]
    assert course.pose_at(1000.0)[0] - before == pytest.approx(LONGEST_STEP_S)


def test_for_ever_is_no_endless_loop() -> None:
    """A pose repeated for ever, without any time of its own, still goes on in time."""
    course = Course(
        {"a": 0.0}, repeat_keys(lambda: iter([Key(0.0, {"a": 0.0})]), math.inf, EndRequest()), 1.0, EndRequest()
    )
    assert course.pose_at(0.0) == course.pose_at(1.0) == [0.0]


def test_a_request_ends_the_last_pass() -> None:
    request = EndRequest()
    motion = _recording((0.0, 0.0), (1.0, 1.0))
    course = Course({"a": 0.0}, repeat_keys(lambda: keys_of(motion, 1.0), math.inf, request), 1.0, request)
    assert len(_track(course, 8)) == 800
    request.made = True
    later = [course.pose_at(8 + 0.01 * step) for step in range(400)]
    assert later[-1] == [] and [1.0] in later
