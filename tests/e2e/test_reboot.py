"""``reboot``: the same server with the same arguments, anew."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from urbihw.cli.server import UrbiProgram, UrbiSettings

PROGRAM = """
if (Path.new("lived").exists)
  { cout << System.arguments | shutdown }
else
  { File.save("lived", "") | cout << "first" | var Global.seen = 1 | reboot };
"""


def test_a_server_starts_itself_anew_with_the_same_arguments(tmp_path: Path) -> None:
    (tmp_path / "program.u").write_text(PROGRAM)
    command = [sys.executable, "-m", "urbihw.cli.urbi", "-q", "-P", "0", "program.u", "a", "b"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    said = [line.partition("] ")[2] for line in done.stdout.splitlines()]
    assert (said, done.stderr, done.returncode) == (['"first"', '["a", "b"]'], "", 0)


async def _reboot_and_signal(number: int | None) -> UrbiProgram:
    program = UrbiProgram(UrbiSettings(texts=(b"reboot;\n",), quiet=True))
    await program.run()
    if number is not None:
        os.kill(os.getpid(), number)
    await program.close()
    return program


@pytest.mark.parametrize(("number", "again"), [(None, True), (signal.SIGTERM, False)])
def test_a_signal_during_the_shutdown_prevents_the_new_start(number: int | None, again: bool) -> None:
    assert asyncio.run(_reboot_and_signal(number)).again is again
