"""``urbihw doctor``: the machine, below a folder of the test; the bus, with a simulated kit or behind a daemon."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable
from pathlib import Path

import pytest
from buses.line_rig import LineRig, ax, xl
from worker_socket import WorkerSocket

from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.device import Device, Scan
from urbihw.buses.servos.line import Line
from urbihw.buses.servos.survey import Servo, read_live
from urbihw.cli import doctor, machine, robot_check, tracing
from urbihw.cli.dialogue import Dialogue
from urbihw.cli.machine import Finding
from urbihw.cli.main import main
from urbihw.cli.tracing import WorkerTraffic, same_port

Capture = pytest.CaptureFixture[str]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "diagnosis.md"
READ, ANSWER = "ffff0104022402d2", "ffff0104000002f8"


def write(root: Path, name: str, text: str) -> None:
    (root / name).parent.mkdir(parents=True, exist_ok=True)
    (root / name).write_text(text)


def silent(words: Iterable[str]) -> str:
    return ""


def only(found: Iterable[Finding]) -> Finding:
    (one,) = found
    return one


# ---------------------------------------------------------------- the machine


@pytest.mark.parametrize(
    ("word", "verdict", "words"),
    [
        ("0", "ok", "not throttled"),
        ("50000", "note", "since its start: voltage too low, processor throttled"),
        ("50005", "bad", "voltage too low, processor throttled: take a stronger supply"),
        ("80008", "bad", "near the highest temperature"),
    ],
)
def test_throttling_is_told_in_words(tmp_path: Path, word: str, verdict: str, words: str) -> None:
    write(tmp_path, "sys/devices/platform/soc/soc:firmware/get_throttled", word + "\n")
    found = only(machine.throttling(tmp_path, silent))
    assert found.verdict == verdict and words in found.text


def test_throttling_by_the_program_of_the_pi_and_on_other_machines(tmp_path: Path) -> None:
    assert only(machine.throttling(tmp_path, lambda words: "throttled=0x1")).verdict == "bad"
    assert list(machine.throttling(tmp_path, silent)) == []
    assert list(machine.throttling(tmp_path, lambda words: "VCHI initialization failed")) == []


def test_governor(tmp_path: Path) -> None:
    assert only(machine.governor(tmp_path)) == Finding("ok", "processor governor none")
    write(tmp_path, "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n")
    assert only(machine.governor(tmp_path)).verdict == "ok"
    write(tmp_path, "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "ondemand\n")
    found = only(machine.governor(tmp_path))
    assert found.verdict == "note" and found.text.startswith("processor governor ondemand: ")


def test_udev_rules(tmp_path: Path) -> None:
    assert only(machine.udev_rules(tmp_path)).verdict == "note"
    write(tmp_path, "usr/lib/udev/rules.d/99-urbihw.rules", "")
    assert only(machine.udev_rules(tmp_path)) == Finding("ok", "udev rules: /usr/lib/udev/rules.d/99-urbihw.rules")


@pytest.mark.parametrize(("told", "verdict"), [("yes", "ok"), ("no", "note"), ("", "note")])
def test_clock(tmp_path: Path, told: str, verdict: str) -> None:
    assert only(machine.clock(tmp_path, lambda words: told)).verdict == verdict
    write(tmp_path, "run/systemd/timesync/synchronized", "")
    assert only(machine.clock(tmp_path, silent)).verdict == "ok"


def test_a_jump_of_the_clock() -> None:
    assert list(machine.clock_jump(1000.0, 1000.001)) == []
    assert "jumped by -2.000 s" in only(machine.clock_jump(1000.0, 998.0)).text


@pytest.mark.parametrize(("free", "verdict"), [(1 << 30, "ok"), (100 << 20, "note"), (1 << 20, "bad")])
def test_free_space(tmp_path: Path, free: int, verdict: str) -> None:
    (tmp_path / "var/log").mkdir(parents=True)
    assert only(machine.space(tmp_path, lambda path: free)).verdict == verdict


def test_memory_swap_load_and_real_time(tmp_path: Path) -> None:
    rows = ("MemTotal: 1000000 kB", "MemAvailable: 20000 kB", "SwapTotal: 500000 kB", "SwapFree: 0 kB")
    write(tmp_path, "proc/meminfo", "\n".join(rows))
    write(tmp_path, "proc/loadavg", "3.50 1 1 1/1 1\n")
    write(tmp_path, "proc/sys/kernel/sched_rt_runtime_us", "-1\n")
    assert [each.verdict for each in machine.memory(tmp_path)] == ["bad", "note"]
    assert [only(machine.load(tmp_path, count)).verdict for count in (2, 4)] == ["note", "ok"]
    assert only(machine.real_time(tmp_path)).verdict == "note"
    write(tmp_path, "proc/meminfo", "MemTotal: what")
    write(tmp_path, "proc/loadavg", "")
    assert not [*machine.memory(tmp_path), *machine.load(tmp_path, 1)]


def test_an_empty_machine_is_no_traceback(tmp_path: Path) -> None:
    assert all(each.verdict != "bad" for each in machine.check_machine(tmp_path, silent))


# ---------------------------------------------------------------- a bus that nobody serves


@pytest.fixture
def kit() -> LineRig:
    """Two servos with the factory's return delay of 0.5 ms, one without."""
    return LineRig([ax(1), ax(2), ax(3, return_delay=0)])


def test_what_return_delays_cost_is_told_for_each_and_in_all(kit: LineRig) -> None:
    report = robot_check.check_line(kit.line)
    texts = [each.text for each in report.findings]
    assert "pipe://robot: 3 servos at 1000000 bps" in texts
    assert "servo 1: return delay 0.500 ms: 0 would gain that each cycle" in texts
    assert "you would gain 1.0 ms a cycle by return delay 0: urbihw doctor URL --mend" in texts
    assert not any("servo 3" in text for text in texts)
    assert report.numbers["return_delay"] == {1: 0.0005, 2: 0.0005}
    turnaround = report.numbers["turnaround"]
    assert abs(turnaround["1"] - 0.0005) < 1e-4 and turnaround["3"] < 1e-4
    assert report.numbers["bytes_a_cycle"] == 3 * 16
    assert all(each.verdict != "bad" for each in report.findings)


def test_the_page_shows_what_is_told() -> None:
    report = robot_check.check_line(LineRig([ax(number) for number in range(1, 19)]).line)
    told = {f"{each.verdict:5} {each.text}".replace("pipe://robot", "/dev/ttyUSB0") for each in report.findings}
    block = PAGE.read_text("utf-8").split("$ urbihw doctor '/dev/ttyUSB0?baud=1000000'")[1].split("\n\n")[0]
    shown = [line.strip() for line in block.splitlines() if line.strip() not in ("", "...")]
    assert len(shown) == 6 and set(shown) <= told


def test_measuring_writes_nothing(kit: LineRig) -> None:
    robot_check.check_line(kit.line)
    assert kit.instructions() <= {0x01, 0x02}


def test_a_servo_that_fails_now_and_then_is_told(kit: LineRig, monkeypatch: pytest.MonkeyPatch) -> None:
    def spoil(bus: ServoBus, device: Device) -> Servo:
        found = read_live(bus, device)
        kit.kit.faults.start("checksum", 2, times=2)
        return found

    monkeypatch.setattr(robot_check, "read_live", spoil)
    found = {each.text: each.verdict for each in robot_check.check_line(kit.line).findings}
    assert any("damaged answers" in text and verdict == "bad" for text, verdict in found.items())
    assert any("questions were repeated" in text and verdict == "note" for text, verdict in found.items())


def test_nobody_there_is_bad() -> None:
    found = only(robot_check.check_line(LineRig([]).line).findings)
    assert found.verdict == "bad" and "no servo answers at 1000000 bps" in found.text


def test_mending_asks_writes_and_checks(kit: LineRig) -> None:
    servos = robot_check.check_line(kit.line).servos
    asked = io.StringIO()
    found = list(robot_check.mend_delays(kit.line, servos, Dialogue(io.StringIO("y\n"), asked)))
    assert "Write return delay 0 to servo 1, 2? Their torque goes off" in asked.getvalue()
    assert [each.verdict for each in found] == ["ok", "ok"]
    assert [unit.registers.get("return_delay") for unit in kit.kit] == [0, 0, 0]
    fresh = robot_check.check_line(kit.line)
    assert fresh.numbers["return_delay"] == {}
    assert [each.text for each in robot_check.mend_delays(kit.line, fresh.servos, Dialogue(io.StringIO()))] == [
        "all return delays are 0"
    ]


def test_the_latency_timer_is_set_after_a_question(tmp_path: Path) -> None:
    timer = tmp_path / "ttyUSB7" / "latency_timer"
    timer.parent.mkdir()
    for answer, value in (("n\n", "16"), ("y\n", "1"), ("y\n", "1")):
        timer.write_text("16\n" if answer == "n\n" else timer.read_text())
        found = list(
            robot_check.mend_latency("/dev/ttyUSB7", Dialogue(io.StringIO(answer), io.StringIO()), tmp_path)
        )
        assert timer.read_text().strip() == value and len(found) <= 1
    assert list(robot_check.mend_latency("/dev/ttyACM0", Dialogue(io.StringIO()), tmp_path)) == []


@pytest.mark.parametrize("answer", ["n\n", ""])
def test_without_a_yes_nothing_is_mended(kit: LineRig, answer: str) -> None:
    servos = robot_check.check_line(kit.line).servos
    kit.sent.clear()
    dialogue = Dialogue(io.StringIO(answer), io.StringIO())
    assert only(robot_check.mend_delays(kit.line, servos, dialogue)).text == "nothing was changed"
    assert kit.sent == []


def test_a_chain_of_x_servos_is_measured(monkeypatch: pytest.MonkeyPatch) -> None:
    report = robot_check.check_line(LineRig([xl(1), xl(2)], 57_600).line)
    assert set(report.numbers["turnaround"]) == {"1", "2"}


def test_the_command_measures_and_mends(kit: LineRig, monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    def open_line(url: str) -> Line:
        return kit.line

    monkeypatch.setattr(doctor, "open_line", open_line)
    monkeypatch.setattr(tracing, "control_sockets", list)
    main(["doctor", "pipe://robot", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert told["bus"]["return_delay"] == {"1": 0.0005, "2": 0.0005}
    assert {each["verdict"] for each in told["findings"]} <= {"ok", "note", "bad"}
    assert main(["doctor", "--mend"]) == 78
    assert "--mend takes the url" in capsys.readouterr().err


# ---------------------------------------------------------------- behind a daemon


def test_behind_a_daemon_its_worker_is_asked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    path = tmp_path / "bioloid-54000.sock"
    chunks = [row for at in (8.0, 8.01) for row in ([at, ">", READ], [at + 0.00216, "<", ANSWER])]
    state = {
        "url": "/dev/ttyUSB7", "baud": 1_000_000, "link": True, "estop": "the red button",
        "devices": [{"id": 1, "model": 12, "protocol": 1}], "bus": {"rate": 100.0, "recent_errors": {"retried": 4}},
    }  # fmt: skip
    worker = WorkerSocket(path, state, [{"event": "Traffic", "chunks": chunks, "lost": 0}])
    monkeypatch.setattr(tracing, "control_sockets", lambda: [path])
    try:
        assert main(["doctor", "/dev/ttyUSB7", "--mend"]) == 78
    finally:
        worker.close()
    lines = capsys.readouterr().out.splitlines()
    assert "ok    a daemon serves /dev/ttyUSB7: it is asked, not the robot" in lines
    assert "bad   emergency stop by the red button; urbihw release ends it" in lines
    assert "note  4 questions were repeated" in lines
    assert "note  turnaround: 2.00 .. 2.00 ms (the slowest: 1): return delay, adapter or system" in lines
    assert "bad   a daemon serves this robot: stop it, then --mend" in lines
    assert sorted(worker.asked) == ["health", "trace"]


def test_the_same_port_by_another_name(tmp_path: Path) -> None:
    (tmp_path / "ttyUSB0").touch()
    (tmp_path / "by-id").symlink_to(tmp_path / "ttyUSB0")
    assert same_port(f"{tmp_path}/by-id?baud=57600", f"serial://{tmp_path}/ttyUSB0")
    assert not same_port("socket://a:1", "socket://a:2")
    assert not same_port("", "")


def test_an_older_daemon_is_told(tmp_path: Path) -> None:
    worker = WorkerSocket(tmp_path / "a.sock", {"ok": False, "error": "?"})
    try:
        with pytest.raises(ValueError, match="shows no traffic"):
            WorkerTraffic(tmp_path / "a.sock")
    finally:
        worker.close()


@pytest.mark.parametrize("baud", ["x", [], -1, float("nan"), 10**400])
def test_a_daemon_that_tells_no_speed_is_bad(
    baud: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    path = tmp_path / "bioloid-54000.sock"
    worker = WorkerSocket(path, {"url": "/dev/ttyUSB7", "baud": baud, "devices": []})
    monkeypatch.setattr(tracing, "control_sockets", lambda: [path])
    try:
        assert main(["doctor", "/dev/ttyUSB7"]) == 78
    finally:
        worker.close()
    assert f"bad   {path}: this daemon's answer has no sense; is it of the same version?" in capsys.readouterr().out


def test_many_ids_with_several_answers_are_one_line(kit: LineRig, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_check, "find_all", lambda link: Scan((), tuple(range(253))))
    lines = [each.text for each in robot_check.check_line(kit.line).findings]
    assert len(lines) == 2 and lines[0].startswith("253 ids (first 0, 1, 2,")
