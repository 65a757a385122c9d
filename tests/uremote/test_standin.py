"""What an original server says, recorded, against our remote: it reads the same values as the original remote did."""

from __future__ import annotations

import logging
import re
from pathlib import Path
from typing import Any

import pytest
from replay import raw

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject, function
from urbihw.kernel.uremote.bridge import Bridge
from urbihw.kernel.uremote.remote import ServerReader

RECORDING = Path(__file__).parent / "captures" / "standin-values.txt"


class RemoteAll(UObject):
    """Gives lists back in reverse, as the recorded program did."""

    uname = "remall"

    @function("transmitL")
    def transmit(self, values: list[Any]) -> list[Any]:
        return values[::-1]


class StandIn:
    """The server's side of a conversation, by hand; it knows none of our words."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.sent: list[bytes | memoryview] = []
        self.bridge = Bridge(self.kernel.host, "here_1", self.sent.extend)
        self.kernel.host.register(RemoteAll)
        self.bridge.connected()
        asked = b"[isdef(binaryMode), isdef(UVar.own), isdef(uobjects.remall)]"
        assert b'Channel.new("urbihw_hello") << ' + asked + b"|;" in self.heard()
        self.tell("[00000005:urbihw_hello] [false, false, false]\n")

    def tell(self, text: str) -> str:
        """Say something; what comes back."""
        self.bridge.receive(text.encode("latin-1"))
        self.kernel.scheduler.run_simulated(0)
        return self.heard().decode("latin-1")

    def heard(self) -> bytes:
        self.kernel.scheduler.run_simulated(0)
        said = b"".join(self.sent)
        self.sent.clear()
        return said


def conversation() -> list[tuple[str, str]]:
    """What the stand-in said, and what the original remote answered, for all lists of the recording."""
    found, question = [], ""
    for line in RECORDING.read_text("latin-1").splitlines():
        if line.startswith("S: ") and "transmitL" in line:
            question = raw(line[3:])
        elif line.startswith("R: ") and question:
            found.append((question, raw(line[3:])))
            question = ""
    return found


def value_of(answer: str) -> Any:
    """The list in ``Global.UObject.funCall("b0", [...]),``, the Binaries in it in the server's notation."""
    text = re.search(r'funCall\("b\d+", (.*)\),', answer, re.DOTALL)
    assert text is not None, answer
    binary = re.compile(r'Global\.Binary\.new\("([^"]*)", "\\B\((\d+)\)\((.*?)\)"\)', re.DOTALL)
    plain = binary.sub(r"BIN \2 \1\n\3", text[1])
    (line,) = ServerReader().feed(f"[00000001:__ExternalMessage__] {plain}\n".encode("latin-1"))
    return line.value


def test_a_class_announces_itself_as_the_original_does() -> None:
    stand_in = StandIn()
    said = stand_in.tell('[00000010:__ExternalMessage__] [4, "r1", "remall"]\n')
    functions = ["external function (1) r1.transmitL from r1", "external function (0) r1.init from r1"]
    words = ["class r1{}", "external object r1", *functions]
    assert [said.index(word) for word in words] == sorted(said.index(word) for word in words)
    answer = stand_in.tell('[00000011:__ExternalMessage__] [0, "r1.init__0", "b1"]\n')
    assert answer == 'Global.UObject.funCall("b1")|;\n'


@pytest.mark.parametrize(("question", "answer"), conversation(), ids=lambda text: text[32:64])
def test_lists_are_read_as_by_the_original(question: str, answer: str, caplog: pytest.LogCaptureFixture) -> None:
    stand_in = StandIn()
    stand_in.tell('[00000010:__ExternalMessage__] [4, "r1", "remall"]\n')
    with caplog.at_level(logging.CRITICAL):
        ours = stand_in.tell(question)
    theirs = value_of(answer)
    if theirs == []:  # the original drops what it cannot read; we read it, or refuse the call
        assert "Exception.new" in ours or value_of(ours)
    else:
        assert value_of(ours) == theirs


def test_the_end_of_an_object() -> None:
    stand_in = StandIn()
    stand_in.tell('[00000010:__ExternalMessage__] [4, "r1", "remall"]\n')
    assert stand_in.tell('[00000012:__ExternalMessage__] [5, "r1"]\n') == ""
    assert not stand_in.bridge.empty
    stand_in.tell('[00000013:__ExternalMessage__] [5, "remall"]\n')
    assert stand_in.bridge.empty
