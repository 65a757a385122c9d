"""Processes, files that let wait, sockets: real ones, on the real clock.  None of them holds up another job."""

from __future__ import annotations

import os
import socket
import threading
import time
from pathlib import Path

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.stdlib.wire import LIMIT

LONGEST = 10.0
"""Seconds until an answer that does not come is given up."""


class Talk:
    """One connection to a kernel on the real clock."""

    def __init__(self) -> None:
        self._woken = threading.Event()
        self.kernel = Kernel(wake_host=self._woken.set)
        self.lobby = self.kernel.open_lobby("127.0.0.1")

    def say(self, text: str) -> list[str]:
        """Type something and wait until all of it ran; the lines that came, without time stamps."""
        self.lobby.feed(f'{text}\n"that was all";\n'.encode("latin-1"))
        return self.hear('"that was all"')

    def hear(self, last: str) -> list[str]:
        """Wait for a line; those before it, without time stamps."""
        end = time.monotonic() + LONGEST
        said = ""
        while time.monotonic() < end:
            deadline = self.kernel.run()
            said += self.lobby.output.take().decode("latin-1")
            lines = [line[:1] + line[9:] if line[:1] == "[" else line for line in said.splitlines()]
            if f"[] {last}" in lines:
                return lines[: lines.index(f"[] {last}")]
            now = self.kernel.clock.now()
            self._woken.wait(0.05 if deadline is None else min(max(deadline - now, 0), 0.05))
            self._woken.clear()
        raise AssertionError(f"{last} never came: {said}")


@pytest.fixture
def talk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Talk:
    monkeypatch.chdir(tmp_path)
    return Talk()


# ---------------------------------------------------------------- processes


def test_a_process_reads_and_writes(talk: Talk) -> None:
    typed = (
        'var p = Process.new("sort", ["-r"])|; p.run; p.stdin << "a\\nb\\n"|; p.stdin.close; p.stdout.asList;'
        "p.join; p.status; p.done; p.run;"
    )
    answered = talk.say(typed)
    assert answered[:3] == ['[] ["b", "a"]', "[] exited with status 0", "[] true"]
    assert answered[3].endswith("run: Process was already run")


def test_output_goes_to_a_file(talk: Talk, tmp_path: Path) -> None:
    typed = 'var p = Process.new("sh", ["-c", "echo out; echo err >&2; exit 3"])|; p.runTo(Path.new("o.txt")); p.join;'
    assert talk.say(typed + "p.stdout.asList; p.stderr.asList; p.status;") == [
        "[] []", '[] ["err"]', "[] exited with status 3",
    ]  # fmt: skip
    assert (tmp_path / "o.txt").read_text() == "out\n"


def test_a_file_that_cannot_be_made_starts_nothing(talk: Talk) -> None:
    typed = 'var p = Process.new("true", [])|; p.runTo("nowhere/o.txt"); p.status;'
    wrong, state = talk.say(typed)
    assert wrong.endswith("runTo: No such file or directory: nowhere/o.txt")
    assert state == "[] not started"


def test_a_program_that_does_not_exist(talk: Talk) -> None:
    (answered,) = talk.say('Process.new("no-such-program", []).run;')
    assert answered.endswith("run: No such file or directory: no-such-program")


def test_a_program_that_talks_for_ever_waits_for_its_reader(talk: Talk) -> None:
    typed = 'var p = Process.new("yes", [])|; p.run; sleep(0.3s); p.stdout.getLine; p.kill; p.join; p.status;'
    assert talk.say(typed) == ['[] "y"', "[] killed by signal 9"]


def test_a_program_that_does_not_read_is_not_written_to_for_ever(talk: Talk) -> None:
    typed = 'var p = Process.new("sleep", ["9"])|; p.run; var x = "x" * 10000000|; for (8) p.stdin << x;'
    wrong, *_ = talk.say(f"{typed} p.kill; p.join;")
    assert "<<: the other side does not read: " in wrong


def test_a_shell_command_holds_up_nobody(talk: Talk) -> None:
    assert talk.say('detach({ sleep(50ms); echo("meanwhile") })|; System.system("sleep 0.4; exit 3") >> 8;') == [
        "[] *** meanwhile", "[] 3",
    ]  # fmt: skip
    (wrong,) = talk.say("System.system(1);")
    assert wrong.endswith("system: unexpected 1 for argument 1, expected a String")


# ---------------------------------------------------------------- files that let wait


def test_reading_and_writing_a_fifo_holds_up_nobody(talk: Talk, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    read = 'detach({ var i = InputStream.new(File.new("fifo")); echo(i.getLine); echo(i.getLine.isVoid) })|;'
    assert talk.say(read + 'sleep(50ms); echo("meanwhile");') == ["[] *** meanwhile"]
    talk.lobby.feed(b'var o = OutputStream.new(File.new("fifo"))|; o << "through\\n"|; o.close;')
    assert talk.hear("*** true") == ["[] *** through"]
    talk.lobby.feed(b'detach({ echo(File.new("fifo").content.data) })|; echo("waiting");')
    assert talk.hear("*** waiting") == []
    (tmp_path / "fifo").write_text("all of it")
    assert talk.hear("*** all of it") == []


# ---------------------------------------------------------------- sockets


def test_a_connection_that_is_refused(talk: Talk) -> None:
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        port = nobody.getsockname()[1]
        (answered,) = talk.say(f'Socket.new.connect("127.0.0.1", {port});')
    assert answered.endswith("connect: Connection refused")


def test_hosts_that_have_no_address(talk: Talk) -> None:
    long = "a" * 70
    (answered,) = talk.say(f'Socket.new.connect("{long}.example", 1);')
    assert answered.endswith("connect: invalid host name")
    (answered,) = talk.say('Socket.new.connect("no.such.host.invalid", 1);')
    assert "!!! " in answered and "connect: " in answered


def test_without_an_interval_sockets_wait_to_be_polled(talk: Talk) -> None:
    made = (
        'var s = Server.new|; at (s.connection?(var c)) echo("somebody came"); s.listen("127.0.0.1", "0");'
        "Socket.pollInterval = 0|; var c = Socket.new|; c.connect(s.host, s.port); sleep(100ms);"
    )
    assert talk.say(made) == []
    assert talk.say("Socket.poll; sleep(50ms);") == ["[] *** somebody came"]
    assert talk.say("Socket.pollInterval = 0.01|; Socket.new.connect(s.host, s.port); sleep(100ms);") == [
        "[] *** somebody came"
    ]
    assert talk.say("c.disconnect; sleep(50ms); s.sockets.size;") == ["[] 1"]


def test_a_flood_that_nobody_handles_waits_on_the_other_side(talk: Talk) -> None:
    with socket.create_server(("127.0.0.1", 0)) as flood:
        made = f'var io = IoService.new|; var s = io.makeSocket|; s.connect("127.0.0.1", {flood.getsockname()[1]});'
        assert talk.say(made + "var n = 0|; at (s.received?(var d)) n += d.size;") == []
        other, _ = flood.accept()
        with other:
            other.setblocking(False)
            sent = 0
            end = time.monotonic() + 1.0
            while time.monotonic() < end:
                try:
                    sent += other.send(b"x" * 65536)
                    end = time.monotonic() + 1.5
                except BlockingIOError:
                    talk.say("")
            assert LIMIT <= sent < 4 * LIMIT
            read = "waituntil(n >= 10000000); n > 0;"
            assert talk.say(f"detach({{ every (10ms) io.poll }})|; {read}") == ["[] true"]


def test_what_nobody_reads_cannot_be_written_for_ever(talk: Talk) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        made = f'var s = Socket.new|; s.connect("127.0.0.1", {silent.getsockname()[1]}); var x = "x" * 10000000|;'
        assert talk.say(made) == []
        other, _ = silent.accept()
        with other:
            wrong, *_ = talk.say("for (8) s.write(x);")
    assert "write: the other side does not read: " in wrong
