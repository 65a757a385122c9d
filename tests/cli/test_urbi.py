"""The command ``urbi``, in this process.  What needs signals, terminals or clients: tests/e2e."""

from __future__ import annotations

import logging
import re
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from urbihw.cli import logs, urbi

Capture = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _the_log_as_before() -> Iterator[None]:
    root = logging.getLogger()
    handlers, level = list(root.handlers), root.level
    yield
    root.handlers[:] = handlers
    root.setLevel(level)


def run(capfd: Capture, *arguments: str) -> tuple[int, list[str], str]:
    """The exit code, the lines on standard output without stamps, and standard error."""
    try:
        code = urbi.main(arguments)
    except SystemExit as caught:
        assert isinstance(caught.code, int)
        code = caught.code
    out, err = capfd.readouterr()
    return code, [re.sub(r"^\[\d{8,}(:?\w*)\] ", r"[\1] ", line).removeprefix("[] ") for line in out.splitlines()], err


def test_program_name_is_the_path_under_which_it_was_called(monkeypatch: pytest.MonkeyPatch, capfd: Capture) -> None:
    monkeypatch.setattr("sys.argv", ["/opt/urbihw/bin/urbi"])
    code, said, _ = run(capfd, "-q", "-e", "echo(System.programName); echo(System.arguments); shutdown;")
    assert (code, said) == (0, ["*** /opt/urbihw/bin/urbi", "*** []"])


def test_the_fast_example_of_the_manual(capfd: Capture) -> None:
    text = '{ sleep(2s); echo("after") } & { sleep(1s); echo("before") }; echo(time.round); shutdown;'
    assert run(capfd, "-q", "--fast", "-e", text)[:2] == (0, ["*** before", "*** after", "*** 2"])


def test_a_banner_unless_quiet(capfd: Capture) -> None:
    assert len(run(capfd, "-e", "shutdown;")[1]) == 10
    assert run(capfd, "--no-banner", "-e", "shutdown;")[1] == []


def test_a_script_and_its_arguments(capfd: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "script.u").write_text("#! /usr/bin/env urbi\necho(System.arguments); foo; shutdown;\n")
    code, said, _ = run(capfd, "-q", "script.u", "a", "--port")
    assert code == 70
    assert said == ['*** ["a", "--port"]', "[:error] !!! script.u:2.25-27: lookup failed: foo"]
    assert run(capfd, "-q", "-e", "echo(System.arguments); shutdown;", "--", "-q")[1] == ['*** ["-q"]']


def test_the_value_of_an_option_may_look_like_an_option(capfd: Capture) -> None:
    assert run(capfd, "-q", "-e", "-1;", "--expression", "-2;", "-e", "shutdown;")[1] == ["-1", "-2"]


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("--no-such-option",), 64, "urbi: invalid option: --no-such-option"),
        (("--port", "many"), 64, "'many' is no port"),
        (("--port", "70000"), 64, "'70000' is no port"),
        (("--debug", "SHOUT"), 64, "NONE, LOG, TRACE, DEBUG, DUMP"),
        (("--stack-size", "-1"), 64, "is no size"),
        (("-e",), 64, "expected one argument"),
        (("-f", "/none.u"), 66, "urbi: failed to process file /none.u: No such file or directory"),
        (("--host", "192.0.2.1", "--port", "0", "-e", ";"), 69, "cannot listen to port 192.0.2.1:0"),
        (("--host", "x" * 70, "--port", "0", "-e", ";"), 69, ":0: this is no name of a host"),
        (("--port-file", "/none/port", "-e", ";"), 78, "cannot write /none/port"),
        (("--module", "none", "-e", ";"), 78, "none"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(capfd: Capture, arguments: tuple[str, ...], code: int, words: str) -> None:
    got, _, err = run(capfd, "-q", *arguments)
    first, *rest = err.splitlines()
    assert (got, rest) == (code, ["Try `urbi --help' for more information."] if code == 64 else [])
    assert words in first


def test_a_port_that_is_taken(capfd: Capture) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        code, _, err = run(capfd, "-q", "-P", str(port))
    assert (code, err) == (69, f"urbi: cannot listen to port 127.0.0.1:{port}: Address already in use\n")


@pytest.mark.parametrize(("text", "code"), [("1+; foo;", 65), ("foo; 1+;", 70), ("1;", 0)])
def test_errors_in_what_was_given_decide_about_the_exit_code(capfd: Capture, text: str, code: int) -> None:
    assert run(capfd, "-q", "-e", text, "-e", "shutdown;")[0] == code


def test_a_program_may_end_the_process_with_a_code_and_goes_no_further(capfd: Capture) -> None:
    assert run(capfd, "-q", "-e", "echo(1) | System._exit(259) | echo(2); echo(3);")[:2] == (3, ["*** 1"])


def test_an_error_in_a_start_up_file_is_told_and_no_more(
    capfd: Capture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "global.u").write_text("echo(1); foo; echo(2);")
    (tmp_path / "local.u").write_text("echo(3);")
    code, said, _ = run(capfd, "-q", "-e", "echo(4); bar; shutdown;")
    assert code == 70
    assert said[0] == f"[:clog] *** loading {tmp_path}/global.u."
    assert said[1:3] == ["*** 1", "[:error] !!! global.u:1.10-12: lookup failed: foo"]
    assert said[-2:] == ["*** 4", "[:error] !!! 1.10-12: lookup failed: bar"]
    assert "*** 2" not in said and "*** 3" not in said


def test_the_root(capfd: Capture, monkeypatch: pytest.MonkeyPatch) -> None:
    assert Path(run(capfd, "--print-root")[1][0], "cli", "urbi.py").is_file()
    monkeypatch.setenv("URBI_ROOT", "/opt/urbi")
    assert run(capfd, "--print-root")[1] == ["/opt/urbi"]


def test_the_log_is_what_the_variables_want(capfd: Capture) -> None:
    def logged(verbosity: str | None, **environment: str) -> str:
        logs.set_up("urbi", verbosity, environment)
        for category in ("urbihw.server", "urbihw.uobject"):
            logging.getLogger(category).warning("warn")
            logging.getLogger(category).info("info")
        return capfd.readouterr().err

    assert logged(None) == "urbi: warn\n" * 2
    assert logged("TRACE") == "urbi: warn\nurbi: info\n" * 2
    assert logged(None, GD_LEVEL="none") == ""
    assert logged("LOG", GD_LEVEL="NONE") == "urbi: warn\n" * 2
    assert logged(None, GD_ENABLE_CATEGORY="server", GD_THREAD="1") == "<MainThread> urbi: warn\n"
    assert logged(None, GD_DISABLE_CATEGORY="server,urbihw.uobject") == ""
