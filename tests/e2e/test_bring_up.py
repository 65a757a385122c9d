"""docs/bring-up.md, played from its first line to its last with a simulated box of 18 servos.

What is typed on the page is typed here, by a shell in an empty folder; what the page prints must be printed, in this
order (``...`` stands for anything). The hands of the user are words at the console of the fake.
"""

from __future__ import annotations

import os
import re
import select
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import starts

from urbihw.buses.servos import calibration

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "bring-up.md"
COUNT = 18
SPARE = COUNT + 1
"""The place of the spare servo in the box."""
TIMEOUT_S = 300.0
_BLOCK = re.compile(r"^```(console|toml)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_ALL = " ".join(str(number) for number in range(1, COUNT + 1))


class Robot:
    """The fake in its own process, and its console."""

    def __init__(self, path: Path) -> None:
        servos = ",".join(["AX-12:1"] * SPARE)
        self._process = starts.Forked(
            [sys.executable, "-m", "urbihw_fakes", "bioloid", "--pty", str(path), "--follow-baud", "--servos", servos,
             "--until-eof"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT / "fakes",
        )  # fmt: skip
        assert self._process.stdout is not None
        self._process.stdout.readline()
        self.path = path

    def say(self, words: str) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(words + "\n")
        self._process.stdin.flush()
        assert self._process.stdout.readline() == "ok\n", words

    def position(self, number: int) -> int:
        """Where the horn of a servo is, in its own counts."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"state {number}\n")
        self._process.stdin.flush()
        match = re.search(r"present_position=(\d+)", self._process.stdout.readline())
        assert match
        return int(match[1])

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(10)
        self._process.stdout.close()


class User:
    """Types the commands of the page and does what the tools ask for."""

    def __init__(self, robot: Robot, folder: Path) -> None:
        self._robot = robot
        self._folder = folder
        self._joints = 0

    def type(self, command: str) -> str:
        """Run a command; return what it printed."""
        for text, real in (("/dev/ttyUSB0", str(self._robot.path)), ("sudo ", ""), ("/etc/", f"{self._folder}/etc/")):
            command = command.replace(text, real)
        command = command.replace("install-service", f"install-service --root {self._folder}")
        environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
        process = subprocess.Popen(
            ["bash", "-ec", command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            cwd=self._folder, env=environment,
        )  # fmt: skip
        assert process.stdin is not None
        assert process.stdout is not None
        said, done = "", 0
        end = time.monotonic() + TIMEOUT_S
        while data := self._read(process.stdout.fileno(), end):
            said += data
            for asked, answer in self._answers().items():
                if match := re.search(asked, said[done:]):
                    done += match.end()
                    process.stdin.write(answer(match).encode() + b"\n")
                    process.stdin.flush()
        process.stdin.close()
        process.stdout.close()
        assert process.wait(TIMEOUT_S) == 0, f"{command}\n{said}"
        return said

    def _read(self, descriptor: int, end: float) -> str:
        assert select.select([descriptor], [], [], max(0.0, end - time.monotonic()))[0], "the tool hangs"
        return os.read(descriptor, 4096).decode()

    def _answers(self) -> dict[str, Callable[[re.Match[str]], str]]:
        """What is asked -> what the user does, which returns what is typed."""
        return {
            r"Plug in only the servo that becomes (\d+), .*: $": self._plug_in,
            r"Hold the robot: .*: $": lambda _: "",
            r"Move each joint .*\n$": self._move_all,
            r"Unplug all of them but the new one, .*: $": self._only_spare,
            r"Unplug all servos with this id but one, .*: $": self._only_spare,
            r"Go on\? \[y/N\] $": lambda _: "y",
        }

    def _plug_in(self, match: re.Match[str]) -> str:
        self._robot.say(f"connect {match[1]}")
        return ""

    def _only_spare(self, _: re.Match[str]) -> str:
        self._robot.say(f"connect {SPARE}")
        return ""

    def _move_all(self, _: re.Match[str]) -> str:
        for degrees in (50, -100, 50):
            for joint in range(1, COUNT + 1):
                self._robot.say(f"turn {joint} {degrees}")
            time.sleep(1.0)  # some looks of the tool, also on a busy computer
        return ""


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Robot]:
    made = Robot(tmp_path / "bus")
    try:
        yield made
    finally:
        made.close()


def happen(robot: Robot, words: str) -> None:
    """What the page tells in words: a broken servo, and two with one id."""
    what, number = words.split()
    if what == "break":
        others = [str(each) for each in range(1, SPARE + 1) if each != int(number)]
        robot.say(f"connect {' '.join(others)}")
    else:
        # The spare one, which is number 11 now, gets the id of another one while it is alone.
        robot.say(f"connect {SPARE}")
        User(robot, robot.path.parent).type(f"urbihw servo set-id {robot.path} {number}")
        robot.say("connect all")


def agree(page: list[str], said: list[str]) -> bool:
    """Whether these lines were printed, in this order."""
    if not page:
        return not said
    if page[0] == "...":
        return any(agree(page[1:], said[at:]) for at in range(len(said) + 1))
    parts = [re.escape(part) for part in " ".join(page[0].split()).split("...")]
    return bool(said) and bool(re.fullmatch(".*".join(parts), said[0])) and agree(page[1:], said[1:])


def spoken(text: str) -> list[str]:
    """Lines with single blanks; what a user typed behind a question is not printed by a pipe."""
    return [" ".join(line.split()) for line in text.splitlines() if line.strip()]


@pytest.mark.long
def test_the_page_is_played(robot: Robot, tmp_path: Path) -> None:
    user = User(robot, tmp_path)
    robot.say("connect 1")
    for kind, body in _BLOCK.findall(PAGE.read_text()):
        if kind == "toml":
            name = re.match(r"# (\S+)\n", body)
            assert name
            (tmp_path / name[1]).write_text(body.replace("/dev/ttyUSB0", str(robot.path)))
            continue
        for step in re.split(r"^(?=[$#] )", body, flags=re.MULTILINE)[1:]:
            first, *printed = step.splitlines()
            if first.startswith("# fake: "):
                happen(robot, first.removeprefix("# fake: "))
                continue
            said = user.type(first.removeprefix("$ "))
            expected = [line.removesuffix(" y") for line in spoken("\n".join(printed))]
            assert agree(expected, spoken(said)), f"{first}\nthe page:\n{expected}\nprinted:\n{spoken(said)}"
            if "set-id" in first and _ALL in first:
                robot.say(f"connect {_ALL}")

    joints = calibration.load(tmp_path / "humanoid.json")
    assert len(joints) == COUNT and joints["foot_r"].id == COUNT
    # 50 degrees to both sides of the middle of an AX-12.
    assert all(abs(joint.range_max - joint.range_min - 341) <= 1 for joint in joints.values())
    assert (tmp_path / "etc" / "urbihw" / "humanoid.toml").is_file()
    robot.say(f"connect {_ALL}")
    serve_and_move(robot, tmp_path)


def serve_and_move(robot: Robot, folder: Path) -> None:
    """Serve the robot that the page has made: a joint moves by its name, and not further than its range."""
    programs = Path(sys.executable).parent
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = str(probe.getsockname()[1])
    with subprocess.Popen(
        [programs / "urbihw", "serve", "--config", "etc/urbihw/humanoid.toml", "--port", port], cwd=folder,
        stderr=subprocess.PIPE, text=True,
    ) as server:  # fmt: skip
        try:
            assert server.stderr is not None
            line = server.stderr.readline()
            assert "18 servos" in line, line
            text = "knee_l.load = 1; waituntil(knee_l.load == 1); knee_l.val = 3 time:1s; sleep(1s); 1;"
            send = [str(programs / "urbi-send"), "-P", port, "-e", text, "--quit"]
            sent = subprocess.run(send, capture_output=True, text=True, timeout=TIMEOUT_S)
            assert "!!!" not in sent.stdout, sent.stdout
            end = time.monotonic() + TIMEOUT_S
            while abs(robot.position(13) - 682) > 3:  # 50 degrees beyond the middle: the end of its range
                assert time.monotonic() < end, robot.position(13)
                time.sleep(0.1)
        finally:
            server.terminate()
