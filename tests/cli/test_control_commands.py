"""``urbihw stop``, ``estop`` and ``release``, with bus workers that answer what a test says."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from urbihw import control_line
from urbihw.cli import control, direct
from urbihw.cli.main import main
from urbihw.control_address import abstract_address
from urbihw.daemon import runtime
from urbihw.daemon.config import Config

pytestmark = pytest.mark.e2e

Capture = pytest.CaptureFixture[str]
STATE = {"ok": True, "epoch": 3, "estop": "", "link": True}


class Robot:
    """A control socket that answers each line with the same, or (None) with nothing."""

    def __init__(
        self, path: Path, answer: dict[str, Any] | bytes | None, address: bytes | None = None
    ) -> None:
        self.path = path
        self.heard: list[dict[str, Any]] = []
        self._answer = answer
        self._listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._listener.bind(address or str(path))
        self._listener.listen()
        self._held: list[socket.socket] = []
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def close(self) -> None:
        """Listen no more; the file stays, as after kill -9."""
        self._listener.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        for connection in (self._listener, *self._held):
            connection.close()

    def _serve(self) -> None:
        while True:
            try:
                connection, _ = self._listener.accept()
            except OSError:
                return
            self._held.append(connection)
            for line in connection.recv(4096).splitlines():
                self.heard.append(json.loads(line))
                if self._answer is not None:
                    # In two pieces, as it may come.
                    raw = isinstance(self._answer, bytes)
                    data = self._answer if raw else json.dumps(self._answer).encode() + b"\n"
                    assert isinstance(data, bytes)
                    with contextlib.suppress(OSError):  # the command does not read all that is said
                        connection.sendall(data[:7])
                        connection.sendall(data[7:])


Add = Callable[..., Robot]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the control sockets of this user are."""
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    for module in (runtime, control, direct):
        monkeypatch.setattr(module, "SERVICE_FOLDER", tmp_path / "service")
    found = runtime.runtime_folder()
    assert found == tmp_path / "urbihw"
    return found


@pytest.fixture
def add(folder: Path) -> Iterator[Add]:
    made: list[Robot] = []

    def start(
        name: str = "bioloid-54000", answer: dict[str, Any] | bytes | None = STATE, where: Path = folder,
        address: bytes | None = None,
    ) -> Robot:
        where.mkdir(exist_ok=True)
        made.append(Robot(where / f"{name}.sock", answer, address))
        return made[-1]

    yield start
    for robot in made:
        robot.close()


def leave(folder: Path, name: str) -> None:
    """What a killed worker leaves."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as dead:
        dead.bind(str(folder / f"{name}.sock"))


# ---------------------------------------------------------------- one robot


@pytest.mark.parametrize(
    ("verb", "state", "line"),
    [
        ("stop", {}, "stopped"),
        ("stop", {"estop": "me"}, "stopped; an emergency stop holds (me) until: urbihw release"),
        ("stop", {"link": False}, "stopped; its link is down: it will be stopped as soon as the link is back"),
        ("estop", {"estop": "me"}, "emergency stop, held until: urbihw release"),
        ("estop", {"unkept": "no room"}, "emergency stop, held until: urbihw release; no room"),
        ("release", {}, "released"),
        ("release", {"link": False}, "released"),
    ],
)
def test_each_says_what_has_become_of_the_robot(
    add: Add, capsys: Capture, verb: str, state: dict[str, Any], line: str
) -> None:
    robot = add(answer=STATE | state)
    assert main((verb, "--who", "the tester")) == 0
    assert capsys.readouterr() == (f"bioloid-54000: {line}\n", "")
    assert robot.heard == [{"do": verb, "who": "the tester"}]


def test_who_asks_is_the_user_at_the_terminal_or_the_command(
    add: Add, monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    robot = add()

    def no_terminal(descriptor: int) -> str:
        raise OSError("not a terminal")

    monkeypatch.setattr("os.ttyname", no_terminal)
    assert main(("stop",)) == 0
    monkeypatch.setattr("os.ttyname", lambda descriptor: "/dev/pts/3")
    assert main(("stop",)) == 0
    assert robot.heard[0]["who"] == "urbihw stop"
    assert robot.heard[1]["who"].endswith("@pts/3")
    assert main(("stop", "--who", "x" * 9999)) == 0
    assert len(robot.heard[2]["who"]) == 100


def test_a_socket_may_be_anywhere(add: Add, tmp_path: Path, capsys: Capture) -> None:
    add("bioloid-1")
    robot = add("elsewhere", where=tmp_path)
    assert main(("estop", "--socket", str(robot.path))) == 0
    assert capsys.readouterr().out == "elsewhere: emergency stop, held until: urbihw release\n"


def test_an_answer_that_makes_no_sense_is_no_stop(add: Add, capsys: Capture) -> None:
    add(answer={"ok": False, "error": "what?"})
    assert main(("stop",)) == 69
    assert "bioloid-54000: it did not understand" in capsys.readouterr().err


@pytest.mark.parametrize(("words", "asked"), [
    (("--of", "Ann (panel)", "--of", "the red \"button\""), {"others": ["Ann (panel)", "the red \"button\""]}),
    (("--all",), {"everyone": True}),
])
def test_a_release_may_be_for_others(add: Add, words: tuple[str, ...], asked: dict[str, Any]) -> None:
    robot = add()
    assert main(("release", "--who", "me", *words)) == 0
    assert robot.heard == [{"do": "release", "who": "me", **asked}]


@pytest.mark.parametrize(("state", "line"), [
    ({"estop": "Ann (panel)", "released": False}, "an emergency stop of Ann (panel) holds"),
    ({"estop": "Ann", "released": True}, "your emergency stop is released, but that of Ann holds"),
])
def test_a_release_while_others_hold_the_robot_tells_who_and_what_to_do(
    add: Add, capsys: Capture, state: dict[str, Any], line: str
) -> None:
    add(answer=STATE | state)
    assert main(("release",)) == 69
    hint = "who has pressed it releases it, or: urbihw release --all"
    assert capsys.readouterr() == ("", f"urbihw: bioloid-54000: {line}: {hint}\n")


def test_a_refusal_of_the_worker_is_told(add: Add, capsys: Capture) -> None:
    add(answer={"ok": False, "refused": True, "error": "use sudo"})
    assert main(("release", "--all")) == 69
    assert capsys.readouterr().err == "urbihw: bioloid-54000: use sudo\n"


def test_who_calls_sudo_presses_for_himself(add: Add, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = add()
    monkeypatch.setattr(os, "getuid", lambda: 0)
    monkeypatch.setenv("SUDO_UID", "1000")
    main(("estop", "--who", "me"))
    assert robot.heard == [{"do": "estop", "who": "me", "user": "uid 1000"}]


# ---------------------------------------------------------------- no worker


@pytest.mark.parametrize("verb", ["stop", "estop", "release"])
def test_nobody_is_one_line_that_says_what_to_do(folder: Path, capsys: Capture, verb: str) -> None:
    for name in ("", "bioloid-54000", "bioloid-54001"):
        if name:
            leave(folder, name)
        assert main((verb,)) == 69
        out, err = capsys.readouterr()
        assert out == ""
        assert len(err.splitlines()) == 1
        assert "no daemon answers" in err


def test_a_socket_that_is_not_there(tmp_path: Path, capsys: Capture) -> None:
    assert main(("stop", "--socket", str(tmp_path / "none.sock"))) == 69
    assert "no daemon answers" in capsys.readouterr().err


def test_one_that_hangs_is_told_after_a_second(add: Add, capsys: Capture) -> None:
    add(answer=None)
    begin = time.monotonic()
    assert main(("estop",)) == 69
    assert time.monotonic() - begin > 0.9
    assert capsys.readouterr().err.startswith("urbihw: bioloid-54000: no answer in 1 s")


@pytest.mark.parametrize("answer", [b"x" * (5 << 20), b'{"ok": true, "a": ' + b"[" * 200_000 + b"\n", b"\xff\n"])
def test_what_is_no_bus_worker_is_told_in_one_line_and_the_others_stop(
    add: Add, capsys: Capture, answer: bytes
) -> None:
    add("a-1", answer=answer)
    robot = add("b-2")
    assert main(("estop",)) == 69
    out, err = capsys.readouterr()
    assert out.startswith("b-2: emergency stop") and robot.heard
    assert err.count("\n") == 1 and "a-1: what answers at" in err


def test_without_rights_it_says_which_to_get(folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    leave(folder, "bioloid-54000")

    def refuse(path: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(control_line, "dial_control", refuse)
    assert main(("stop",)) == 69
    assert "use sudo, or join the group" in capsys.readouterr().err


def test_a_folder_of_the_service_that_may_not_be_read_is_told(
    folder: Path, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "service").mkdir()
    monkeypatch.setattr("os.access", lambda path, mode: False)
    assert main(("stop",)) == 69
    assert "service may not be read: use sudo" in capsys.readouterr().err


def test_a_folder_of_somebody_else_keeps_no_service_from_being_stopped(
    add: Add, folder: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder.chmod(0o777)
    assert main(("stop",)) == 78
    assert "can be written by others" in capsys.readouterr().err
    add(where=tmp_path / "service")
    assert main(("stop",)) == 0
    assert capsys.readouterr().out == "bioloid-54000: stopped\n"


def test_a_robot_whose_socket_file_was_deleted_is_found_and_stopped(add: Add, folder: Path, capsys: Capture) -> None:
    path = folder / "bioloid-54000.sock"
    robot = add(address=abstract_address(path))
    for words in (("estop",), ("estop", "--socket", str(path)), ("release",)):
        assert main(words) == 0
        assert capsys.readouterr().out.startswith("bioloid-54000: ")
    assert [each["do"] for each in robot.heard] == ["estop", "estop", "release"]


# ---------------------------------------------------------------- several robots


@pytest.mark.parametrize("verb", ["stop", "estop"])
def test_all_robots_stop(add: Add, tmp_path: Path, capsys: Capture, verb: str) -> None:
    robots = [add("bioloid-1"), add("nxt-2"), add("segway-3", where=tmp_path / "service")]
    assert main((verb,)) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition(":")[0] for line in lines] == ["bioloid-1", "nxt-2", "segway-3"]
    assert [robot.heard[0]["do"] for robot in robots] == [verb] * 3


def test_one_that_hangs_keeps_no_other_from_stopping(add: Add, capsys: Capture) -> None:
    for number in range(10):
        add(f"a-{number}", answer=None)
    robot = add("b-1")
    begin = time.monotonic()
    assert main(("estop",)) == 69
    assert time.monotonic() - begin < 8
    out, err = capsys.readouterr()
    assert out.startswith("b-1: emergency stop")
    assert len(err.splitlines()) == 10
    assert robot.heard


def test_one_that_is_gone_is_told_beside_those_that_stop(add: Add, folder: Path, capsys: Capture) -> None:
    add("bioloid-1")
    leave(folder, "nxt-2")
    assert main(("stop",)) == 0
    out, err = capsys.readouterr()
    assert out == "bioloid-1: stopped\n"
    assert err.startswith("urbihw: nxt-2: no server listens")


def test_a_release_is_for_one_robot(add: Add, folder: Path, capsys: Capture) -> None:
    one, two = add("bioloid-1"), add("nxt-2")
    assert main(("release",)) == 78
    err = capsys.readouterr().err
    assert f"--socket {one.path}, --socket {two.path}" in err and len(err.splitlines()) == 1
    assert not any(line for robot in (one, two) for line in robot.heard)
    assert main(("release", "--socket", str(two.path))) == 0
    assert two.heard == [{"do": "release", "who": two.heard[0]["who"]}]


def test_a_release_does_not_ask_which_if_only_one_lives(add: Add, folder: Path, capsys: Capture) -> None:
    leave(folder, "bioloid-1")
    add("nxt-2")
    assert main(("release",)) == 0
    assert capsys.readouterr() == ("nxt-2: released\n", "")


# ---------------------------------------------------------------- quickly


@pytest.mark.parametrize("words", [("--who", "me"), ("--who=me",), ("--socket", "PATH", "--who", "a \"b\" \\ \n c")])
def test_a_plain_stop_needs_no_parser_and_nothing_slow(add: Add, words: tuple[str, ...]) -> None:
    robot = add()
    words = tuple(str(robot.path) if word == "PATH" else word for word in words)
    program = (
        "import sys; from urbihw.cli.entry import urbihw; code = urbihw(); "
        "print(code, [name for name in ('argparse', 'typing', 'pathlib') if name in sys.modules])"
    )
    # Without the paths of installed packages: the finder of an editable installation imports pathlib.
    done = subprocess.run(
        (sys.executable, "-S", "-c", program, "estop", *words), capture_output=True, text=True, check=True,
        cwd=Path(control.__file__).parents[2], env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )  # fmt: skip
    assert done.stdout == "bioloid-54000: emergency stop, held until: urbihw release\n0 []\n"
    assert robot.heard == [{"do": "estop", "who": "me" if "b" not in words[-1] else 'a "b" \\   c'}]


@pytest.mark.parametrize("words", [("--help",), ("--key", "x"), ("--soc", "x"), ("--who",), ("PATH",)])
def test_what_is_not_plain_goes_to_the_parser(words: tuple[str, ...]) -> None:
    assert control.run_at_once(("estop", *words)) is None


WATCHED = ("urbihw.kernel", "urbihw.buses", "asyncio", "tempfile", "urbihw.cli.serve", "urbihw.cli.console", "inspect")


def test_a_stop_imports_little(folder: Path) -> None:
    program = (
        "import sys; from urbihw.cli.main import main; code = main(['estop']); "
        f"print(code, [name for name in {WATCHED!r} if name in sys.modules])"
    )
    done = subprocess.run((sys.executable, "-c", program), capture_output=True, text=True, check=True)
    assert done.stdout == "69 []\n"


@pytest.mark.parametrize("verb", ["stop", "estop", "release", "serve", "doctor"])
def test_each_has_its_own_help(capsys: Capture, verb: str) -> None:
    with pytest.raises(SystemExit) as caught:
        main((verb, "--help"))
    assert caught.value.code == 0
    assert f"usage: urbihw {verb}" in capsys.readouterr().out


# ---------------------------------------------------------------- without a daemon


@pytest.mark.parametrize("option", [("--config", "x"), ("--platform", "bioloid"), ("--url", "/dev/x")])
def test_what_is_for_direct_wants_it(folder: Path, capsys: Capture, option: tuple[str, str]) -> None:
    assert main(("stop", *option)) == 78
    assert "--direct" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), "which robot?"),
        (("--platform", "roomba"), "there are: bioloid"),
        (("--config", "/nowhere.toml"), "cannot be read"),
        (("--platform", "bioloid", "--url", "pigeon://x"), "unknown kind"),
        (("--platform", "bioloid", "--url", "/dev/ttyNONE"), "no such port"),
    ],
)
def test_direct_says_in_one_line_what_is_wrong_with_the_set_up(
    folder: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], words: str
) -> None:
    monkeypatch.setattr(direct, "PORT_TIMEOUT_S", 0.2)
    assert main(("stop", "--direct", *arguments)) == 78
    out, err = capsys.readouterr()
    assert out == "" and words in err and len(err.splitlines()) == 1


def test_direct_asks_the_daemon_first(add: Add, tmp_path: Path, capsys: Capture) -> None:
    robot, service = add("bioloid-7777"), add("nxt-54000", where=tmp_path / "service")
    file = tmp_path / "urbihw.toml"
    file.write_text('platform = "bioloid"\nurl = "/dev/ttyNONE"\nport = 7777\n')
    assert main(("stop", "--direct", "--config", str(file))) == 0
    assert main(("stop", "--direct", "--platform", "nxt", "--url", "/dev/ttyNONE")) == 0
    assert capsys.readouterr().out == "bioloid-7777: stopped\nnxt-54000: stopped\n"
    assert len(robot.heard) == len(service.heard) == 1


def test_direct_knows_where_the_socket_of_a_robot_is(folder: Path, tmp_path: Path) -> None:
    assert direct.sockets(Config(platform="nxt", control="/x/y.sock")) == [Path("/x/y.sock")]
    assert direct.sockets(Config(platform="nxt", control="off")) == []
    assert direct.sockets(Config(platform="nxt", port=1)) == [
        folder / "nxt-1.sock", tmp_path / "service" / "nxt-1.sock"
    ]


def test_a_mistake_that_does_not_matter_here_keeps_nobody_from_stopping(
    folder: Path, add: Add, tmp_path: Path, capsys: Capture
) -> None:
    file = tmp_path / "urbihw.toml"
    file.write_text('platform = "bioloid"\nfake = true\nrat = 1\n[limits]\nsped = 1\n')
    assert main(("stop", "--direct", "--config", str(file))) == 0
    assert "ends with its daemon" in capsys.readouterr().out
    file.write_text('platform = "bioloid"\nfake = true\n[options]\noffset = 3\n')
    assert main(("stop", "--direct", "--config", str(file))) == 78
    assert "options.offset: no such option" in capsys.readouterr().err
    # A daemon that runs is asked all the same: it began with other settings.
    add("bioloid-54000")
    assert main(("stop", "--direct", "--config", str(file))) == 0


def test_a_robot_in_software_needs_no_stop(folder: Path, tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "urbihw.toml"
    file.write_text('platform = "bioloid"\nfake = true\n')
    assert main(("stop", "--direct", "--config", str(file))) == 0
    assert "ends with its daemon" in capsys.readouterr().out
