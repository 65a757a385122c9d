"""A fork of the template is like a start of its own: see `tests/starts.py`."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import starts

URBIHW = (sys.executable, "-m", "urbihw.cli.main")
TIMEOUT_S = 60.0


@pytest.mark.parametrize("words", [("--version",), ("nonsense",), ("config", "show", "--platform", "nxt"), ("status",)])
def test_a_program_that_ends_says_and_returns_the_same(words: tuple[str, ...], tmp_path: Path) -> None:
    options: dict[str, Any] = {
        "capture_output": True, "text": True, "cwd": tmp_path, "env": {**os.environ, "XDG_RUNTIME_DIR": str(tmp_path)},
    }  # fmt: skip
    forked, started = starts.run((*URBIHW, *words), **options), subprocess.run((*URBIHW, *words), **options)
    assert (forked.returncode, forked.stdout, forked.stderr) == (started.returncode, started.stdout, started.stderr)


def test_a_server_has_the_same_descriptors_signals_session_and_folder(tmp_path: Path) -> None:
    seen = []
    for start in (starts.Forked, subprocess.Popen):
        command = (sys.executable, "-m", "urbihw.cli.urbi", "--quiet", "--port", "0")
        with start(
            (*command, "-e", 'echo("here"); System.getenv("WHAT");'), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            cwd=tmp_path, start_new_session=True, env={**os.environ, "WHAT": "lamp"},
        ) as server:  # fmt: skip
            try:
                assert server.stdout is not None
                said = [re.sub(rb"\[\d+\] ", b"", server.stdout.readline()) for _ in range(2)]
                folder = Path(f"/proc/{server.pid}")
                kinds = sorted(re.sub(r"\d+|:.*", "", os.readlink(each)) for each in (folder / "fd").iterdir())
                status = re.findall(r"Sig(?:Blk|Ign|Cgt):\s*\w+|Threads:\s*\d+", (folder / "status").read_text())
                seen.append((said, kinds, status, os.getsid(server.pid) == server.pid, os.readlink(folder / "cwd")))
            finally:
                server.terminate()
            assert server.wait(TIMEOUT_S) == 0
    assert seen[0] == seen[1]


def test_what_the_template_cannot_do_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"wants subprocess\.Popen"):
        starts.Forked((sys.executable, "-c", "pass"))
    with pytest.raises(ValueError, match=r"wants subprocess\.Popen"):
        starts.Forked((*URBIHW, "--version"), pass_fds=[0])
