"""The simulated robot of ``--fake``, and its console as the object ``fake``."""

from __future__ import annotations

import asyncio
import os
import signal
from collections.abc import Iterator

import pytest

from urbihw.daemon import fake as module
from urbihw.daemon.fake import Fake, FakeConsole
from urbihw.kernel import Kernel
from urbihw.kernel.uobject import NotReady

ARGUMENTS = ("bioloid", "--pty", "--until-eof")


@pytest.fixture
def fake() -> Iterator[Fake]:
    made = Fake(ARGUMENTS)
    asyncio.run(made.url())
    yield made
    made.close()


def test_its_words_are_known_and_each_line_has_one_answer(fake: Fake) -> None:
    words = {word["name"]: word for word in fake.commands}
    assert {"silence", "heal", "unplug", "plug", "clap", "load"} <= set(words)
    meaning = "end the faults of one unit (1 to 18, 100), or of all"
    assert words["heal"] == {"name": "heal", "parameters": "[ID]", "meaning": meaning}
    assert fake.tell("silence 6") == "ok"
    assert fake.tell("") == ""
    assert fake.tell("nothing") == "error: 'nothing' is not a word here; say help"
    assert len(fake.tell("help").split("\n")) == len(fake.commands)


def test_more_than_one_line_is_refused(fake: Fake) -> None:
    for line in ("heal\nunplug", "x" * 201, "\x1b[2J"):
        with pytest.raises(ValueError, match="one line of up to 200 characters"):
            fake.tell(line)
    assert fake.tell("heal") == "ok"


def test_one_that_is_held_up_or_gone_is_told_and_later_answers_fit_their_lines(
    fake: Fake, monkeypatch: pytest.MonkeyPatch
) -> None:
    process = fake._process
    os.kill(process.pid, signal.SIGSTOP)
    monkeypatch.setattr(module, "ANSWER_TIMEOUT_S", 0.05)
    try:
        with pytest.raises(ValueError, match="does not answer"):
            fake.tell("help")
    finally:
        os.kill(process.pid, signal.SIGCONT)
    monkeypatch.setattr(module, "ANSWER_TIMEOUT_S", 10.0)
    assert fake.tell("heal") == "ok"
    process.kill()
    process.wait()
    with pytest.raises(ValueError, match="has ended"):
        fake.tell("heal")


def test_one_that_cannot_start_is_not_ready() -> None:
    made = Fake(("bioloid", "--no-such-option"))
    try:
        with pytest.raises(NotReady, match="did not start"):
            asyncio.run(made.url())
    finally:
        made.close()


def test_the_object_fake_says_lines_while_other_jobs_go_on(fake: Fake) -> None:
    kernel = Kernel()
    kernel.host.create(FakeConsole, "fake", fake)
    lobby = kernel.open_lobby()
    kernel.feed(lobby, b'fake.commands.size > 10; fake.tell("heal"); fake.tell("a\\nb"); FakeConsole.new; echo("end");')
    answer = b""
    while b"*** end" not in answer:
        kernel.run()
        answer += lobby.output.take_bytes()
    lines = [line.partition("] ")[2] for line in answer.decode().splitlines()]
    assert lines == [
        "true",
        '"ok"',
        "!!! 1.45-61: tell: one line of up to 200 characters expected",
        "!!! 1.64-78: new: there is one console, fake: it belongs to the simulated robot",
        "*** end",
    ]
    kernel.close()
