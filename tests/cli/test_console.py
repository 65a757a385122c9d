"""The console's parts, with a kernel in memory where they talk to a server.  The whole of it: tests/e2e."""

from __future__ import annotations

import argparse
import asyncio
import io
import os
import re
from collections.abc import Callable, Coroutine, Sequence
from pathlib import Path
from typing import Any, TypeVar

import pytest
from kernel_socket import HERE, NOBODY, KernelSocket, serve
from pygments.token import Comment, Error, Keyword, Name, Number, String  # type: ignore[import-untyped]

from urbihw.cli.console import address, plain
from urbihw.cli.console.colours import painted
from urbihw.cli.console.completion import candidates
from urbihw.cli.console.help import described, keys_text
from urbihw.cli.console.lexer import UrbiscriptLexer
from urbihw.cli.console.screen import asked_help, depth, ends_session, history, lacks_separator
from urbihw.cli.console.session import ConsoleSession
from urbihw.cli.main import main
from urbihw.cli.options import CliRefused
from urbihw.client.assistant import Assistant, Description, KnownName, NoAnswer, strings, written
from urbihw.client.credentials import Credentials
from urbihw.client.lines import Line, Lines
from urbihw.client.subject import Subject, open_call, subject, whole_path
from urbihw.client.where import Where

T = TypeVar("T")

# ---------------------------------------------------------------- options


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("robot", ("robot", 54000)),
        ("robot:1", ("robot", 1)),
        (":2", (None, 2)),
        ("54001", (None, 54001)),
        ("/run/x", ("/run/x", 54000)),
        ("[::1]:3", ("::1", 3)),
        ("[::1]", ("::1", 54000)),
    ],
)
def test_addresses(text: str, meant: tuple[str | None, int]) -> None:
    assert address(text) == meant


@pytest.mark.parametrize("text", ["robot:x", "robot:0", "robot:70000", "::1"])
def test_what_is_no_address(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="give HOST:PORT"):
        address(text)
    with pytest.raises(SystemExit) as caught:
        main(["console", text])
    assert caught.value.code == 78
    assert len(capsys.readouterr().err.splitlines()) == 1


# ---------------------------------------------------------------- in a pipe


def piped(monkeypatch: pytest.MonkeyPatch, text: bytes, **options: Any) -> int:
    """What the console does with an input that is no terminal."""
    serve(monkeypatch, **options)
    reading, writing = os.pipe()
    os.write(writing, text)
    os.close(writing)
    with open(reading, "rb") as source:
        return plain.run_session(HERE, NOBODY, source)


@pytest.mark.parametrize("text", [b"1 + 1; echo(3);\n", b"1 + 1; echo(3)"])
def test_a_pipe_is_answered_to_its_end(
    monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes], text: bytes
) -> None:
    assert piped(monkeypatch, text, quiet=False) == 0
    assert re.sub(rb"\d{8}", b"", capsysbinary.readouterr().out) == b"[] 2\n[] *** 3\n"


@pytest.mark.parametrize(("text", "code"), [(b"1; 2 3; foo;", 65), (b"foo; 1+;", 70), (b'cerr << "x";', 0)])
def test_the_first_error_decides_about_the_exit_code(monkeypatch: pytest.MonkeyPatch, text: bytes, code: int) -> None:
    assert piped(monkeypatch, text) == code


def test_an_input_that_ends_within_a_statement(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CliRefused, match="ends within a statement") as caught:
        piped(monkeypatch, b"1; { 2; ")
    assert caught.value.code == 65


@pytest.mark.parametrize("last", [b"quit;", b"shutdown;"])
def test_who_ends_the_connection_is_content(monkeypatch: pytest.MonkeyPatch, last: bytes) -> None:
    assert piped(monkeypatch, b"1;" + last) == 0


def test_a_pipe_needs_no_extra(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    serve(monkeypatch)
    with open(os.devnull, "rb") as nothing:
        monkeypatch.setattr("sys.stdin", io.TextIOWrapper(nothing))
        monkeypatch.setitem(__import__("sys").modules, "prompt_toolkit", None)
        assert main(["console", "localhost:1"]) == 0


# ---------------------------------------------------------------- what stands before the cursor


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("", Subject((), "")),
        ("mot", Subject((), "mot")),
        ("x = mot", Subject((), "mot")),
        ("robot.arm.gr", Subject(("robot", "arm"), "gr")),
        ("echo(robot.", Subject(("robot",), "")),
        ("motors[6].va", Subject(("motors", (6.0,)), "va")),
        ('legs["left"].\n  kn', Subject(("legs", ("left",)), "kn")),
        ("lobby.conn", Subject((), "conn")),
        ("1 + x", Subject((), "x")),
        ('"abc".len', Subject(("String",), "len")),
        ('"a // b"; mo', Subject((), "mo")),
        ("// a\nmo", Subject((), "mo")),
    ],
)
def test_subjects(text: str, meant: Subject) -> None:
    assert subject(text) == meant


@pytest.mark.parametrize("text", ["f(1).na", "3.", "12ab", 'x = "mot', "// mot", "/* mot", "x->ra", "[1].si"])
def test_where_no_name_can_be_known(text: str) -> None:
    assert subject(text) is None


def test_paths_and_commands() -> None:
    assert whole_path(" motors[6].val ;") == ("motors", (6.0,), "val")
    assert whole_path("lobby") == ("lobby",)
    assert whole_path("f(1)") is None
    texts = ("help", "help x.y;", " motors[6].val? ", "x ?", "?", "help = 3;", "helper;", "help(1);", "e?(1)", "x?;")
    assert [asked_help(text) for text in texts] == ["", "x.y", "motors[6].val", "x", "", None, None, None, None, None]


@pytest.mark.parametrize(
    ("text", "meant"),
    [
        ("motor6.readRegister(", (("motor6",), "readRegister")),
        ("x = sleep(1s", ((), "sleep")),
        ('robot.say("a (b", ', (("robot",), "say")),
        ('echo("unfinished', ((), "echo")),
        ("a.b(c(1), [2, (3)], ", (("a",), "b")),
        ("a.b(c(1", ((), "c")),
        ("motors[6].f(", (("motors", (6.0,)), "f")),
        ("a.b(1)", None),
        ("a.b(1); ", None),
        ("f(1).g(", None),
        ("(1 + ", None),
        ("f({ 1; ", None),
        ('"f("', None),
    ],
)
def test_the_function_whose_arguments_are_typed(text: str, meant: object) -> None:
    assert open_call(text) == meant


def offered(wanted: Subject, names: Sequence[KnownName], first: bool = False) -> list[str]:
    """The names that the console offers, in their order."""
    return [each.name for each in candidates(wanted, names, first=first)]


def test_candidates_are_names_that_can_be_typed() -> None:
    names = [KnownName(name, "0", "") for name in ("val", "+", "_hidden", "value", "Velocity", "load")]
    assert offered(Subject(("motor",), "v"), names) == ["val", "value"]
    assert offered(Subject(("motor",), "_"), names) == ["_hidden"]
    assert offered(Subject((), "wh"), names) == ["whenever", "while"]
    assert "help" in offered(Subject((), "he"), [], first=True)
    assert "help" not in offered(Subject((), "he"), [])


def test_candidates_that_users_look_for_come_first_and_numbers_count() -> None:
    names = [KnownName("asString", "2", ""), KnownName("m10", "0", ""), KnownName("m2", "0", "a motor"),
             KnownName("AX12", "1", "")]  # fmt: skip
    assert candidates(Subject(("o",), ""), names, first=False) == [names[2], names[1], names[3], names[0]]


def test_an_empty_line_stands_for_a_missing_separator() -> None:
    assert lacks_separator("1 + 1\n")
    assert lacks_separator("if (x)\n  1\n")
    assert not lacks_separator("1 + 1")
    assert not lacks_separator("{ 1\n")
    assert not lacks_separator("1 +\n")  # an error as it stands, perhaps not when it goes on


@pytest.mark.parametrize(("text", "ends"), [
    ("quit;", True), ("quit", True), ("1 + 1; lobby.quit;\n", True), ("quit; 1;", False), ('echo("quit");', False),
    ("at (x > 1) quit;", False), ("", False),
])  # fmt: skip
def test_what_ends_the_session(text: str, ends: bool) -> None:
    assert ends_session(text) == ends


def test_the_prompt_of_the_page_is_that_of_the_daemon_of_this_machine() -> None:
    page = (Path(__file__).parents[2] / "docs" / "console.md").read_text()
    assert f"\n    {Where('/run/urbihw/urbi-54000.socket', 54000)}> motor6.val" in page


def test_depth_of_a_text() -> None:
    assert [depth(text) for text in ("", "{", "{ f(", "{}", "}")] == [0, 1, 2, 0, 0]


# ---------------------------------------------------------------- the assistant


class KernelTransport(asyncio.Transport):
    """A connection to a kernel in memory, for a protocol of asyncio; it ends when the kernel has nothing to say."""

    def __init__(self, server: KernelSocket, protocol: asyncio.Protocol, stays: bool = True) -> None:
        super().__init__()
        self._server, self._protocol, self._stays = server, protocol, stays
        self._open, self._asked = True, False
        protocol.connection_made(self)

    def write(self, data: Any) -> None:
        """Send, and have the answer a turn later."""
        self._server.sendall(bytes(data))
        if not self._asked:  # what is sent in a turn is answered together: time passes while nothing comes
            self._asked = True
            asyncio.get_running_loop().call_soon(self._answer)

    def _answer(self) -> None:
        self._asked = False
        try:
            said = self._server.recv(0)
        except TimeoutError:
            said = b""
        if said:
            self._protocol.data_received(said)
            if not self._stays:
                asyncio.get_running_loop().call_soon(self._answer)
        elif self._open and not self._stays:
            self.abort()

    def abort(self) -> None:
        """End the connection."""
        if self._open:
            self._open = False
            self._protocol.connection_lost(None)


def asked(
    monkeypatch: pytest.MonkeyPatch, setup: str, question: Callable[[Assistant, str], Coroutine[Any, Any, T]]
) -> T:
    """Ask an assistant about the lobby in which ``setup`` was run."""
    server = KernelSocket()
    user = server.kernel.open_lobby()
    server.kernel.run_text(user, setup, until=0.0)
    uid = server.kernel.run_text(user, "lobby.uid;", until=0.0).partition('"')[2].rstrip('"\n')

    async def connect(where: Where, who: Credentials, factory: Callable[[], asyncio.Protocol]) -> None:
        KernelTransport(server.open(), factory())

    monkeypatch.setattr("urbihw.client.aio_connection.dial", connect)
    return asyncio.run(question(Assistant(HERE, NOBODY), uid))


ROBOT = """
class Global.Motor { var val = 1; function stop() { echo("STOPPED") }; function load() { val } };
var Global.robot = Object.clone | var Global.robot.arm = Motor.new | var Global.robot.legs = [Motor.new]|;
var mine = 3;
"""


def test_names_are_those_of_the_users_lobby(monkeypatch: pytest.MonkeyPatch) -> None:
    names = asked(monkeypatch, ROBOT, lambda assistant, uid: assistant.names(uid, (), ""))
    ranks = {each.name: each.rank for each in names}
    assert {"mine", "robot", "echo", "connectionTag"} <= set(ranks)
    assert (ranks["robot"], ranks["echo"], ranks["Float"], ranks["connectionTag"]) == ("0", "3", "3", "3")
    few = asked(monkeypatch, ROBOT, lambda assistant, uid: assistant.names(uid, (), "slee"))
    assert few == [KnownName("sleep", "3", "Sleep for a duration in seconds; without an argument, for ever.")]


def test_arguments_of_functions(monkeypatch: pytest.MonkeyPatch) -> None:
    def call(path: tuple[Any, ...], name: str) -> tuple[str, str]:
        return asked(monkeypatch, ROBOT + "function Global.go(x, var y = 2, var z[]) {};",
                     lambda assistant, uid: assistant.call(uid, path, name))  # fmt: skip

    assert call((), "go") == ("(x, [y], z...)", "")
    assert call((), "sleep")[0] == "(duration = inf)"
    assert call((), "sleep")[1].startswith("Sleep for a duration in seconds")
    assert call((), "mine") == ("", "")


def test_help_fits_the_terminal_and_keeps_words_whole() -> None:
    rows = ("load\t0\t\t0 to 1\t1 switches the torque on, 0 off",
            "val\t0.1\trad\t-1 to 1\tmeasured angle; goal when written",
            "list\t[1, 2, 3, 4, 5, 6, 7, 8, 9]\t\t\tsome numbers", "stop\t\t\t\t")  # fmt: skip
    text = "A servo with a description that is longer than a narrow line.\nUnit: rad."
    what = Description("AX12", text, "A, B", "", rows)
    words = {word for row in rows for word in row.split("\t")[-1].split()}
    for columns in (40, 60, 110):
        text = "".join(part[1] for part in described("motor6", what, columns))  # type: ignore[union-attr]
        assert max(map(len, text.splitlines())) < columns
        assert words <= {word for line in text.splitlines() for word in line.split()}
        assert "\n  Unit: rad.\n" in text
        assert max(map(len, keys_text(columns).splitlines())) < columns
    assert "  list  [1, 2, 3, 4, 5, 6, 7, 8, 9]\n                              some numbers\n" in text


@pytest.mark.parametrize("path", [("robot", "arm"), ("robot", "legs", (0.0,)), ("Motor",)])
def test_names_along_a_path(monkeypatch: pytest.MonkeyPatch, path: tuple[Any, ...]) -> None:
    names = asked(monkeypatch, ROBOT, lambda assistant, uid: assistant.names(uid, path, ""))
    assert {"val", "stop", "load"} <= {each.name for each in names}


@pytest.mark.parametrize("path", [("robot", "arm", "stop"), ("nobody",), ("robot", "legs", (7.0,))])
def test_nothing_is_called_on_the_way(monkeypatch: pytest.MonkeyPatch, path: tuple[Any, ...]) -> None:
    with pytest.raises(NoAnswer) as caught:
        asked(monkeypatch, ROBOT, lambda assistant, uid: assistant.names(uid, path, ""))
    assert "STOPPED" not in str(caught.value)


def test_descriptions(monkeypatch: pytest.MonkeyPatch) -> None:
    def describe(path: tuple[Any, ...], name: str) -> Description:
        return asked(monkeypatch, ROBOT, lambda assistant, uid: assistant.describe(uid, path, name))

    sleep = describe((), "sleep")
    assert (sleep.type, sleep.source, sleep.slots) == ("Primitive", "", ())
    assert sleep.text.startswith("Sleep for a duration in seconds")
    stop = describe(("robot", "arm"), "stop")
    assert (stop.type, stop.text) == ("Code", "")
    assert 'echo("STOPPED")' in stop.source
    arm = describe(("robot",), "arm")
    assert (arm.type, arm.protos) == ("Motor", "Motor")
    assert "val" in arm.slots
    assert describe((), "mine").text
    shown = "".join(part[1] for part in described("robot.arm", arm, 100))  # type: ignore[union-attr]
    assert shown.startswith("robot.arm: Motor\n")


def test_what_is_written_is_read() -> None:
    assert written(("a", (6.0,), ('le"ft',))) == '["a", [6], ["le\\"ft"]]'
    assert strings('["a", "b\\"\\n\\x41\\\\", [], ["c"]]') == ["a", 'b"\nA\\', "c"]


def test_only_the_foreground_of_the_user_is_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    server = KernelSocket()
    user = server.kernel.open_lobby()
    uid = server.kernel.run_text(user, "lobby.uid;", until=0.0).partition('"')[2].rstrip('"\n')
    server.kernel.run_text(user, 'every (1s) echo("back"), sleep; echo("never");', until=0.5)

    async def connect(where: Where, who: Credentials, factory: Callable[[], asyncio.Protocol]) -> None:
        KernelTransport(server, factory())

    monkeypatch.setattr("urbihw.client.aio_connection.dial", connect)
    asyncio.run(Assistant(HERE, NOBODY).interrupt(uid))
    assert "killing foreground job" in server.kernel.run_text(user, "", until=0.6)
    assert "*** back" in server.kernel.run_text(user, "echo(1);", until=3.0)


def test_a_server_that_says_nothing_leaves_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    async def connect(where: Where, who: Credentials, factory: Callable[[], asyncio.Protocol]) -> None:
        raise ConnectionRefusedError("refused")

    monkeypatch.setattr("urbihw.client.aio_connection.dial", connect)
    with pytest.raises(NoAnswer, match="refused"):
        asyncio.run(Assistant(HERE, NOBODY).names("0x1", (), ""))


# ---------------------------------------------------------------- how it looks


def test_lexer_of_a_program() -> None:
    text = 'tag: at (motor6.val > 20deg) echo("a\\n") onleave { 1.5s; 0x1f }, // so\n/* two\nlines */ var x = true;'
    kinds: dict[Any, set[str]] = {}
    for kind, value in UrbiscriptLexer().get_tokens(text):
        kinds.setdefault(kind, set()).add(value)
    assert Error not in kinds
    assert {"at", "onleave"} <= kinds[Keyword]
    assert kinds[Keyword.Declaration] == {"var"}
    assert kinds[Keyword.Constant] == {"true"}
    assert kinds[Number] == {"20deg", "1.5s"}
    assert kinds[Name.Label] == {"tag"}
    assert kinds[Name.Function] == {"echo"}
    assert kinds[String.Escape] == {"\\n"}
    assert kinds[Comment.Single] == {"// so"}
    assert "".join(value for _, value in UrbiscriptLexer(ensurenl=False).get_tokens(text)) == text


def line_of(data: bytes) -> Line:
    (line,) = Lines().feed(data)
    return line


def test_each_channel_has_its_colour() -> None:
    styles = {}
    for channel in ("error", "clog", "mine"):
        (*_, body, _) = painted(line_of(f"[00000001:{channel}] text\n".encode()))
        styles[channel] = body[0]
    assert styles == {"error": "class:error", "clog": "class:log", "mine": "class:other"}
    assert painted(line_of(b"[00000001] *** hi\n"))[-2] == ("class:echo", "*** hi")
    assert ("class:pygments.literal.number", "2") in painted(line_of(b"[00000001] 2\n"))


def test_nothing_from_a_server_steers_the_terminal() -> None:
    text = "".join(part[1] for part in painted(line_of(b"[00000001] *** \x1b[31mred\x07\n")))
    assert text == "[00000001] *** �[31mred�\n"


def test_of_a_binary_the_size_is_shown() -> None:
    text = "".join(part[1] for part in painted(line_of(b"[00000001] [BIN 4 jpeg 1 2\n\x00\n\xff\x1b, 2]\n")))
    assert text == "[00000001] [BIN 4 jpeg 1 2 (4 bytes), 2]\n"


# ---------------------------------------------------------------- session and history


def test_a_session_comes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    server = KernelSocket()
    events: list[str] = []
    heard: list[bytes] = []

    attempts = iter([ConnectionRefusedError(111, "Connection refused"), None, None])

    async def connect(where: Where, who: Credentials, factory: Callable[[], asyncio.Protocol]) -> None:
        error = next(attempts, asyncio.CancelledError())
        if error is not None:
            raise error
        KernelTransport(server.open(), factory(), stays=False)

    async def no_pause(seconds: float) -> None:
        events.append(f"pause {seconds:g}" if seconds else "turn")

    monkeypatch.setattr("urbihw.client.aio_connection.dial", connect)
    monkeypatch.setattr(asyncio, "sleep", no_pause)

    def changed() -> None:
        events.append(f"{session.state} {session.uid != ''}")
        if session.state == "connected":
            assert session.send("1 + 1;\n")

    session = ConsoleSession(HERE, NOBODY, lambda line: heard.append(line.text), changed)
    assert not session.send("1;")
    with pytest.raises(asyncio.CancelledError):
        asyncio.run(session.run())
    assert [event for event in events if event != "turn"] == [
        "lost False", "pause 0.25", "connected False", "lost False", "pause 0.25", "connected False", "lost False",
        "pause 0.25",
    ]
    assert heard == [b"2", b"2"]


def test_history_is_kept_where_it_belongs(tmp_path: Any) -> None:
    kept = history({"XDG_STATE_HOME": str(tmp_path)})
    kept.store_string("1;")
    path = tmp_path / "urbihw" / "console_history"
    assert "1;" in path.read_text()
    assert path.stat().st_mode & 0o077 == 0
    (tmp_path / "file").write_text("")
    assert list(history({"XDG_STATE_HOME": str(tmp_path / "file")}).load_history_strings()) == []
