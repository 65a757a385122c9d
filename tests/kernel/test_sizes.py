"""What is made at once has a bound: strings, lists and binaries that double, files without end."""

from __future__ import annotations

import resource
import time
from pathlib import Path

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.runtime.values import MAX_LIST_LENGTH, MAX_STRING_LENGTH
from urbihw.kernel.server.memory import MIB

CHARACTERS = f"expected a result of at most {MAX_STRING_LENGTH} characters"
MAX_SHOWN_MEMBERS = f"expected a result of at most {MAX_LIST_LENGTH} members"

GROWING = {
    "sum": ('{ var s = "x"; loop| s = s + s };', CHARACTERS),
    "sum in place": ('{ var s = "x" * 1000000; var t = s + ""; loop| s += t };', CHARACTERS),
    "sum of a slot": ('var s = "x"|; loop| s += s;', CHARACTERS),
    "sum with what is no string": ('{ var l = ["x" * 20000000, "x" * 20000000]; "x" * 40000000 + l };', CHARACTERS),
    "product": ('"x" * 1e9;', CHARACTERS),
    "join": ('{ var s = "x" * 1000000; s.join([s] * 1000) };', CHARACTERS),
    "replace": ('("x" * 100000).replace("x", "y" * 100000);', CHARACTERS),
    "assignment of a part": ('{ var s = "x" * 1000; loop| s[0] = s };', CHARACTERS),
    "format": ('{ var s = "%s" * 100; var t = "x" * 1000000; s % ([t] * 100) };', CHARACTERS),
    "list": ("{ var l = [1]; loop| l = l + l };", MAX_SHOWN_MEMBERS),
    "list in place": ("{ var l = [1]; loop| l += l };", MAX_SHOWN_MEMBERS),
    "list repeated": ("[1] * 1e9;", MAX_SHOWN_MEMBERS),
    "binary": ('{ var b = Binary.new("", "x"); loop| b = b + b };', f"at most {MAX_STRING_LENGTH} bytes"),
}


def said(text: str, seconds: float = 0.0) -> str:
    """The output of a new connection; in real time if there are seconds to wait for it."""
    kernel = Kernel(fast=not seconds)
    lobby = kernel.open_lobby("127.0.0.1")
    if not seconds:
        return kernel.run_text(lobby, text, 1.0)
    lobby.feed(text.encode())
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        kernel.scheduler.run()
        data = bytes(lobby.output.take_bytes())
        if data:
            return data.decode("latin-1")
        time.sleep(0.005)
    raise AssertionError("no answer")


@pytest.mark.parametrize("kind", GROWING)
def test_nothing_grows_without_bound_at_one_stroke(kind: str) -> None:
    text, wanted = GROWING[kind]
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert wanted in said(text)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300 * MIB // 1024


def test_what_is_as_long_as_may_be_is_made() -> None:
    assert said(f'("x" * {MAX_STRING_LENGTH}).size;').split() == ["[00000000]", str(MAX_STRING_LENGTH)]


def test_a_device_without_end_is_not_read_without_end() -> None:
    assert "file too large (more than 16777216 bytes): /dev/zero" in said('File.new("/dev/zero").content;', 20.0)


def test_a_large_file_is_not_loaded(tmp_path: Path) -> None:
    path = tmp_path / "large.u"
    with path.open("wb") as file:
        file.truncate(MAX_STRING_LENGTH + 1)
    assert "file too large" in said(f'load("{path}");')
    assert "file not found" in said('load("/dev/zero");')


@pytest.mark.parametrize("text", ['File.new("/proc/self/mem").content', 'load("/proc/self/mem")',
                                  'InputStream.new(File.new("/proc/self/mem")).getLine'])
def test_a_file_that_cannot_be_read_is_an_error(text: str) -> None:
    answer = said(f"{text};")
    assert "Input/output error" in answer
    assert "internal error" not in answer


def test_a_line_without_end_comes_in_pieces(tmp_path: Path) -> None:
    path = tmp_path / "line"
    with path.open("wb") as file:
        file.truncate(MAX_STRING_LENGTH)
    answer = said(f'InputStream.new(File.new("{path}")).getLine.size;')
    assert answer.split()[1] == str(1024 * 1024)


def test_programs_leave_half_of_the_descriptors_to_clients_and_to_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    assert said('var s = Server.new|; s.listen("127.0.0.1", "0"); s.port > 0;', 1.0).endswith("true\n")
    monkeypatch.setattr(resource, "getrlimit", lambda what: (8, 8))
    for text in ('Server.new.listen("127.0.0.1", "0");', 'Socket.new.connect("127.0.0.1", "1");'):
        assert "too many files and connections are open" in said(text, 1.0)


def test_what_a_lobby_is_handed_to_read_is_bounded() -> None:
    full = 'var l = Lobby.create|; l.receive("sleep(1s);"); sleep(10ms); for| (2) l.receive("/*" + "x" * 3e6 + "*/");'
    assert "receive: too much to be read: 6000008 bytes wait already, 3000000 more are too many" in said(
        full + ' l.receive("x" * 3e6);', 0.5
    )
    assert said(full + ' sleep(2s); l.receive("echo(40 + 2);");', 5.0).endswith("*** 42\n")
    assert "receive: too much to be read" in said('lobby.receive("x" * 1e7);')
