"""The programs as real processes on real ports, as the manual shows them (chapters 2 and 18)."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from programs_lab import TIMEOUT_S, Server, Terminal, module, run

pytestmark = pytest.mark.e2e

FACTORY = """
from urbihw.kernel.uobject import UObject, function, variable

class UFactory(UObject):
    duration = variable(0.0)

    def init(self, duration: float) -> None:
        self.duration.value = duration

    @function
    def assemble(self, parts: list) -> str:
        return "".join(parts)
"""


def unstamped(text: str) -> list[str]:
    return [re.sub(r"^\[\d{8,}(:?\w*)\] ", r"[\1] ", line).removeprefix("[] ") for line in text.splitlines()]


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Callable[..., Server]]:
    made: list[Server] = []

    def start(*arguments: str, port: int = 0, **environment: str) -> Server:
        made.append(Server(tmp_path, *arguments, port=port, **environment))
        return made[-1]

    yield start
    for one in made:
        one.close()


@pytest.fixture
def terminal(tmp_path: Path) -> Iterator[Callable[..., Terminal]]:
    made: list[Terminal] = []

    def start(name: str, *arguments: str) -> Terminal:
        made.append(Terminal(name, *arguments, cwd=tmp_path))
        return made[-1]

    yield start
    for one in made:
        one.close()


# ---------------------------------------------------------------- the documents

DOCS = Path(__file__).resolve().parents[2] / "docs"
PAGES = (DOCS / "programs.md", DOCS / "console.md")
NAMES = {"urbi": "urbi", "urbi-launch": "launch", "urbi-send": "send", "urbihw": "main"}


def sessions(page: Path) -> list[list[tuple[str, list[str]]]]:
    """The sessions at a shell in a page: commands, and what they answered."""
    found = []
    for block in re.findall(r"(?:^    .*\n|^\n(?=    ))+", page.read_text(), re.MULTILINE):
        steps: list[tuple[str, list[str]]] = []
        for line in block.replace("\n    ", "\n").strip().splitlines():
            if line.startswith("$ "):
                steps.append((line[2:], []))
            elif steps and line.startswith("> "):
                steps[-1] = (f"{steps[-1][0]}\n{line[2:]}", [])
            elif steps:
                steps[-1][1].append(line)
        if steps:
            found.append(steps)
    return found


def neutral(text: str) -> str:
    return re.sub(r"0x[0-9a-f]+", "0x0", re.sub(r"^\[\d{8,}", "[00000000", text))


SESSIONS = [pytest.param(steps, id=f"{page.stem}: {steps[0][0][:30]}") for page in PAGES for steps in sessions(page)]


@pytest.mark.parametrize("steps", SESSIONS)
def test_the_sessions_of_the_documents(tmp_path: Path, steps: list[tuple[str, list[str]]]) -> None:
    script = "".join(f'{name}() {{ {" ".join(module(of))} "$@"; }}\n' for name, of in NAMES.items())
    script += "".join(f"{command}\necho '@@'\n" for command, _ in steps)
    with (tmp_path / "said").open("w+") as said:
        shell = subprocess.Popen(["bash", "-c", script], cwd=tmp_path, stdout=said, stderr=said, start_new_session=True)
        try:
            assert shell.wait(TIMEOUT_S) == 0
        finally:
            with contextlib.suppress(ProcessLookupError):
                # A server that the session left in the background.
                os.killpg(shell.pid, signal.SIGKILL)
        said.seek(0)
        parts = said.read().split("@@\n")
    said_lines = [[neutral(line) for line in part.splitlines() if line] for part in parts]
    assert said_lines == [*([neutral(line) for line in answer if line] for _, answer in steps), []]


def test_there_are_sessions_in_the_documents() -> None:
    assert {page for page in PAGES if sessions(page)} == set(PAGES)
    assert len(SESSIONS) >= 6


# ---------------------------------------------------------------- urbi: what to run


def test_the_batch_session_of_the_manual() -> None:
    code, out, err = run("urbi", "-q", "-e", 'echo("Hello, World!");', "-e", "shutdown;")
    assert (code, unstamped(out), err) == (0, ["*** Hello, World!"], "")


def test_the_sources_of_the_manual_run_in_one_lobby(tmp_path: Path) -> None:
    (tmp_path / "two.u").write_text("var two = 2;\n")
    code, out, _ = run("urbi", "-q", "-e", "var one = 1;", "-f", "two.u", "-i", stdin="one + two;\n", cwd=tmp_path)
    assert (code, unstamped(out)) == (0, ["1", "2", "3"])


def test_a_script_on_standard_input() -> None:
    code, out, _ = run("urbi", "-q", "-f", "-", stdin="echo(1);\nshutdown;")
    assert (code, unstamped(out)) == (0, ["*** 1"])


def test_errors_of_a_user_do_not() -> None:
    assert run("urbi", "-q", "-i", stdin="foo;\n1+;\n")[0] == 0


def test_nobody_reads_what_it_says() -> None:
    program = subprocess.Popen(module("urbi", "-q", "-e", "every (1ms) echo(1);"), stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE)
    assert program.stdout is not None and program.stderr is not None
    with program.stdout, program.stderr:
        program.stdout.readline()
        program.stdout.close()
        assert program.wait(TIMEOUT_S) == 0
        assert program.stderr.read() == b""


# ---------------------------------------------------------------- urbi: start-up files


def test_global_and_local_files(tmp_path: Path, server: Callable[..., Server]) -> None:
    other = tmp_path / "other"
    other.mkdir()
    (other / "global.u").write_text("var Global.shared = 1; var hidden = 2; 5;")
    (tmp_path / "local.u").write_text('var mine = "m"; echo("welcome");')
    started = server(URBI_PATH=f"{other}:")
    ask = ("--port-file", started.port_file, "-b", "-Q")
    _, out, err = run("send", *ask, "-e", "shared; mine; hidden;")
    assert unstamped(out) == [f"[:clog] *** loading {tmp_path}/local.u.", "*** welcome", "1", '"m"']
    assert unstamped(err)[0] == "[:error] !!! 1.15-20: lookup failed: hidden"
    _, out, _ = run("send", *ask, "-e", "mine = 3;", "-e", "1;")
    assert unstamped(run("send", *ask, "-e", "mine;")[1])[-1] == '"m"'
    assert unstamped(started.log()) == [
        f"[:clog] *** loading {other}/global.u.", f"[:clog] *** loading {tmp_path}/local.u.", "*** welcome",
    ]


# ---------------------------------------------------------------- urbi: quitting


def test_ctrl_c_kills_the_foreground_and_then_the_server(terminal: Callable[..., Terminal]) -> None:
    urbi = terminal("urbi", "-i", "-q")
    urbi.type('every (100ms) echo("Hello " + "world!");\n')
    urbi.wait(r"\*\*\* Hello world!")
    urbi.type('echo("ne" + "ver");\n')
    urbi.listen(1.0)
    urbi.interrupt()
    urbi.wait(r"\[\d{8}:error\] !!! received interruption, killing foreground job\.\n")
    urbi.type('echo("inter" + "rupted");\n')
    assert "never" not in urbi.wait(r"\*\*\* interrupted")
    time.sleep(1.6)
    urbi.type("sleep;\n")
    urbi.listen(0.3)
    urbi.interrupt()
    urbi.wait("killing foreground job")
    urbi.interrupt()
    urbi.wait("received interruption, shutting down")
    assert urbi.ended() == 0


def test_ctrl_c_reaches_a_loop_that_never_gives_way(terminal: Callable[..., Terminal]) -> None:
    urbi = terminal("urbi", "-i", "-q")
    urbi.type('echo("rea" + "dy");\n')
    urbi.wait("ready")
    urbi.type("loop| {};\n")
    urbi.listen(0.5)
    urbi.interrupt()
    urbi.wait("killing foreground job")
    urbi.type("1 + 1;\n")
    urbi.wait(r"\] 2\n")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_without_a_user_one_signal_ends_it(server: Callable[..., Server], number: signal.Signals) -> None:
    # What is said is shown when the round is over, which a loop that never gives way would prevent.
    started = server("-e", 'echo("busy"); sleep(0.2s); loop| {};')
    end = time.monotonic() + TIMEOUT_S
    while "busy" not in started.log():
        assert time.monotonic() < end, started.log()
        time.sleep(0.01)
    started.process.send_signal(number)
    assert started.process.wait(TIMEOUT_S) == 0


def test_after_quit_the_server_goes_on_without_its_console(terminal: Callable[..., Terminal], tmp_path: Path) -> None:
    urbi = terminal("urbi", "-i", "-q", "-P", "0", "-w", "port")
    urbi.type('echo("he" + "re"); quit;\n')
    urbi.wait("here")
    code, out, _ = run("send", "--port-file", str(tmp_path / "port"), "-Q", "-e", "1 + 1;")
    assert (code, unstamped(out)) == (0, ["2"])
    urbi.interrupt()
    assert urbi.ended() == 0


def test_ctrl_d_ends_the_session(terminal: Callable[..., Terminal]) -> None:
    urbi = terminal("urbi", "-i", "-q")
    urbi.type('echo("he" + "re"); sleep;\n')
    urbi.wait("here")
    urbi.type("\x04")
    assert urbi.ended() == 0


# ---------------------------------------------------------------- the others


def test_send_the_session_of_the_manual(server: Callable[..., Server]) -> None:
    started = server()
    code, out, err = run("send", "-P", str(started.port), "-e", "1+2*3;", "-Q")
    assert (code, unstamped(out), err) == (0, ["7"], "[00000000:client_error] End of file\n")
    assert run("send", "-P", str(started.port), "-e", "shutdown;")[0] == 0
    assert started.process.wait(TIMEOUT_S) == 0
    code, _, err = run("send", "-P", str(started.port), "-e", "1;")
    assert code == 1
    assert re.fullmatch(r"urbi-send: cannot connect to 127.0.0.1:\d+: Connection refused; .*\n", err)


def test_ping_image_and_sound(server: Callable[..., Server], tmp_path: Path) -> None:
    started = server("-e", """
        class Global.Camera { var val = Binary.new("jpeg 1 2", "data") };
        var Global.camera = Camera.new;
        class Global.Micro { var val = Binary.new("", "") };
        var Global.micro = Micro.new;
        every (20ms) { micro.val = Binary.new("raw 1 1000 8 2", "a" * 20) },
    """)
    where = ("--port-file", started.port_file)
    assert "3 asked, 3 answered" in run("ping", *where, "-c", "3", "-i", "5")[1]
    assert run("image", *where, "-o", "a.jpg", cwd=tmp_path)[1] == "a.jpg: jpeg, 1 x 2, 4 bytes\n"
    assert (tmp_path / "a.jpg").read_bytes() == b"data"
    assert run("sound", *where, "-t", "0.1", "-o", "a.wav", cwd=tmp_path)[0] == 0
    assert (tmp_path / "a.wav").read_bytes().endswith(b"a" * 100)


def test_launch_start_as_in_the_manual(tmp_path: Path) -> None:
    (tmp_path / "factory.py").write_text(FACTORY)
    text = 'var f = uobjects.UFactory.new(1s)|; f.assemble(["Hello, ", "World!"]);'
    code, out, _ = run("launch", "--start", "factory", "--", "-q", "-i", stdin=text, cwd=tmp_path)
    assert (code, unstamped(out)) == (0, ['"Hello, World!"'])
    code, _, err = run("launch", "--start", "factories", "--", "-q", cwd=tmp_path)
    assert code == 78
    assert re.fullmatch("urbi-launch: .*factories.*URBI_UOBJECT_PATH.*\n", err)


def test_launch_plugin(server: Callable[..., Server], tmp_path: Path) -> None:
    (tmp_path / "factory.py").write_text(FACTORY)
    started = server(URBI_UOBJECT_PATH=str(tmp_path))
    where = ("--port-file", started.port_file)
    assert run("launch", "--plugin", *where, "factory") == (0, "", "")
    _, out, _ = run("send", *where, "-Q", "-e", 'uobjects.UFactory.new(1s).assemble(["12", "34"]);')
    assert unstamped(out) == ['"1234"']
    code, _, err = run("launch", "--plugin", *where, "factories")
    assert code == 69
    assert "factories" in err and len(err.splitlines()) == 1


def test_launch_remote(server: Callable[..., Server], tmp_path: Path) -> None:
    (tmp_path / "factory.py").write_text(FACTORY)
    started = server()
    remote = subprocess.Popen(module("launch", "--remote", "--port-file", started.port_file, "factory"), cwd=tmp_path,
                              stderr=subprocess.PIPE)
    try:
        text = ('timeout (10s) waituntil (uobjects.hasSlot("UFactory")) |'
                'uobjects.UFactory.new(1s).assemble(["12", "34"]);')
        _, out, err = run("send", "--port-file", started.port_file, "-Q", "-e", text)
        assert unstamped(out) == ['"1234"'], err
        remote.send_signal(signal.SIGINT)
        assert remote.wait(TIMEOUT_S) == 0
    finally:
        remote.kill()
        _, said = remote.communicate()
    assert said == b""


@pytest.mark.parametrize(("name", "code", "words"), [("factory", 1, "cannot reach"), ("factories", 66, "factories")])
def test_launch_remote_says_what_is_wrong(tmp_path: Path, name: str, code: int, words: str) -> None:
    (tmp_path / "factory.py").write_text(FACTORY)
    got, _, err = run("launch", "--remote", "--port", "2", name, cwd=tmp_path)
    assert got == code
    assert words in err and len(err.splitlines()) == 1
