"""Processes, files that let wait, sockets: real ones, on the real clock.  None of them holds up another job."""

from __future__ import annotations

import contextlib
import os
import signal
import socket
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.stdlib import child, file, pipe, poller
from urbihw.kernel.stdlib.socket_channel import MAX_UNHANDLED_SIZE

TIMEOUT_S = 60.0
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

    def until(self, done: Callable[[], bool]) -> None:
        """Run until something is so."""
        end = time.monotonic() + TIMEOUT_S
        while not done():
            assert time.monotonic() < end, "it did not happen in time"
            self.say("sleep(10ms);")

    def hear(self, last: str) -> list[str]:
        """Wait for a line; those before it, without time stamps."""
        end = time.monotonic() + TIMEOUT_S
        said = ""
        while time.monotonic() < end:
            deadline = self.kernel.run()
            said += self.lobby.output.take_bytes().decode("latin-1")
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


def test_only_so_much_is_read_ahead_of_the_programs_of_a_connection(
    talk: Talk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipe, "MAX_BACKLOG_SIZE", 1_000_000)
    talk.say('var l = []|; for| (3) l << Process.new("yes", []); for| (var p : l) p.run;')

    def waits() -> list[int]:
        return [source.unread for member in talk.lobby.slots["l"].l for source in member.sources]

    talk.until(lambda: sum(waits()) >= 1_000_000)
    # Each of them has something to be read.
    talk.until(lambda: all(size >= pipe.CHUNK_SIZE for size in waits()[::2]))
    talk.say("sleep(0.3s);")
    assert sum(waits()) < 1_000_000 + 2 * len(waits()) * pipe.CHUNK_SIZE
    assert talk.say("for| (var p : l) { p.kill }; l[2].stdout.getLine; l[2].stdout.asList.size > 30000;") == [
        '[] "y"', "[] true",
    ]  # fmt: skip


def test_what_a_forgotten_process_has_written_leaves_room_for_others(
    talk: Talk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pipe, "MAX_BACKLOG_SIZE", 500_000)
    typed = 'var p = Process.new("head", ["-c", "400000", "/dev/zero"])|; p.run; p.join; p.done;'
    for _ in range(5):
        assert talk.say(typed + 'removeSlot("p")|;') == ["[] true"]


def test_a_line_without_end_comes_in_pieces_whatever_else_waits(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pipe, "MAX_BACKLOG_SIZE", 500_000)
    typed = 'var p = Process.new("yes", [])|; p.run; sleep(0.2s); var q = Process.new("cat", ["/dev/zero"])|; q.run;'
    assert talk.say(f"{typed} q.stdout.getLine.size; p.kill; q.kill; p.join; q.join;") == [f"[] {pipe.MAX_LINE_LENGTH}"]


def test_a_long_output_is_read_as_a_list_while_others_have_their_turn(talk: Talk) -> None:
    typed = 'var p = Process.new("sh", ["-c", "yes | head -n 200000"])|; p.run; detach({ sleep(5ms); echo("other") })|;'
    assert talk.say(typed + "p.stdout.asList.size;") == ["[] *** other", "[] 200000"]


def _ends(pid: int) -> bool:
    """Whether a process ends soon; one that has ended and was not waited for is a zombie."""
    end = time.monotonic() + TIMEOUT_S
    while time.monotonic() < end:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.01)
    return False


def test_programs_end_with_their_connection(talk: Talk, tmp_path: Path) -> None:
    told = "echo $$ > {0}; exec sleep 600"
    left = "nohup sh -c 'echo $$ > ignores; exec sleep 600' > /dev/null"
    talk.say(f"""System.system("sh -c '{told.format("left")}' &");""")
    talk.say(f'var p = Process.new("sh", ["-c", "{told.format("process")}"])|; p.run; echo(p.stdout);')
    talk.say(f'detach({{ System.system("{told.format("command")}") }})|;')
    talk.say(f'Process.new("sh", ["-c", "{left}"]).run;')
    names = ("process", "command", "left", "ignores")
    while not all((tmp_path / name).exists() and (tmp_path / name).read_text() for name in names):
        talk.say("sleep(10ms);")
    pids = {name: int((tmp_path / name).read_text()) for name in names}
    other = talk.kernel.open_lobby("127.0.0.1")
    talk.lobby.close()
    talk.lobby = other
    talk.say("sleep(100ms);")
    try:
        assert _ends(pids["process"])
        assert _ends(pids["command"])
        for name in ("left", "ignores"):
            assert Path(f"/proc/{pids[name]}").exists(), f"{name} was to go on"
    finally:
        for name in ("left", "ignores"):
            os.kill(pids[name], signal.SIGKILL)
    assert talk.lobby.holdings.held() == []


def test_a_connection_runs_so_many_programs_and_no_more(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child, "MAX_CHILDREN", 3)
    typed = 'var l = []|; for| (3) { l << Process.new("sleep", ["20"]); l.back.run };'
    (wrong,) = talk.say(typed + 'Process.new("sleep", ["20"]).run;')
    assert "run: too many programs: " in wrong
    (wrong,) = talk.say('System.system("sleep 20");')
    assert "system: too many programs: " in wrong
    assert talk.say('for (var p : l) { p.kill; p.join }; System.system("exit 3");') == ["[] 768"]


def test_a_shell_command_holds_up_nobody(talk: Talk) -> None:
    assert talk.say('detach({ sleep(50ms); echo("meanwhile") })|; System.system("sleep 1.5; exit 3") >> 8;') == [
        "[] *** meanwhile", "[] 3",
    ]  # fmt: skip
    (wrong,) = talk.say('System.system("ls \\x00");')
    assert wrong.endswith("system: commands cannot have a null character in them")
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


def test_a_fifo_is_written_to_once_somebody_reads_it(talk: Talk, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    talk.lobby.feed(b'detach({ File.save("fifo", "x" * 1000000); echo("saved") })|; echo("waiting");')
    assert talk.hear("*** waiting") == []
    read = 'sleep(100ms); var i = InputStream.new(File.new("fifo"))|; i.getLine.size; sleep(50ms);'
    assert sorted(talk.say(read)) == ["[] *** saved", "[] 1000000"]


def _threads() -> set[threading.Thread]:
    """Those that attend to files, of this kernel and of former ones."""
    return {thread for thread in threading.enumerate() if thread.name == "urbihw-files"}


def test_who_waits_for_fifos_takes_one_thread_in_all_and_no_more_than_a_few_files(
    talk: Talk, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(poller, "IDLE_TIMEOUT_S", 0.05)
    for name in ("in", "out", "all"):
        os.mkfifo(tmp_path / name)
    before = _threads()
    typed = (
        'var t = Tag.new|; var l = []|; t: for| (30) { var i = InputStream.new(File.new("in")) | l << i |'
        ' detach({ i.getLine }) | detach({ OutputStream.new(File.new("out")) }) }; sleep(50ms);'
        ' t: for| (9) { detach({ try { File.new("all").content } catch (var e) { echo(e.message) } }) }; sleep(50ms);'
    )
    assert set(talk.say(typed)) == {"[] *** too many streams: this connection has 64; close one"}
    (made,) = _threads() - before
    assert len(talk.lobby.holdings.held()) == 64
    talk.say("t.stop; for| (var i : l) i.close; l = []|;")
    talk.until(lambda: talk.lobby.holdings.held() == [])
    # It ends when there is nothing to do.
    talk.until(lambda: not made.is_alive())


def test_what_has_no_end_is_too_large(talk: Talk, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    writer = 'var p = Process.new("sh", ["-c", "exec yes > fifo"])|; p.run; detach({ sleep(5ms); echo("meanwhile") })|;'
    first, wrong = talk.say(writer + 'File.new("fifo").content;')
    assert first == "[] *** meanwhile"
    assert wrong.endswith("content: file too large (more than 16777216 bytes): fifo")
    assert talk.say("p.join; p.status;") == ["[] killed by signal 13"]
    for name in ("/dev/zero", "/dev/urandom"):
        (wrong,) = talk.say(f'File.new("{name}").asList;')
        assert wrong.endswith(f"asList: file too large (more than 16777216 bytes): {name}")
    assert talk.say('InputStream.new(File.new("/dev/zero")).get; File.new("/dev/null").content.data;') == [
        "[] 0", '[] ""',
    ]  # fmt: skip


def test_devices_read_at_once_are_bounded_together(talk: Talk, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file, "MAX_GATHERED_SIZE", 1_000_000)
    read = "detach({ try { File.new(\"/dev/zero\").content } catch (var e) { echo(e.message) }; n += 1 })|;"
    lines = talk.say(f"var n = 0|; {read * 3} waituntil(n == 3);")
    assert set(lines) == {"[] *** too much is read at once (more than 1000000 bytes): /dev/zero"}
    assert pipe.pipes_of(talk.kernel.world).backlog(talk.lobby.holdings).gathered == 0


def test_streams_of_devices_end_with_their_connection(talk: Talk, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    reader = os.open(tmp_path / "fifo", os.O_RDONLY | os.O_NONBLOCK)
    talk.say('var Global.o = OutputStream.new(File.new("fifo"))|; o << "last words";')
    other = talk.kernel.open_lobby("127.0.0.1")
    talk.lobby.close()
    talk.lobby = other
    heard: list[bytes] = []

    def ends() -> bool:
        with contextlib.suppress(BlockingIOError):
            heard.append(os.read(reader, 100))
        return heard[-1:] == [b""]

    try:
        talk.until(ends)
    finally:
        os.close(reader)
    assert b"".join(heard) == b"last words"


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
        'var s = Server.new|; at (s.connection?(var c)) { echo("somebody came") | came += 1 };'
        'var came = 0|; function soon(wanted) { timeout (20s) waituntil (came == wanted) }|;'
        's.listen("127.0.0.1", "0");'
        "Socket.pollInterval = 0|; var c = Socket.new|; c.connect(s.host, s.port); sleep(100ms);"
    )
    assert talk.say(made) == []
    assert talk.say("Socket.poll; soon(1);") == ["[] *** somebody came"]
    assert talk.say("Socket.pollInterval = 0.01|; Socket.new.connect(s.host, s.port); soon(2);") == [
        "[] *** somebody came"
    ]
    talk.say("c.disconnect;")
    talk.until(lambda: talk.say("s.sockets.size;") == ["[] 1"])


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
            held = sum(int(Path(f"/proc/sys/net/ipv4/tcp_{way}mem").read_text().split()[2]) for way in "rw")
            assert MAX_UNHANDLED_SIZE <= sent < 2 * MAX_UNHANDLED_SIZE + held, "the operating system holds some of it"
            read = f"waituntil(n >= {sent}); n > 0;"
            assert talk.say(f"detach({{ every (10ms) io.poll }})|; {read}") == ["[] true"]


def test_what_nobody_reads_cannot_be_written_for_ever(talk: Talk) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        made = f'var s = Socket.new|; s.connect("127.0.0.1", {silent.getsockname()[1]}); var x = "x" * 10000000|;'
        assert talk.say(made) == []
        other, _ = silent.accept()
        with other:
            wrong, *_ = talk.say("for (8) s.write(x);")
    assert "write: the other side does not read: " in wrong
