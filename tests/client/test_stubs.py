"""``urbihw stubs``: a typed module from the tree of a robot."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from urbihw.client.stubs import stubs_text

REPOSITORY = Path(__file__).resolve().parents[2]


def _slot(name: str, kind: str = "number", **more: Any) -> dict[str, Any]:
    return {"name": name, "kind": kind, "unit": "", "min": None, "max": None, "meaning": "", "readable": True,
            "writable": True, "effector": False} | more


MOTOR = [
    _slot("val", unit="rad", min=-1.5, max=1.5, meaning='the "angle"'),
    _slot("temperature", unit="degC", writable=False),
    _slot("readRegister", "function", readable=False, writable=False),
    _slot("from"), _slot("absent", readable=False, writable=False), _slot("camera", "binary", writable=False),
]  # fmt: skip
TREE = {
    "platform": {"name": "toy"},
    "robot": {"name": "robot", "global": "robot", "class": "humanoid", "slots": [_slot("stop", "function")], "parts": [
        {"name": "body", "global": "", "class": "Component", "parts": [
            {"name": "joint", "global": "motor1", "class": "AX12", "slots": MOTOR, "parts": []},
            {"name": "joint", "global": "motor2", "class": "AX12", "slots": MOTOR, "parts": []},
            {"name": "joint", "global": "motor3", "class": "AX12", "slots": MOTOR[:1], "parts": []},
            {"name": "odd", "global": "class", "class": "1-2", "slots": [], "parts": []},
        ]},
    ]},
    "groups": [{"name": "motors", "members": []}],
}  # fmt: skip


def test_devices_of_a_kind_share_a_class_with_their_slots() -> None:
    made: dict[str, Any] = {}
    exec(compile(stubs_text(json.dumps(TREE)), "toy.py", "exec", dont_inherit=True), made)
    assert made["ToyRobot"].__annotations__ == {
        "robot": "Humanoid", "motor1": "AX12", "motor2": "AX12", "motor3": "AX122", "motors": "UrbiObject",
    }  # fmt: skip
    motor = made["AX12"]
    assert motor.__annotations__ == {"val": "float", "readRegister": "UrbiFunction"}
    assert motor.temperature.fget.__annotations__ == {"return": "float"}
    assert motor.temperature.fset is None
    assert motor.camera.fget.__annotations__ == {"return": "Blob"}
    assert not hasattr(motor, "absent")


def test_a_meaning_cannot_leave_its_string() -> None:
    tree = {"robot": {"global": "robot", "class": 'a"""b', "slots": [_slot("val", meaning='"""\nimport os\n"""\\')]}}
    made: dict[str, Any] = {}
    exec(compile(stubs_text(json.dumps(tree)), "toy.py", "exec", dont_inherit=True), made)
    assert "os" not in made


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"robot": 3}', "nothing"])
def test_any_other_text_is_refused(text: str) -> None:
    with pytest.raises(ValueError):
        stubs_text(text)


@pytest.mark.long
def test_a_type_checker_knows_the_slots(tmp_path: Path) -> None:
    (tmp_path / "toy.py").write_text(stubs_text(json.dumps(TREE)))
    (tmp_path / "use.py").write_text(
        "from toy import connect\nrobot = connect()\nx: float = robot.motor1.val\nrobot.motor1.temperature = 4\n"
    )
    (tmp_path / "mypy.ini").write_text("[mypy]\nstrict = True\nignore_missing_imports = True\n")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", "mypy.ini", "use.py"], cwd=tmp_path, text=True,
        capture_output=True, env={"MYPYPATH": f"{REPOSITORY}:{tmp_path}", "PATH": ""}, check=False,
    )  # fmt: skip
    assert "use.py:4: error: Property" in done.stdout, done
    assert "use.py:3" not in done.stdout
