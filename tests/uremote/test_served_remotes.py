"""What the server owes a remote of the C++ SDK: no frame that it would die of, limits, binary mode, plain errors."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.sched.clock import SimClock
from urbihw.kernel.uobject import UObject, reading

CLASS = (
    "class X{}|external object X|external function (0) X.update from X|"
    "if (!isdef(X.load)) var X.load|external var X.load from hookPoint_vm_1|external function (1) X.init from X|;;"
)
HOOK = "class hookPoint_vm_1{}|external object hookPoint_vm_1|;"


class Place:
    """A server, a remote with the class X, and a user."""

    def __init__(self) -> None:
        self.kernel = Kernel(SimClock())
        self.remote = self.kernel.open_lobby("127.0.0.1")
        self.user = self.kernel.open_lobby("127.0.0.1")
        assert self.say(self.remote, HOOK + CLASS) == []

    def say(self, lobby: Any, text: str | bytes) -> list[str]:
        """The output of a lobby after its client sent this, without the time stamps."""
        lobby.feed(text if isinstance(text, bytes) else text.encode("latin-1"))
        self.kernel.scheduler.run_simulated(self.kernel.clock.now() + 0.01)
        return self.heard(lobby)

    @staticmethod
    def heard(lobby: Any) -> list[str]:
        """What it was told."""
        return [line.partition("] ")[2] for line in lobby.output.take_bytes().decode("latin-1").splitlines()]

    def make(self) -> str:
        """An instance, in the slot ``z`` of Global, with a function ``add`` and a variable ``v``; its name."""
        self.say(self.user, "var Global.z = X.new(0)|;")
        (new,) = self.heard(self.remote)
        name = new.split('"')[1]
        (init,) = self.say(self.remote, CLASS.replace("X", name))
        said = self.say(
            self.remote,
            f"external function (2) {name}.add from {name}|try{{var {name}.e = Event.new()}} catch(var e) {{}}|"
            f"external event (1) {name}.e from {name}|if (!isdef({name}.v)) var {name}.v|"
            f"external var {name}.v from hookPoint_vm_1|"
            f'Global.UObject.funCall("{init.split(chr(34))[3]}", 0),;',
        )
        assert said == []
        return name


@pytest.fixture
def place() -> Place:
    return Place()


# ---------------------------------------------------------------- ends


@pytest.mark.parametrize("end", ["z.destroy|;", ""])
def test_no_frame_leaves_for_an_object_that_has_ended(place: Place, end: str) -> None:
    """A remote aborts when a function is called of an object that it does not have any more."""
    name = place.make()
    place.say(place.user, 'var Global.add = z.getSlot("add")|;')
    if end:
        assert place.say(place.user, end) == []
        assert place.heard(place.remote) == [f'[5, "{name}"]']
    # What the C++ side says when an object ends, by any side: one line for each of its variables.
    words = f'UObject.unnotify("{name}", "v",1)|\nUObject.unnotify("{name}", "load",1)|\n;\n'
    assert place.say(place.remote, words) == []
    for call in ("z.add(1, 2);", "z.add(1);", "add(1, 2);"):
        (said,) = place.say(place.user, call)
        assert said.endswith("lookup failed: add")
    assert place.say(place.user, "z.e!(1)|; z.v = 3|; z.load = 2|;") == []
    assert place.heard(place.remote) == []
    assert place.say(place.user, f'uobjects.hasSlot("{name}");') == ["false"]


def test_a_class_that_was_destroyed_makes_no_instances(place: Place) -> None:
    place.say(place.user, "var Global.kind = X|; X.destroy|;")
    assert place.heard(place.remote) == ['[5, "X"]']
    (said,) = place.say(place.user, "kind.new(0);")
    assert said.endswith("lookup failed: X")
    assert place.heard(place.remote) == []


def test_a_name_that_is_declared_again_is_served_again(place: Place) -> None:
    name = place.make()
    place.say(place.user, "z.destroy|;")
    place.heard(place.remote)
    again = CLASS.replace("X", name) + f"external function (2) {name}.add from {name}|;"
    assert place.say(place.remote, again) == []
    (said,) = place.say(place.user, "z.add(1, 2);")
    assert said.endswith("lookup failed: add")
    place.say(place.user, f"{name}.add(1, 2);")
    assert place.heard(place.remote)[0].startswith(f'[0, "{name}.add__2"')


def test_temporary_variables_end_no_object(place: Place) -> None:
    """A C++ UVar that lives as long as a function call is taken back, and the object lives on."""
    name = place.make()
    assert place.say(place.remote, f'UObject.unnotify("{name}", "v",1)|;') == []
    place.say(place.user, "z.add(1, 2);")
    assert place.heard(place.remote)[0].startswith(f'[0, "{name}.add__2"')


# ---------------------------------------------------------------- properties


@pytest.mark.parametrize("binary", [False, True])
def test_limits_act_on_what_a_remote_writes(place: Place, binary: bool) -> None:
    name = place.make()
    place.say(place.user, "z.v->rangemin = -2|; z.v->rangemax = 10|;")
    if binary:
        assert place.say(place.remote, 'binaryMode(1, "t");') == ["true"]
        place.remote.feed(b"\x02\x04\x08\x08")

    def write(value: float) -> list[str]:
        path = f"{name}.v".encode()
        frame = b"\x01\x00" + bytes([len(path)]) + path + b"\x02" + struct.pack("<d", value) + bytes(8)
        return place.say(place.remote, frame if binary else f'{name}.getSlot("v").update_timed({value}, 1)|;')

    assert write(5) == []  # what a remote wrote does not come back to it
    assert place.say(place.user, "z.v;") == ["5"]
    (told,) = write(50)  # what is kept in its place does, or its copy would be wrong
    assert told.startswith(f'[1, "{name}.v", 10, ')
    assert place.say(place.user, "z.v;") == ["10"]
    assert write(-3)[0].startswith(f'[1, "{name}.v", -2, ')
    place.say(place.user, "z.v->constant = true|;")
    (said,) = write(3)
    assert said.startswith("!!! ") and said.endswith("cannot modify const slot")
    assert place.say(place.user, "z.v;") == ["-2"]


def test_blending_acts_on_what_a_remote_writes(place: Place) -> None:
    name = place.make()
    place.say(place.user, 'z.v = 0|; z.v->blend = "cancel"|; z.v = 9 time:10s,')
    place.heard(place.remote)
    place.say(place.remote, f'{name}.getSlot("v").update_timed(5, 1)|;')
    place.kernel.scheduler.run_simulated(place.kernel.clock.now() + 1)
    assert place.say(place.user, "z.v;") == ["5"]


# ---------------------------------------------------------------- names that are no device's


def test_a_variable_of_what_is_no_device_is_refused_and_the_rest_goes_on(place: Place) -> None:
    for path in ("System.version", "Global.echo", "Object.asString", "Math.pi"):
        said = place.say(place.remote, f"external var {path} from X|external function (0) X.f{path[-1]} from X|;")
        assert len(said) == 1 and said[0].startswith("!!! "), said
        assert place.say(place.user, f'X.hasSlot("f{path[-1]}");') == ["true"]
    assert place.say(place.user, "System.version;") == ['"2.3.0"']
    assert place.say(place.user, "System.version = 3|; var x = UObject.new|; var x.v = 1|;")[1:] == []
    assert place.heard(place.remote) == []


# ---------------------------------------------------------------- the hand-shake


def test_a_remote_is_told_a_version_from_which_on_it_speaks_binary(place: Place) -> None:
    """A remote of the SDK compares these numbers with 2.6.0.13; the language stays 2.3."""
    asked = ", ".join(f'PackageInfo.components["Urbi SDK"].{name}' for name in ("major", "minor", "subMinor", "patch"))
    (said,) = place.say(place.remote, f'try {{ Channel.new("URBI_1") << {{[{asked},]}} }} catch (var e) {{}},')
    assert [int(number) for number in said.strip("[]").split(", ")] >= [2, 6, 0, 13]
    assert place.say(place.remote, "System.version;") == ['"2.3.0"']


# ---------------------------------------------------------------- RTP, which is not theirs here


def test_a_remote_that_has_the_class_of_rtp_is_told_not_to_use_it(place: Place) -> None:
    declared = CLASS.replace("X", "URTP")
    assert place.say(place.remote, declared) == ["[8]"]
    assert place.say(place.user, 'URTP.hasLocalSlot("isRemote");') == ["true"]
    place.make()
    assert place.say(place.user, 'z.getSlot("v").rtp = true|;') == []
    assert place.heard(place.remote) == []
    place.remote.close()
    assert place.say(place.user, 'URTP.hasLocalSlot("isRemote");') == ["false"]


def test_the_class_of_rtp_is_there_and_declines(place: Place) -> None:
    assert place.say(place.remote, 'loadModule("urbi/rtp")|; var r = URTP.new|; URTP.new|;') == ["[8]"]
    assert place.say(place.user, "URTP.new; URTP;") == ["URTP"]


# ---------------------------------------------------------------- a camera without a picture


class Camera(UObject):
    """A camera that has no picture yet, and no slot ``format``."""

    val = reading()


@pytest.mark.parametrize("expression", ["camera.val", "camera.format", 'camera.getSlot("val").uvalueSerialize'])
def test_a_camera_without_a_picture_answers_a_plain_error(place: Place, expression: str) -> None:
    place.kernel.host.create(Camera, "camera")
    get = f'try {{ Channel.new("URBI_1") << {{ {expression} }} }} catch (var e) {{ lobby.send("!!! " + e, "URBI_1") }},'
    quoted = expression.replace('"', '\\"')
    for words in (get, f'UObject.syncGet("{quoted}", "URBI_1"),'):
        (said,) = place.say(place.remote, words)
        assert said.startswith("!!! ") and ("unexpected void" in said or "lookup failed: format" in said)
