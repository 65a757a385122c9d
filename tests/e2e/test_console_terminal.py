"""``urbihw console`` at a terminal and in a pipe, with a real server."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from programs_lab import TIMEOUT_S, Server, Terminal, run

pytestmark = pytest.mark.e2e


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """One for all who leave it alive."""
    made = Server(tmp_path_factory.mktemp("server"))
    yield made
    made.close()


@pytest.fixture
def console(tmp_path: Path, server: Server) -> Iterator[Callable[..., Terminal]]:
    made: list[Terminal] = []

    def start(port: int = server.port) -> Terminal:
        made.append(Terminal("main", "console", f":{port}", cwd=tmp_path, XDG_STATE_HOME=str(tmp_path)))
        made[-1].wait("Ctrl-D leaves")
        return made[-1]

    yield start
    for one in made:
        one.close()


def test_a_conversation(console: Callable[..., Terminal]) -> None:
    talk = console()
    talk.type("1 + 1;\r")
    talk.wait(r"\[\d{8}\] 2\n")
    talk.type("foo;\r")
    talk.wait(r"\[\d{8}:error\] !!! 2\.1-3: lookup failed: foo\n")
    talk.type('Channel.new("mine") << "hello";\r')
    talk.wait(r'\[\d{8}:mine\] "hello"\n')
    talk.type("\x04")
    assert talk.ended() == 0


def test_quit_leaves(console: Callable[..., Terminal]) -> None:
    talk = console()
    talk.type("quit;\r")
    assert talk.ended() == 0
    assert "reconnecting" not in talk.listen(0)


def test_a_statement_of_several_lines(console: Callable[..., Terminal]) -> None:
    talk = console()
    talk.type("{\r")
    talk.wait("unfinished")
    talk.type('echo("on" + "ce");\r')
    assert "once" not in talk.listen(0.5).replace('"on" + "ce"', "")
    talk.type("};\r")
    talk.wait(r"\*\*\* once\n")
    talk.type("40 + 2\r\r")
    talk.wait(r"\[\d{8}\] 42\n")
    talk.type("\x1b[A")
    # The whole of it is one entry of the history.
    talk.type("\x1b[A")
    talk.wait(r'echo\("on" \+ "ce"\);')
    talk.type("\r")
    talk.wait(r"\*\*\* once\n")


def test_names_are_completed_while_something_runs(console: Callable[..., Terminal]) -> None:
    talk = console()
    talk.type("class Thing { var velocityOfLight = 3 } | var thing = Thing.new | sleep(1h);\r")
    talk.listen(0.5)
    talk.type("thing.velo\t")
    talk.wait("cityOfLight")
    talk.type("\x03")
    talk.listen(0.2)
    talk.type("\x03")
    talk.wait("killing foreground job")
    talk.type("thing.velo\t")
    talk.wait("cityOfLight")
    talk.type(";\r")
    talk.wait(r"\[\d{8}\] 3\n")


def test_help_from_docstrings(console: Callable[..., Terminal]) -> None:
    talk = console()
    talk.type("help sleep\r")
    talk.wait(r"sleep: Primitive\n +Sleep for a duration in seconds")
    talk.type("help nobody\r")
    talk.wait("no help for nobody: lookup failed: nobody")
    talk.type("String.split?\r")
    talk.wait(r"String\.split: Primitive\n")
    talk.type("sleep(")
    # Of a line that changes only the letters that differ are drawn anew.
    talk.wait(r"inf\): Sleep ?for ?a ?duration")
    talk.type("\x03help\r")
    talk.wait("Tab +complete the name of a slot")
    # Nothing of this was the user's own doing.
    talk.type("foo;\r")
    talk.wait(r"!!! 1\.1-3: lookup failed: foo")


def test_what_others_say_appears_above_the_prompt(console: Callable[..., Terminal], server: Server) -> None:
    talk = console()
    talk.type("half a")
    talk.listen(0.3)
    assert run("send", "-P", str(server.port), "-Q", "-e", 'wall("hear " + "hear");')[0] == 0
    talk.wait(r"\*\*\* hear hear\n")
    talk.wait("half a")


def test_a_server_that_goes_and_comes_back(console: Callable[..., Terminal], tmp_path: Path) -> None:
    with contextlib.closing(Server(tmp_path)) as mortal:
        talk = console(mortal.port)
        mortal.process.terminate()
        assert mortal.process.wait(TIMEOUT_S) == 0
    talk.wait("the server closed the connection; trying again")
    talk.wait(r"\(reconnecting\)>")
    talk.type("40 + 2;\r")
    talk.listen(0.3)
    with contextlib.closing(Server(tmp_path, port=mortal.port)):
        talk.wait("connected again")
        talk.type("\r")
        talk.wait(r"\[\d{8}\] 42\n")


def test_what_was_typed_is_remembered(console: Callable[..., Terminal], tmp_path: Path) -> None:
    first = console()
    first.type('echo("remem" + "bered");\r')
    first.wait(r"\*\*\* remembered")
    first.type("\x04")
    assert first.ended() == 0
    second = console()
    second.type("\x1b[A\r")
    second.wait(r"\*\*\* remembered")


def test_a_terminal_is_left_as_it_was(console: Callable[..., Terminal]) -> None:
    talk = console()
    before = talk.settings()
    talk.process.terminate()
    assert talk.ended() == 0
    assert talk.settings() != before
    assert talk.settings() == talk.at_first


def test_no_server_to_begin_with() -> None:
    talk = Terminal("main", "console", ":2")
    try:
        assert talk.ended() == 1
        assert re.fullmatch(r"urbihw console: cannot connect to 127\.0\.0\.1:2: Connection refused; .*\n", talk.heard)
    finally:
        talk.close()


@pytest.mark.long
def test_in_a_pipe(server: Server) -> None:
    code, out, err = run("main", "console", f":{server.port}", stdin="var x = 2;\nx * 21;\nsleep(200ms); echo(x)")
    assert (code, err) == (0, "")
    assert [line.partition("] ")[2] for line in out.splitlines()] == ["2", "42", "*** 2"]
    assert run("main", "console", f":{server.port}", stdin="foo;")[0] == 70
    assert run("main", "console", ":2", stdin="1;")[0] == 1
