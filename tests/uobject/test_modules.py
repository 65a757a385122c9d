"""Modules of devices, and those that cannot be loaded."""

from __future__ import annotations

from pathlib import Path

import pytest
from uobject_console import Console

from urbihw.kernel.uobject import (
    BadConfig,
)

GOOD = '''
from urbihw.kernel.uobject import UObject, function
from neighbour import WORD

class Greeter(UObject):
    @function
    def greet(self) -> str:
        return WORD

class _Hidden(UObject): pass
'''


def test_loading_a_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "neighbour.py").write_text("WORD = 'hello'")
    (tmp_path / "greeter.py").write_text(GOOD)
    monkeypatch.setenv("URBI_UOBJECT_PATH", f"/nowhere:{tmp_path}:")
    console = Console()
    assert console.say('loadModule("greeter"); Greeter.new.greet; uobjects.hasSlot("_Hidden");') == ['"hello"', "false"]
    assert console.say('loadModule("greeter"); Greeter.new.greet;') == ['"hello"']


@pytest.mark.parametrize(("text", "message"), [
    ("x = (", r"bad.py does not import: line 1: SyntaxError: '\(' was never closed"),
    ("import sys\n\n1 / 0", r"bad.py does not import: line 3: ZeroDivisionError: division by zero"),
    ("import nothing_like_this", r"line 1: ModuleNotFoundError: No module named 'nothing_like_this'"),
    ("raise SystemExit(3)", r"line 1: SystemExit: 3"),
    ("x = 1", r"bad.py defines no class derived from UObject"),
    ("__uobjects__ = (int,)", r"<class 'int'> in __uobjects__ is no class derived from UObject"),
])
def test_a_module_that_does_not_import_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, message: str
) -> None:
    (tmp_path / "bad.py").write_text(text)
    monkeypatch.setenv("URBI_UOBJECT_PATH", str(tmp_path))
    console = Console()
    with pytest.raises(BadConfig, match=message) as caught:
        console.host.load_module("bad")
    assert "\n" not in str(caught.value)
    assert "loadModule: module " in console.say('loadModule("bad");')[0]
    assert console.say("1;") == ["1"]


def test_a_module_that_is_not_there(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URBI_UOBJECT_PATH", "/a:/b")
    with pytest.raises(BadConfig, match="module nix not found in /a, /b: set URBI_UOBJECT_PATH"):
        Console().host.load_module("nix")


def test_the_factory_of_the_quick_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URBI_UOBJECT_PATH", str(Path(__file__).parents[2] / "docs" / "examples"))
    console = Console()
    console.say('loadModule("factory"); var slow = UFactory.new(20ms)|; var fast = UFactory.new(1ms)|;')
    console.lobby.feed(b'echo(slow.assemble(["1", "2", "3"])), echo(fast.assemble(["4"])),')
    assert console.wait(2) == ["*** 4", "*** 123"]
    assert console.say("UFactory.new(-1);")[0].endswith("new: a machine cannot be that fast")
    refusal = "assemble: unexpected nil for argument 1, expected a String"
    assert console.say("fast.assemble([nil]);")[0].endswith(refusal)


TWO_MACHINES = """
class TwoMachineFactory
{
  var UFactory = uobjects.UFactory;
  function init(fast = 1ms, slow = 30ms)
  {
    if (slow < fast)
      [fast, slow] = [slow, fast];
    var this.fastMachine = UFactory.new(fast);
    var this.slowMachine = UFactory.new(slow);
  };
  function assemble(input)
  {
    var res;
    if (5 < input.size)
      { res = slowMachine.assemble(input); echo("Used the slow machine") }
    else
      { res = fastMachine.assemble(input); echo("Used the fast machine") } |
    res
  };
}|;
var f = TwoMachineFactory.new|;
"""


def test_the_two_machines_of_the_quick_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("URBI_UOBJECT_PATH", str(Path(__file__).parents[2] / "docs" / "examples"))
    console = Console()
    console.host.load_module("factory")
    assert console.say(TWO_MACHINES) == []
    console.lobby.feed(b"f.assemble([1, 2, 3, 4, 5, 6]); f.assemble([1]);")
    assert console.wait(4) == ["*** Used the slow machine", '"123456"', "*** Used the fast machine", '"1"']
    console.lobby.feed(b"f.assemble([1, 2, 3, 4, 5, 6]), f.assemble([1]),")
    assert console.wait(2) == ["*** Used the fast machine", "*** Used the slow machine"]
