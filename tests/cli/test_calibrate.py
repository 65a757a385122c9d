"""``urbihw calibrate``: the joints of a fake are moved by hand; the file, the servos; nothing moves by itself."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest
from buses.line_rig import LineRig, ax, xl
from typist import Typist

from urbihw.buses.servos import calibration
from urbihw.buses.servos.calibration import BadCalibration, JointCalibration
from urbihw.buses.servos.registers import ServoError
from urbihw.cli import calibrate
from urbihw.cli.bars import RangeDisplay
from urbihw.cli.dialogue import Dialogue
from urbihw.cli.main import main, parser
from urbihw.cli.servo_verbs import VerbJob, devices
from urbihw.platforms import find
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.console import commands as feetech_commands
from urbihw_fakes.feetech.servo import FeetechServo
from urbihw_fakes.so101 import So101


class Terminal(io.StringIO):
    """A terminal."""

    def isatty(self) -> bool:
        return True


def job(rig: LineRig, command: str, *steps: tuple[Callable[[], object] | None, str]) -> tuple[VerbJob, io.StringIO]:
    options = parser("calibrate").parse_args(["calibrate", *command.replace("URL", "pipe://robot").split()])
    out = io.StringIO()
    return VerbJob(rig.line, options, Dialogue(Typist(*steps), out)), out


class Hand:
    """Moves joints by the console of the fake, one move at each look, and then presses a key."""

    def __init__(self, rig: LineRig, moves: list[str], key: str = "\n") -> None:
        self._words = rig.console()
        self._moves = moves
        self._key = key

    def move(self, *moves: str) -> None:
        for words in moves:
            assert self._words["turn"].run(words.split()) == "ok"

    def __call__(self) -> str | None:
        if not self._moves:
            return self._key
        self.move(self._moves.pop(0))
        return None


def test_joints_are_calibrated_by_hand(tmp_path: Path) -> None:
    out = tmp_path / "leg.json"
    hip, knee = ax(3, torque_enable=1), xl(4, 1_000_000)
    knee.registers.put("torque_enable", 1)
    rig = LineRig([hip, knee])
    hand = Hand(rig, ["3 60", "4 50", "3 -100", "4 -120", "3 40", "4 70"])
    center = (lambda: hand.move("4 -30"), "")  # the knee's middle is 30 deg from that of its servo
    work, said = job(rig, f"URL --out {out}", (None, ""), center)
    calibrate.calibrate(work, {"hip": 3, "knee": 4}, RangeDisplay(io.StringIO()), hand)

    found = calibration.load(out)
    assert (found["hip"].homing_offset, found["hip"].range_min, found["hip"].range_max) == (0, 376, 717)
    # 30 deg are 341 counts; the middle reads 2047 from now on, 50 deg are 569 counts, 70 are 797.
    assert found["knee"] == JointCalibration(4, 0, 340, 2047 - 797, 2047 + 569)
    get = knee.registers.get
    assert (get("homing_offset"), get("min_position"), get("max_position")) == (340, 1250, 2616)
    assert (hip.registers.get("cw_limit"), hip.registers.get("ccw_limit")) == (376, 717)
    rig.kit.tick(rig.clock.now() + 1.0)
    assert hip.registers.get("torque_enable") == get("torque_enable") == 0
    assert (hip.speed, knee.motor.speed) == (0.0, 0.0)
    assert "2 servos have their limits, checked; their torque is off" in said.getvalue()
    assert (tmp_path / "leg.json.registers.toml").is_file()


def test_a_feetech_arm_is_calibrated_with_its_own_sign_of_the_offset(tmp_path: Path) -> None:
    out = tmp_path / "arm.json"
    servo = FeetechServo("STS3215", 1)
    bus = FeetechBus([servo])
    rig = LineRig([], kit=bus)
    words = feetech_commands(bus, rig.clock.now, {})
    moves = [["1", "30"], ["1", "-70"]]

    def hand() -> str | None:
        if not moves:
            return "\n"
        words["turn"].run(moves.pop(0))
        return None

    work, _ = job(rig, f"URL --out {out}", (None, ""), (lambda: words["turn"].run(["1", "20"]), ""))
    calibrate.calibrate(work, {"pan": 1}, RangeDisplay(io.StringIO()), hand)
    pan = calibration.load(out)["pan"]
    assert abs(pan.range_max - 2047 - 341) <= 2 and abs(2047 - pan.range_min - 455) <= 2
    assert abs(pan.homing_offset - 228) <= 2  # present = actual - offset


def test_a_calibration_of_lerobot_is_written_into_a_feetech_arm(tmp_path: Path) -> None:
    path = tmp_path / "arm.json"
    path.write_text(
        '{"pan": {"id": 1, "drive_mode": 0, "homing_offset": -1470, "range_min": 700, "range_max": 3400},'
        ' "roll": {"id": 2, "drive_mode": 0, "homing_offset": 85, "range_min": 0, "range_max": 4095}}'
    )
    pan, roll = FeetechServo("STS3215", 1), FeetechServo("STS3215", 2)
    bus = FeetechBus([pan, roll])
    rig = LineRig([], kit=bus)
    calibrate.restore(job(rig, f"URL --restore {path} --yes")[0])
    bus.power_off(rig.clock.now())
    bus.power_on(rig.clock.now())
    # Registers 31, 9 and 11, as the vendor's table has them: sign and magnitude, sign in bit 11, low byte first.
    assert pan.registers.read(31, 2) == (1470 | 1 << 11).to_bytes(2, "little")
    assert pan.registers.read(9, 4) == bytes([700 & 255, 700 >> 8, 3400 & 255, 3400 >> 8])
    assert roll.registers.read(31, 2) == bytes([85, 0])


def test_the_file_of_an_arm_has_the_joints_that_lerobot_looks_for(tmp_path: Path) -> None:
    arm = So101()
    rig = LineRig([], kit=arm)
    turns = [(joint, angle) for joint in range(1, 7) for angle in (20, -40, 20)]
    words = feetech_commands(arm, rig.clock.now, {})

    def hand() -> str | None:
        if not turns:
            return "\n"
        words["turn"].run([str(value) for value in turns.pop(0)])
        return None

    work, _ = job(rig, f"URL --out {tmp_path / 'follower.json'}", (None, ""), (None, ""))
    calibrate.calibrate(work, {}, RangeDisplay(io.StringIO()), hand)
    # What LeRobot 0.4 and 0.6 do with it: draccus makes a MotorCalibration of each entry, which has these fields and
    # no others; `so_follower.py` then looks them up by the names of its motors.
    rows = json.loads((tmp_path / "follower.json").read_text())
    assert list(rows) == ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper"]
    assert [row.pop("id") for row in rows.values()] == [1, 2, 3, 4, 5, 6]
    for row in rows.values():
        assert list(row) == ["drive_mode", "homing_offset", "range_min", "range_max"]
        assert {type(value) for value in row.values()} == {int}


def test_servos_that_are_no_arm_keep_their_numbers() -> None:
    def names(*units: FeetechServo) -> Mapping[str, int]:
        return calibrate.names_of_arm(devices(job(LineRig([], kit=FeetechBus(units)), "URL --out x")[0]))

    arm = [FeetechServo("STS3215", number) for number in range(1, 7)]
    assert names(*arm) == find("so101").joints
    assert names(*arm[:-1]) == names(*arm, FeetechServo("STS3215", 7)) == {}
    assert names(*arm[:-1], FeetechServo("STS3250", 6)) == {}


def test_joints_that_were_not_moved_are_asked_for_and_left_out(tmp_path: Path) -> None:
    out = tmp_path / "leg.json"
    rig = LineRig([ax(1), ax(2)])
    hand = Hand(rig, ["1 60"])
    keys = iter(["\n", "q\n"])
    work, said = job(rig, f"URL --out {out} --no-limits", (None, ""))
    calibrate.calibrate(work, {}, RangeDisplay(io.StringIO()), lambda: next(keys) if (line := hand()) else line)
    assert list(calibration.load(out)) == ["motor1"]
    assert "Not yet: motor2 (not moved). Move them" in said.getvalue()
    assert "NOT calibrated: motor2 (not moved); the file has nothing of them" in said.getvalue()
    assert all(unit.registers.get("ccw_limit") == 1023 for unit in rig.kit)
    work, _ = job(rig, f"URL --out {out}", (None, ""))
    with pytest.raises(ServoError, match=r"nothing is written: motor1, motor2 \(not moved\)"):
        calibrate.calibrate(work, {}, RangeDisplay(io.StringIO()), lambda: "q\n")


@pytest.mark.parametrize(("looks", "left"), [((1, 3), ["motor1", "motor2"]), ((1, 9), ["motor1"])])
def test_a_servo_whose_plug_is_loose_ends_nothing(tmp_path: Path, looks: tuple[int, int], left: list[str]) -> None:
    out = tmp_path / "leg.json"
    rig = LineRig([ax(1), ax(2)])
    hand, look, screen = Hand(rig, ["1 60", "1 -20", "2 60", "2 50"], "q\n"), 0, Terminal()

    def typed() -> str | None:
        nonlocal look
        look += 1
        if look == looks[0]:
            rig.kit.faults.start("silence", 2)
        if look == looks[1]:
            assert "no answer" in screen.getvalue()
            rig.kit.faults.stop("silence", 2)
        return hand()

    work, said = job(rig, f"URL --out {out} --no-limits", (None, ""))
    calibrate.calibrate(work, {}, RangeDisplay(screen), typed)
    assert list(calibration.load(out)) == left
    assert ("NOT calibrated: motor2 (no answer: is the plug loose?)" in said.getvalue()) == (len(left) == 1)


def test_directions_are_shown_by_moving(tmp_path: Path) -> None:
    out = tmp_path / "leg.json"
    rig = LineRig([ax(1), ax(2)])
    hand = Hand(rig, ["1 60", "2 60"])
    steps = ((None, ""), (lambda: hand.move("1 -10"), ""), (None, ""), (lambda: hand.move("2 10"), ""))
    work, said = job(rig, f"URL --out {out} --directions", *steps)
    calibrate.calibrate(work, {}, RangeDisplay(io.StringIO()), hand)
    assert [joint.drive_mode for joint in calibration.load(out).values()] == [1, 0]
    assert "motor2 has not moved." in said.getvalue()


def test_who_does_not_hold_the_robot_keeps_its_torque(tmp_path: Path) -> None:
    unit = ax(1, torque_enable=1)
    work, _ = job(LineRig([unit]), f"URL --out {tmp_path / 'leg.json'}", (None, "q"))
    with pytest.raises(ServoError, match="ended before it was done"):
        calibrate.calibrate(work, {}, RangeDisplay(io.StringIO()), lambda: "\n")
    assert unit.registers.get("torque_enable") == 1


def test_a_calibration_is_written_back(tmp_path: Path) -> None:
    path = tmp_path / "leg.json"
    knee_values = JointCalibration(4, 0, -100, 1000, 3000)
    calibration.save(path, {"hip": JointCalibration(3, 0, 0, 376, 717), "knee": knee_values})
    hip, knee, wheel = ax(3), xl(4, 1_000_000), ax(5, cw_limit=0, ccw_limit=0)
    rig = LineRig([hip, knee, wheel])
    work, _ = job(rig, f"URL --restore {path}", (None, "n"))
    with pytest.raises(ServoError, match="nothing is changed"):
        calibrate.restore(work)
    assert hip.registers.get("cw_limit") == 0
    work, said = job(rig, f"URL --restore {path} --yes")
    calibrate.restore(work)
    get = knee.registers.get
    assert (hip.registers.get("cw_limit"), hip.registers.get("ccw_limit")) == (376, 717)
    assert (get("homing_offset"), get("min_position"), get("max_position")) == (-100, 1000, 3000)
    assert "knee: homing_offset 0 -> -100" in said.getvalue()
    work, said = job(rig, f"URL --restore {path}")
    calibrate.restore(work)
    assert said.getvalue() == "the servos are as in the file\n"
    assert wheel.wheel
    rig.kit.remove(knee)
    with pytest.raises(ServoError, match=r"no servo answers for knee \(id 4\)"):
        calibrate.restore(job(rig, f"URL --restore {path}")[0])


def test_ranges_are_bars_on_a_terminal_and_lines_elsewhere(tmp_path: Path) -> None:
    screen, pipe = Terminal(), io.StringIO()
    for stream in (screen, pipe):
        rig = LineRig([ax(1)])
        work, _ = job(rig, f"URL --out {tmp_path / 'leg.json'}", (None, ""))
        calibrate.calibrate(work, {"hip": 1}, RangeDisplay(stream), Hand(rig, ["1 60", "1 -90"]))
    assert "\x1b[1A" in screen.getvalue() and "hip" in screen.getvalue() and "=" in screen.getvalue()
    assert pipe.getvalue().splitlines()[-1] == "hip 410..717"
    assert "\x1b" not in pipe.getvalue()


def test_two_files_are_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, two = tmp_path / "a.json", tmp_path / "b.json"
    calibration.save(one, {"hip": JointCalibration(3, 0, 0, 376, 717)})
    calibration.save(two, {"hip": JointCalibration(3, 1, 0, 376, 717)})
    assert main(["calibrate", "--diff", str(one), str(one)]) == 0
    assert capsys.readouterr().out == "no difference\n"
    assert main(["calibrate", "--diff", str(one), str(two)]) == 1
    assert capsys.readouterr().out == "hip: drive_mode 0 -> 1\n"
    assert main(["calibrate", "--diff", str(one), str(tmp_path / "c.json")]) == 78
    assert main(["calibrate", "--out", str(one)]) == 78
    assert main(["calibrate", "/dev/none", "--out", str(one), "--names", "a"]) == 78
    assert all(line.startswith("urbihw: ") for line in capsys.readouterr().err.splitlines())


def test_a_name_that_no_terminal_can_show_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one, two = tmp_path / "a.json", tmp_path / "b.json"
    calibration.save(one, {"hip": JointCalibration(3, 0, 0, 376, 717)})
    two.write_text(one.read_text().replace("hip", "\\ud800"))
    assert main(["calibrate", "--diff", str(one), str(two)]) == 78
    shown = capsys.readouterr()
    assert shown.out == "" and shown.err == f"urbihw: {two}: joint '\\ud800': a name is printable text\n"


def test_names_come_from_a_list_or_from_the_settings(tmp_path: Path) -> None:
    assert calibrate.joint_names("hip_l=3, hip_r=4", None) == {"hip_l": 3, "hip_r": 4}
    assert calibrate.joint_names(None, None) == {}
    settings = tmp_path / "robot.toml"
    settings.write_text('platform = "so101"\n')
    assert calibrate.joint_names(None, settings) == find("so101").joints
    settings.write_text('platform = "bioloid"\n[devices]\nhip_l = 3\n[devices.hip_r]\nid = 4\n')
    assert calibrate.joint_names(None, settings) == {"hip_l": 3, "hip_r": 4}
    with pytest.raises(BadCalibration, match="write each name once"):
        calibrate.joint_names("a=1,a=2", None)


@pytest.mark.parametrize(
    ("text", "words"), [(None, "No such file"), ("rate = [", "robot.toml"), ("[devices]\nhip = []\n", "hip")]
)
def test_settings_that_cannot_be_used_are_refused_before_anything_is_let_go(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str | None, words: str
) -> None:
    file = tmp_path / "robot.toml"
    if text is not None:
        file.write_text(text)
    assert main(["calibrate", "/dev/none", "--config", str(file), "--out", str(tmp_path / "c.json")]) == 78
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("command", [("play", "bow"), ("teach", "bow")])
def test_without_a_server_the_exit_code_is_that_of_the_table(command: tuple[str, ...]) -> None:
    assert main([*command, "--host", "127.0.0.1", "--port", "1"]) == 69
