"""``urbihw teach`` and ``urbihw play`` against a server whose robot only notes what it is told."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from kernel_socket import serve

from urbihw.cli import main as urbihw
from urbihw.cli import teach
from urbihw.exitcodes import EX_CONFIG, EX_OK, EX_RUNTIME, EX_UNAVAILABLE, INTERRUPTED

ROBOT = """
var Global.told = []|;
class Global.robot
{
  var motionPlayer = nil;
  var ending = Event.new;
  var teaching = nil;
  function motions() { ["bow.mtn", "wave"] };
  function poses() { ["home"] };
  var how = "finished";
  function run(where, kind, what, speed, times)
  {
    told << [kind, what, speed, times] |
    if (what == "far") throw Exception.new("too far");
    if (what == ["slack"])
      lobby.send("!!! warning: motor 1 is off: switch it on with load = 1", "error");
    sleep(5s);
    if (what == ["taken"] || what == "taken")
      how = "aborted"
    else
      how = "finished";
    this
  };
  function teach(name, joints, rate)
  {
    told << ["teach", name, joints, rate];
    if (name == "bad") throw Exception.new("a bad name");
    if (name == "quoted") throw Exception.new("\\"joint[99]\\" is no joint");
    teaching = [name, [["joint[1]", 0.5]]];
    waituntil (ending?);
    teaching = nil
  };
  function keyPose() { told << ["keyPose"] | void };
  function endTeaching() { ending! };
}|;
robot.motionPlayer = robot|;
"""


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch) -> Any:
    return serve(monkeypatch, ROBOT)


def told(server: Any) -> str:
    """What the robot was told."""
    lobby = server.kernel.open_lobby()
    server.kernel.feed(lobby, b"told;")
    server.kernel.run()
    return str(lobby.output.take_bytes().decode().strip().partition("] [")[2])


@pytest.fixture
def type_keys(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[bytes], None]]:
    """Make standard input a pipe with some keys, and then its end."""
    with contextlib.ExitStack() as opened:

        def type_them(keys: bytes) -> None:
            reading, writing = os.pipe()
            os.write(writing, keys)
            os.close(writing)
            monkeypatch.setattr("sys.stdin", opened.enter_context(os.fdopen(reading)))

        yield type_them


def test_play_waits_for_the_end(server: Any) -> None:
    before = server.kernel.clock.now()
    assert urbihw.main(["play", "wave", "bow.mtn:March on", "--speed", "0.5", "--loop", "3"]) == EX_OK
    assert told(server) == '["motion", ["wave", "bow.mtn:March on"], 0.5, 3]]'
    assert server.kernel.clock.now() - before >= 5


def test_play_for_ever(server: Any) -> None:
    assert urbihw.main(["play", "wave", "--loop", "0"]) == EX_OK
    assert told(server) == '["motion", ["wave"], 1, inf]]'


def test_a_name_is_a_string_whatever_is_in_it(server: Any) -> None:
    assert urbihw.main(["play", 'a"); shutdown; ("\\', "--pose"]) == EX_OK
    assert told(server) == '["pose", "a\\"); shutdown; (\\"\\\\", 1, 1]]'


def test_poses_one_after_the_other_and_the_error_of_one(server: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert urbihw.main(["play", "--pose", "home", "far", "home"]) == EX_UNAVAILABLE
    assert told(server) == '["pose", "home", 1, 1], ["pose", "far", 1, 1]]'
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("urbihw play: ") and line.endswith("too far")


@pytest.mark.parametrize("words", [["taken"], ["--pose", "taken", "home"]])
def test_a_motion_that_others_end_is_no_success(
    server: Any, capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    assert urbihw.main(["play", *words]) == EX_UNAVAILABLE
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("was ended by others: by a stop, or by a write to its joints")
    assert '"home"' not in told(server)


def test_without_a_name_the_motions_are_listed(server: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert urbihw.main(["play"]) == EX_OK
    assert capsys.readouterr().out == "motions: bow.mtn wave; poses: home\n"


def test_a_server_without_joints(
    monkeypatch: pytest.MonkeyPatch, type_keys: Callable[[bytes], None], capsys: pytest.CaptureFixture[str]
) -> None:
    serve(monkeypatch)
    assert urbihw.main(["play", "wave"]) == EX_UNAVAILABLE
    type_keys(b"q")
    assert urbihw.main(["teach", "wave"]) == EX_UNAVAILABLE
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2 and all(line.endswith("has no robot with joints") for line in told)


def test_a_lesson_ends_with_q(
    server: Any, type_keys: Callable[[bytes], None], capsys: pytest.CaptureFixture[str]
) -> None:
    type_keys(b"\nq")
    assert urbihw.main(["teach", "wave", "--joints", "joint[1], joint[2]", "--rate", "50"]) == EX_OK
    assert told(server) == '["teach", "wave", ["joint[1]", "joint[2]"], 50]]'
    assert capsys.readouterr().out.splitlines() == [
        "Move the joints by hand.  q: end", "wave is kept: urbihw play wave",
    ]  # fmt: skip


def test_enter_takes_a_key_pose(server: Any, type_keys: Callable[[bytes], None]) -> None:
    type_keys(b"\n\nxq")
    assert urbihw.main(["teach", "steps", "--key-poses"]) == EX_OK
    assert told(server) == '["teach", "steps", [], 0], ["keyPose"], ["keyPose"]]'


def test_the_joints_are_shown_in_a_terminal(
    server: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    keys = iter([[], ["end"]])
    monkeypatch.setattr(teach, "_keys", lambda seconds: next(keys))
    assert urbihw.main(["teach", "wave"]) == EX_OK
    assert "  joint[1]               +0.500 rad\n" in capsys.readouterr().out


def test_a_lesson_that_cannot_begin(
    server: Any, type_keys: Callable[[bytes], None], capsys: pytest.CaptureFixture[str]
) -> None:
    type_keys(b"")
    assert urbihw.main(["teach", "bad"]) == EX_RUNTIME
    assert capsys.readouterr().err == "urbihw teach: a bad name\n"


def test_an_interrupted_lesson_tells_how_it_leaves_the_robot(
    server: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(seconds: float) -> list[str]:
        raise KeyboardInterrupt

    monkeypatch.setattr(teach, "_keys", interrupt)
    assert urbihw.main(["teach", "wave"]) == INTERRUPTED
    assert capsys.readouterr().err == "interrupted: wave is kept as far as it was recorded; the joints stay off\n"


def test_an_error_of_the_server_is_shown_as_it_is(
    server: Any, type_keys: Callable[[bytes], None], capsys: pytest.CaptureFixture[str]
) -> None:
    type_keys(b"")
    assert urbihw.main(["teach", "quoted"]) == EX_RUNTIME
    assert capsys.readouterr() == ("", 'urbihw teach: "joint[99]" is no joint\n')


def test_play_shows_the_warnings_of_the_server(server: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert urbihw.main(["play", "slack"]) == EX_OK
    assert capsys.readouterr().err == "urbihw play: warning: motor 1 is off: switch it on with load = 1\n"


@pytest.mark.parametrize("name", ["../../evil", "", "a b", "x" * 65])
def test_a_name_that_no_motion_can_have_is_refused_as_a_wrong_option(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        urbihw.main(["teach", name])
    assert ended.value.code == EX_CONFIG
    assert "the name of a motion has 1 to 64 letters, digits, _ or -" in capsys.readouterr().err
