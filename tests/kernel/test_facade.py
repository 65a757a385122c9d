"""The kernel's door: handshake, feeding, running."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.facade import Library
from urbihw.kernel.sched.clock import SimClock


class SlowMachine(SimClock):
    """Something else has the processor before every second round, for longer than a run may take."""

    _busy = False

    def round(self) -> float:
        """The present time."""
        self._busy = not self._busy
        if self._busy:
            self.advance(0.01)
        return super().round()


def test_the_library_is_complete_however_slow_the_machine_is() -> None:
    kernel = Kernel(SlowMachine())
    assert not kernel.scheduler.jobs


def test_a_connection_is_greeted_with_the_ten_lines_of_the_protocol() -> None:
    kernel = Kernel(fast=True)
    kernel.programs.quiet = False
    lines = kernel.open_lobby("127.0.0.1").output.take_bytes().decode().splitlines()
    texts = [re.sub(r"^\[\d{8}\] ", "", line) for line in lines]
    assert len(texts) == 10
    assert texts[0] == texts[-1] == "*** " + "*" * 56
    assert re.match(r"\*\*\* urbihw \d", texts[1])
    assert all(text.startswith("*** ") or text == "***" for text in texts)


def test_a_quiet_one_says_nothing() -> None:
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby("127.0.0.1")
    kernel.run()
    assert lobby.output.take_bytes() == b""


def test_bytes_may_be_cut_anywhere() -> None:
    kernel = Kernel(fast=True)
    lobby = kernel.open_lobby()
    for byte in b'var x = "a;b"; x.size;':
        kernel.feed(lobby, bytes([byte]))
        kernel.run()
    assert lobby.output.take_bytes() == b'[00000000] "a;b"\n[00000000] 3\n'


def test_the_last_objects_of_a_closed_kernel_begin_no_jobs() -> None:
    kernel = Kernel(fast=True)
    kernel.run_text(kernel.open_lobby(), "var Global.last = Finalizable.new|;")
    kernel.close()
    del kernel.world.global_.slots["last"]
    assert not kernel.scheduler.jobs


def test_a_kernel_has_the_libraries_that_it_was_given(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "gardens"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "garden.py").write_text(
        '"""Garden: what grows."""\n'
        "from urbihw.kernel.library import Table\n"
        'TABLE = Table("Garden")\n'
        '@TABLE.primitive("beds")\n'
        "def beds(world, this):\n"
        '    """The number of beds."""\n'
        "    return 3.0\n"
    )
    (folder / "garden.u").write_text("// Twice the beds.\nfunction Garden.twice() { 2 * beds };\n")
    monkeypatch.syspath_prepend(tmp_path)
    kernel = Kernel(fast=True, libraries=[Library("gardens", ("garden",))])
    lobby = kernel.open_lobby()
    assert kernel.run_text(lobby, "Garden.twice;") == "[00000000] 6\n"
    assert kernel.run_text(lobby, 'System.documentation(Garden, "twice");') == '[00000000] "Twice the beds."\n'
    assert kernel.run_text(lobby, 'System.documentation(Global, "Garden");') == '[00000000] "what grows."\n'
    without = Kernel(fast=True)
    assert without.run_text(without.open_lobby(), 'Global.hasSlot("Garden");') == "[00000000] false\n"
