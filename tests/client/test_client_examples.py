"""The programs of docs/examples/client, and the dialogues of docs/client.md, against a server with a motor, a sensor
and a camera made of urbiscript."""

from __future__ import annotations

import doctest
import runpy
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest
from lan_server import Lan

import urbihw
from urbihw.client import aio, robot

pytestmark = pytest.mark.e2e

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "docs" / "examples" / "client").glob("*.py"))
SETUP = """
class Global.Motor { var val = 0; var load = 0.1; };
Motor.addProto(Interface.RotationalMotor);
var Global.motor6 = Motor.new;
motor6.val = 0; motor6.val->unit = "rad"; motor6.val->rangemax = 2.618;
var Global.motors = Group.new(motor6); for (17) motors.add(Motor.new);
var Global.sensor100 = Object.new;
var sensor100.IRCenter = 17;
class Global.Joint { var val = 0; var applied = 0.2; var limitedBy = ""; };
Joint.addProto(Interface.RotationalMotor);
var Global.motor7 = Joint.new;
var motor6.applied = 0.2; var motor6.limitedBy = "";
var Global.robot = Component.new("robot");
robot.addDevice("motor6", motor6); robot.addDevice("motor7", motor7);
var Global.camera = Object.new;
var camera.val = Binary.new("rgb 2 1", "abcdef");
"""
PRINTED = {
    "errors": "line and columns 2.5-11: lookup failed: nowhere\nFalse\n",
    "events": "claps: 2.0\n",
    "move_and_wait": "there: 0.3\n",
    "picture": "rgb 2 1 6\n",
    "react": "raised: True\n",
    "read_and_write": "0.5\n",
    "swing": "stopped\n",
    "threads": "seen: True\n",
    "with_asyncio": "0.25\n(0.25,)\n",
}


@pytest.fixture
def lan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lan]:
    made = Lan(tmp_path)
    for module, name in ((robot, "connect"), (aio, "connect")):
        monkeypatch.setattr(module, name, partial(getattr(module, name), port=made.plain_port, timeout=20))
    with urbihw.connect() as first:
        first.run(SETUP)
        yield made
    made.close()


def test_there_are_ten() -> None:
    assert len(EXAMPLES) == 10


@pytest.mark.parametrize("program", EXAMPLES, ids=lambda path: path.stem)
def test_example(program: Path, lan: Lan, capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(program), run_name="__main__")
    capsys.readouterr()
    runpy.run_path(str(program), run_name="__main__")  # nothing that it leaves behind hinders it
    out = capsys.readouterr().out
    if program.stem in PRINTED:
        assert out == PRINTED[program.stem]
    else:
        lines = out.splitlines()
        assert (len(lines), lines[-1], lines[0].split()[1:]) == (11, "lost: 0", ["0.000", "17.0"])


def test_the_dialogues_of_the_page_are_those_given(lan: Lan) -> None:
    failed, tried = doctest.testfile(
        str(ROOT / "docs" / "client.md"), module_relative=False, optionflags=doctest.ELLIPSIS
    )
    assert (failed, tried > 15) == (0, True)
