"""The kernel of Jupyter by a suite that others have made for kernels, and by what a notebook sees.  Real processes."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import jupyter_kernel_test
import pytest
from lan_server import Lan

from urbihw.neighbours.notebook.cells import completeness, plot_order, shown, shown_text
from urbihw.neighbours.notebook.spec import install

SETUP = """
class Global.Arm { var val = 0.25; var limited = false; function swing() { 1 }; };
var Global.arm = Arm.new; var Global.photo = Binary.new("rgb 2 1", "abcdef");
"""
COMPLETE = ("1", "1 + 1;", "echo(1);", "a: loop { 1 },", "%plot x", "", "// words")
INCOMPLETE = ("var x = {", "if (true)", "1 +", "/* a", '"abc', "f(1,", "[1,\n2", "if (true) 1 else")
INVALID = ("1 1", "}", "x = = 3", "1 +)")


@pytest.mark.parametrize(("status", "codes"), [
    ("complete", COMPLETE), ("incomplete", INCOMPLETE), ("invalid", INVALID),
])  # fmt: skip
def test_a_cell_is_complete_or_not(status: str, codes: tuple[str, ...]) -> None:
    assert {code: completeness(code) for code in codes} == dict.fromkeys(codes, status)


def test_values_are_shown_as_urbiscript_prints_them() -> None:
    values = [1.0, 0.1 + 0.2, 1e300, float("inf"), True, None, 'a "b"\n', [1.0, []], {"k": 2.0}, {}]
    assert [shown_text(value) for value in values] == [
        "1", "0.3", "1e+300", "inf", "true", "nil", r'"a \"b\"\n"', "[1, []]", '["k" => 2]', "[=>]",
    ]  # fmt: skip
    assert shown(1.0) == {"text/plain": "1"}


def test_an_order_to_plot() -> None:
    assert plot_order("%plot a.val b 10") == (("a.val", "b"), 10)
    assert plot_order("plot(1)") is None
    with pytest.raises(ValueError, match="a time of up to 600 s"):
        plot_order("%plot a 0")


@pytest.fixture(scope="module", autouse=True)
def notebook(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Lan]:
    """A server, and the specification of a kernel that uses it."""
    folder = tmp_path_factory.mktemp("jupyter")
    lan = Lan(folder)
    before = dict(os.environ)
    try:
        install(folder, "urbiscript", "urbiscript", f"127.0.0.1:{lan.plain_port}")
        os.environ["JUPYTER_PATH"] = str(folder)
        os.environ["IPYTHONDIR"] = str(folder)
        yield lan
    finally:
        os.environ.clear()
        os.environ.update(before)
        lan.close()


@pytest.mark.e2e
@pytest.mark.filterwarnings("default")  # those of Jupyter's own packages
class TestKernel(jupyter_kernel_test.KernelTests):  # type: ignore[misc]
    """The suite, and more."""

    kernel_name = "urbiscript"
    language_name = "urbiscript"
    file_extension = ".u"
    code_hello_world = 'echo("hello, world");'
    code_stderr = "detach({ nowhere })|; sleep(0.05s);"
    code_generate_error = "1 + nowhere"
    code_execute_result: ClassVar[list[dict[str, str]]] = [
        {"code": "1 + 1", "result": "2"}, {"code": "arm.val", "result": "0.25"},
        {"code": '"a" + "b";', "result": '"ab"'}, {"code": "photo", "mime": "image/png"},
    ]  # fmt: skip
    code_display_data: ClassVar[list[dict[str, str]]] = [{"code": "%plot arm.val 0.2", "mime": "image/svg+xml"}]
    completion_samples: ClassVar[list[dict[str, Any]]] = [
        {"text": "arm.lim", "matches": {"limited"}}, {"text": "arm.swing.x", "matches": set()},
        {"text": '"arm.lim', "matches": set()},
    ]  # fmt: skip
    complete_code_samples = COMPLETE
    incomplete_code_samples = INCOMPLETE
    invalid_code_samples = INVALID
    code_inspect_sample = "sleep"

    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        cls.kc.execute_interactive(SETUP, timeout=30)

    def test_echo_belongs_to_its_cell(self) -> None:
        for word in ("first", "second", "third"):
            self.flush_channels()
            _, output = self.execute_helper(f'echo("{word}");')
            assert [message["content"]["text"] for message in output] == [f"*** {word}\n"]

    def test_an_error_names_its_place_in_the_cell(self) -> None:
        self.flush_channels()
        reply, _ = self.execute_helper("1;\n 2 + nowhere")
        assert reply["content"]["evalue"] == "2.6-12: lookup failed: nowhere"

    def test_an_interrupt_stops_a_cell_and_what_it_has_in_the_background(self) -> None:
        self.execute_helper("var Global.beats = 0|; loop { beats += 1; sleep(10ms) },")
        interrupt = threading.Timer(0.5, self.km.interrupt_kernel)
        interrupt.start()
        self.kc.execute("loop { sleep(10ms) }")
        reply = self.kc.get_shell_msg(timeout=20)
        interrupt.join()
        assert reply["content"]["ename"] == "Interrupted"
        assert self.value("beats") > 0
        standing = self.value("beats")
        time.sleep(0.2)
        assert self.value("beats") == standing

    def value(self, code: str) -> float:
        self.flush_channels()
        _, output = self.execute_helper(code)
        return float(json.loads(output[0]["content"]["data"]["text/plain"]))




def test_the_specification_is_written_below_a_data_folder_of_jupyter(tmp_path: Path) -> None:
    told = json.loads(install(tmp_path, "arm", "The arm", "robot:54000").read_text())
    assert told["interrupt_mode"] == "message" and told["env"] == {"URBIHW_ADDRESS": "robot:54000"}
