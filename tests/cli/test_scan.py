"""``urbihw scan``: what is found, line by line, and what is said when nothing is."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from buses.line_rig import LineRig, ax, xl

from urbihw import platforms
from urbihw.buses.errors import Unavailable
from urbihw.buses.ports import SerialPort
from urbihw.buses.servos.line import ServoLine
from urbihw.cli import scan_ports
from urbihw.cli.main import main
from urbihw.cli.progress import ProgressBar
from urbihw.platforms.spykee import discovery
from urbihw_fakes.feetech.bus import FeetechBus
from urbihw_fakes.feetech.servo import FeetechServo


def test_each_robot_is_a_line_with_its_url(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    robots = [discovery.FoundRobot("10.0.0.7:9000", "SPYKEE1", ""), discovery.FoundRobot("10.0.0.8:9000", "B", "admin")]
    monkeypatch.setattr(discovery, "search", lambda: iter(robots))
    assert main(["scan", "spykee"]) == 0
    lines = "spykee://10.0.0.7:9000  SPYKEE1\nspykee://10.0.0.8:9000  B, in use by admin\n"
    assert capsys.readouterr().out == lines


def test_a_name_cannot_command_a_terminal(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(discovery, "search", lambda: iter([discovery.FoundRobot("10.0.0.7:9000", "A\x1b[2J\nB", "")]))
    assert main(["scan", "spykee"]) == 0
    assert capsys.readouterr().out == "spykee://10.0.0.7:9000  A\\x1b[2J\\nB\n"


def test_nobody_and_no_network_are_said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def no_network() -> Iterator[object]:
        raise OSError(101, "Network is unreachable")

    for search, words in ((lambda: iter(()), "no spykee answers"), (no_network, "Network is unreachable")):
        monkeypatch.setattr(discovery, "search", search)
        assert main(["scan", "spykee"]) == 69
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("urbihw: ") and words in line


@pytest.mark.parametrize(
    ("platform", "words"), [("bioloid", "cannot be looked for"), ("spyke", "did you mean spykee?")]
)
def test_what_cannot_be_looked_for(platform: str, words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scan", platform]) == 78
    assert words in capsys.readouterr().err


def test_a_manifest_that_names_no_function_is_said() -> None:
    manifest = platforms.find("spykee")
    for scan in ("discovery:none", "nowhere:scan"):
        wrong = platforms.Manifest(**{**vars(manifest), "scan": scan})
        with pytest.raises(platforms.BadManifest, match=r"platform.toml: scan: "):
            platforms.scan(wrong)


# ---------------------------------------------------------------- servos


def ports(monkeypatch: pytest.MonkeyPatch, found: list[SerialPort], rigs: dict[str, LineRig | str]) -> None:
    """Let these ports be there; a text in place of a line is why it cannot be opened."""

    def open_line(url: str, baud: int | None = None) -> ServoLine:
        rig = rigs[url.partition("?")[0]]
        if isinstance(rig, str):
            raise Unavailable(16, rig)
        rig.line.set_speed(baud or 1_000_000)
        return rig.line

    monkeypatch.setattr(scan_ports, "serial_ports", lambda: found)
    monkeypatch.setattr(scan_ports, "open_line", open_line)


U2D2 = SerialPort("/dev/ttyUSB0", 0x0403, 0x6014, "U2D2", "FT4", "/dev/serial/by-id/usb-FTDI-FT4")


def test_all_ports_are_scanned_and_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    nxt = SerialPort("/dev/ttyACM7", 0x0694, 0x0002, "NXT")
    console = SerialPort("/dev/ttyS0", None, None, "n/a")
    busy = SerialPort("/dev/ttyUSB1", 0x0403, 0x6014, "U2D2")
    rig = LineRig([ax(1), ax(2, return_delay=0), ax(2, return_delay=0), xl(3)])
    words = "/dev/ttyUSB1 is in use by an urbihw daemon (process 42): stop that first"
    ports(monkeypatch, [U2D2, busy, nxt, console], {"/dev/ttyUSB0": rig, "/dev/ttyUSB1": words})
    assert main(["scan"]) == 0
    said = capsys.readouterr()
    lines = [" ".join(line.split()) for line in said.out.splitlines()]
    assert lines[0].startswith("/dev/ttyUSB0: U2D2") and "serial number FT4" in lines[0] and "by-id" in lines[0]
    assert lines[1].startswith("id 2 at 1000000 bps: more than one servo answers")
    assert lines[2].startswith("servos of several speeds on one line")
    assert "1000000 1 AX-12A 24 12.0 32 0.72 return delay 250: set return_delay_time to 0 (0.50 ms a cycle)" in lines
    assert any(line.startswith("57600 3 XL430-W250 ") for line in lines)
    assert any("2 found in " in line and "1.0 ms can be saved" in line for line in lines)
    assert words in lines
    assert any(line.startswith("/dev/ttyACM7: ") and "NXT" in line for line in lines)
    assert "no adapter for servos, not scanned; to scan it: urbihw scan /dev/ttyACM7" in lines
    assert "no USB adapter, not scanned; to scan it: urbihw scan /dev/ttyS0" in lines
    assert said.err == ""


def test_a_port_whose_speed_does_not_count_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Deaf(LineRig):
        """Its units hear every speed."""

        def receive(self, data: bytes, at: float) -> None:
            self.kit.baud = 1_000_000
            super().receive(data, at)

    ports(monkeypatch, [U2D2], {"/dev/ttyUSB0": Deaf([ax(4), ax(5)])})
    assert main(["scan"]) == 0
    said = capsys.readouterr().out
    assert "the same servos answer at 14 speeds: this port does not set its speed" in said
    assert "servos of several speeds" not in said
    assert said.count("AX-12A") == 2 and "  2 found in " in said


def test_a_scan_for_programs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    ports(monkeypatch, [U2D2], {"/dev/ttyUSB0": LineRig([ax(4)])})
    assert main(["scan", "/dev/ttyUSB0?baud=1000000", "--json"]) == 0
    (port,) = json.loads(capsys.readouterr().out)["ports"]
    assert port["serial_number"] == "FT4" and port["bauds"] == [1_000_000] and port["conflicts"] == []
    (servo,) = port["servos"]
    assert (servo["id"], servo["model"], servo["voltage"], servo["baud"]) == (4, "AX-12A", 12.0, 1_000_000)
    assert servo["findings"] == [{"text": "return delay 250: set return_delay_time to 0", "cost": 0.0005}]


def test_nothing_found_and_a_port_in_use(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    ports(monkeypatch, [U2D2], {"/dev/ttyUSB0": LineRig([])})
    assert main(["scan", "/dev/ttyUSB0", "--baud", "1000000", "--protocol", "1"]) == 69
    assert "no servo answers (1 speed, " in capsys.readouterr().out
    ports(monkeypatch, [U2D2], {"/dev/ttyUSB0": "/dev/ttyUSB0 is in use by minicom (process 7): close that first"})
    assert main(["scan", "/dev/ttyUSB0"]) == 78
    assert capsys.readouterr().err == "urbihw: /dev/ttyUSB0 is in use by minicom (process 7): close that first\n"
    ports(monkeypatch, [], {})
    assert main(["scan"]) == 69
    assert capsys.readouterr().err == "urbihw: no serial port found: plug the adapter in\n"


def test_a_feetech_chain_is_told_with_its_firmware(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    units = [FeetechServo("STS3215", 1), FeetechServo("SCS0009", 7)]
    ports(monkeypatch, [U2D2], {"/dev/ttyUSB0": LineRig([], kit=FeetechBus(units))})
    assert main(["scan", "/dev/ttyUSB0", "--baud", "1000000"]) == 0
    lines = [line.split()[:4] for line in capsys.readouterr().out.splitlines()]
    ports(monkeypatch, [U2D2], {"/dev/ttyUSB0": LineRig([], kit=FeetechBus(units))})
    assert main(["scan", "/dev/ttyUSB0", "--baud", "1000000", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ports"][0]["servos"][0]["protocol"] == "feetech"
    assert ["1000000", "1", "STS3215", "3.10"] in lines and ["1000000", "7", "SCS0009"] in [line[:3] for line in lines]


def test_a_port_in_this_folder_is_no_platform(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "ARM").touch()
    monkeypatch.chdir(tmp_path)
    ports(monkeypatch, [], {"./ARM": LineRig([ax(4)])})
    assert main(["scan", "ARM?baud=1000000"]) == 0
    assert "AX-12A" in capsys.readouterr().out


def test_a_slow_adapter_costs_its_time_at_each_answer(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ports(monkeypatch, [U2D2], {"/dev/ttyUSB0": LineRig([ax(1, return_delay=0), ax(2, return_delay=0)])})
    monkeypatch.setattr(scan_ports, "latency", lambda path: 0.016)
    assert main(["scan", "/dev/ttyUSB0", "--baud", "1000000"]) == 0
    said = capsys.readouterr().out
    assert "keeps each answer back for 16 ms" in said and "of which 32.0 ms can be saved" in said


def test_the_bar_is_for_terminals_only() -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen, pipe = Terminal(), io.StringIO()
    for stream in (screen, pipe):
        with ProgressBar(stream) as bar:
            bar.show(0.5, "57600 bps")
    assert "###############...............] 57600 bps" in screen.getvalue() and screen.getvalue().endswith("\r\x1b[K")
    assert pipe.getvalue() == ""
