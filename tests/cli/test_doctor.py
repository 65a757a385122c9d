"""``urbihw doctor``: the machine, below a folder of the test; the bus, with a simulated kit or behind a daemon."""

from __future__ import annotations

import io
import json
from collections.abc import Iterable
from pathlib import Path

import pytest
from buses.line_rig import LineRig, ax, xl
from worker_socket import WorkerSocket

from urbihw.buses.link import Link
from urbihw.buses.servos import changes
from urbihw.buses.servos.bus import ServoBus
from urbihw.buses.servos.device import ServoDevice, ServoScan
from urbihw.buses.servos.line import ServoLine
from urbihw.buses.servos.survey import SurveyedServo, read_live
from urbihw.cli import doctor, machine, robot_check, tracing
from urbihw.cli.dialogue import Dialogue
from urbihw.cli.machine import ReportLine
from urbihw.cli.main import main
from urbihw.cli.tracing import WorkerTraffic, same_port
from urbihw.cli.urls import check_url

Capture = pytest.CaptureFixture[str]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "diagnosis.md"
READ, ANSWER = "ffff0104022402d2", "ffff0104000002f8"


def write(root: Path, name: str, text: str) -> None:
    (root / name).parent.mkdir(parents=True, exist_ok=True)
    (root / name).write_text(text)


def silent(words: Iterable[str]) -> str:
    return ""


def only(found: Iterable[ReportLine]) -> ReportLine:
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
    assert only(machine.governor(tmp_path)) == ReportLine("ok", "processor governor none")
    write(tmp_path, "sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "performance\n")
    assert only(machine.governor(tmp_path)).verdict == "ok"
    write(tmp_path, "sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "ondemand\n")
    found = only(machine.governor(tmp_path))
    assert found.verdict == "note" and found.text.startswith("processor governor ondemand: ")


def test_udev_rules(tmp_path: Path) -> None:
    assert only(machine.udev_rules(tmp_path)).verdict == "note"
    write(tmp_path, "usr/lib/udev/rules.d/99-urbihw.rules", "")
    assert only(machine.udev_rules(tmp_path)) == ReportLine("ok", "udev rules: /usr/lib/udev/rules.d/99-urbihw.rules")


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
    verdicts = [[each.verdict for each in machine.real_time(tmp_path, may_be_one)] for may_be_one in (True, False)]
    assert verdicts == [["note", "ok"], ["note", "note"]]
    write(tmp_path, "proc/meminfo", "MemTotal: what")
    write(tmp_path, "proc/loadavg", "")
    assert not [*machine.memory(tmp_path), *machine.load(tmp_path, 1)]


def test_an_empty_machine_is_no_traceback(tmp_path: Path) -> None:
    assert all(each.verdict != "bad" for each in machine.check_machine(tmp_path, silent))


# ---------------------------------------------------------------- a bus that no daemon serves


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


@pytest.mark.parametrize(("times", "verdict"), [(2, "note"), (3, "bad")])
def test_a_servo_that_fails_now_and_then_is_told(
    kit: LineRig, times: int, verdict: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def spoil(bus: ServoBus, device: ServoDevice) -> SurveyedServo:
        found = read_live(bus, device)
        if device.id == 3:
            kit.kit.faults.start("checksum", 2, times=times)
        return found

    monkeypatch.setattr(robot_check, "read_live", spoil)
    found = [(each.text, each.verdict) for each in robot_check.check_line(kit.line).findings]
    hint = "check cables and ground; two servos may have one id"
    assert (f"{times} damaged answers in 20 cycles: {hint}", verdict) in found
    assert ("2 questions were repeated in 20 cycles", "note") in found


@pytest.mark.parametrize("search", [1, 2])
def test_a_servo_that_one_search_misses_is_found_and_told(
    kit: LineRig, search: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    searches: list[int] = []

    def find_all(link: Link) -> ServoScan:
        searches.append(len(searches) + 1)
        kit.kit.faults.stop()
        if searches[-1] == search:
            kit.kit.faults.start("silence", 2)
        found = changes.find_all(link)
        kit.kit.faults.stop()
        return found

    monkeypatch.setattr(robot_check, "find_all", find_all)
    report = robot_check.check_line(kit.line)
    assert [servo.device.id for servo in report.servos] == [1, 2, 3]
    expected = ReportLine("note", "servo 2: found in one of two searches only: check its cable and supply")
    assert expected in report.findings and searches == [1, 2]


@pytest.mark.parametrize(
    ("url", "told"),
    [
        ("blah://x", "unknown kind 'blah'; known: can, "),
        ("/dev/ttyUSB9?boud=3", "boud: no such parameter; did you mean baud?"),
        ("spykee://10.0.0.1?bla=3", "bla: no such parameter; there is: discovery"),
        ("spy://blah://x", "unknown kind 'blah'"),
        ("/dev/a\nb", "unprintable"),
    ],
)
@pytest.mark.parametrize("words", [("doctor",), ("doctor", "--json"), ("scan",), ("trace",), ("servo", "list")])
def test_a_wrong_url_is_one_line_everywhere(url: str, told: str, words: tuple[str, ...], capsys: Capture) -> None:
    command = ("servo", "read", url, "all") if words[0] == "servo" else (*words, url)
    assert main(command) == 78
    output = capsys.readouterr()
    (line,) = output.err.splitlines()
    assert line.startswith("urbihw: bus url") and told in line and not output.out


def test_a_parameter_of_the_robot_in_a_url_is_no_mistake() -> None:
    check_url("socket://localhost:8101?laser=/dev/ttyUSB1")


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
    def open_line(url: str) -> ServoLine:
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
        "devices": [{"id": 1, "model": 12, "protocol": 1}],
        "bus": {"rate": 100.0, "wanted_rate": 100.0, "recent_errors": {"retried": 400}, "recent_seconds": 60},
    }  # fmt: skip
    worker = WorkerSocket(path, state, [{"event": "Traffic", "chunks": chunks, "lost": 0}])
    monkeypatch.setattr(tracing, "control_sockets", lambda: [path])
    try:
        assert main(["doctor", "/dev/ttyUSB7", "--mend"]) == 78
    finally:
        worker.close()
    lines = capsys.readouterr().out.splitlines()
    assert "ok    a daemon serves /dev/ttyUSB7: it is asked, not the robot" in lines
    assert "bad   emergency stop by the red button; urbihw release ends it, with --all also if it is not yours" in lines
    assert "note  400 retried on the wire in 60 s" in lines
    assert "note  turnaround: 2.00 .. 2.00 ms (the slowest: 1): return delay, adapter or system" in lines
    assert "bad   a daemon serves this robot: stop it, then --mend" in lines
    assert sorted(worker.asked) == ["health", "trace"]


def served_report(path: Path, events: list[dict[str, object]], **told: object) -> dict[str, str]:
    """The findings about a Bioloid whose worker tells this, by text."""
    state = {
        "url": "/dev/ttyUSB7", "baud": 1_000_000, "link": True, "devices": [{"device": 1, "state": "ok"}],
        "bus": {"rate": 100.0, "wanted_rate": 100.0, "recent_errors": {}, "recent_seconds": 60}, **told,
    }  # fmt: skip
    worker = WorkerSocket(path, state, events)
    try:
        with WorkerTraffic(path) as traffic:
            report = robot_check.check_served(traffic)
    finally:
        worker.close()
    return {each.text: each.verdict for each in report.findings}


@pytest.mark.parametrize(
    ("missing", "load", "verdict", "hint"),
    [
        ("once", 0.1, "ok", ": up to 1 % is normal"),
        ("4 times", 0.1, "note", ": check its cable and supply"),
        ("40 times", 0.1, "bad", ": check its cable and supply"),
        ("40 times", 9.04, "note",
         ": this computer is busy (4.5 programs for each processor): look again when it is idle"),
    ],
)
def test_missing_answers_are_judged_by_their_share(
    tmp_path: Path, missing: str, load: float, verdict: str, hint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("os.getloadavg", lambda: (load, load, load))
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    rows, count = [], 1 if missing == "once" else int(missing.split()[0])
    for number in range(201):
        rows.append([8.0 + number / 100, ">", READ])
        if not 0 < number <= count:
            rows.append([8.0 + number / 100 + 0.001, "<", ANSWER])
    rows.append([10.005, ">", READ])  # Its answer would come behind the end.
    found = served_report(tmp_path / "bioloid-54000.sock", [{"event": "Traffic", "chunks": rows}])
    (text,) = [text for text in found if text.startswith("no answer")]
    assert (text, found[text]) == (f"no answer in 201 cycles from 1 ({missing}){hint}", verdict)


def test_a_question_that_is_cut_off_is_no_error(tmp_path: Path) -> None:
    rows = [[8.0, ">", READ], [8.001, "<", ANSWER], [9.0, ">", READ]]
    found = served_report(tmp_path / "bioloid-54000.sock", [{"event": "Traffic", "chunks": rows}])
    assert found["no question without an answer, no damaged answer in 100 cycles"] == "ok"


def test_a_lost_device_is_told_once(tmp_path: Path) -> None:
    rows = [[8.0, ">", READ], [9.0, ">", READ], [9.5, ">", READ]]
    lost = [{"device": 1, "state": "lost", "reason": "no answer"}]
    found = served_report(tmp_path / "bioloid-54000.sock", [{"event": "Traffic", "chunks": rows}], devices=lost)
    assert found["1: lost: no answer"] == "bad"
    assert not any(text.startswith("no answer in") for text in found)


@pytest.mark.parametrize(
    ("link", "events", "text"),
    [
        (False, [], "no link: the robot was never there"),
        (True, [], "nothing was on the wire for 2 s: it is not measured"),
    ],
)
def test_nothing_is_told_of_a_wire_without_traffic(
    tmp_path: Path, link: bool, events: list[dict[str, object]], text: str
) -> None:
    found = served_report(tmp_path / "bioloid-54000.sock", events, link=link)
    assert list(found)[1:] == [text]


def test_errors_are_not_counted_where_traffic_was_lost(tmp_path: Path) -> None:
    rows = [[8.0, ">", READ], [9.0, ">", READ], [9.5, ">", READ]]
    found = served_report(tmp_path / "bioloid-54000.sock", [{"event": "Traffic", "chunks": rows, "lost": 7}])
    assert found["7 pieces of the traffic were lost on the way here: its errors are not counted"] == "note"
    assert not any("answer in" in text for text in found)


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
    monkeypatch.setattr(robot_check, "find_all", lambda link: ServoScan((), tuple(range(253))))
    lines = [each.text for each in robot_check.check_line(kit.line).findings]
    assert len(lines) == 2 and lines[0].startswith("253 ids (first 0, 1, 2,")
