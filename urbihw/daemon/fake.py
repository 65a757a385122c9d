"""A robot in software in a process of its own: ``urbihw serve --fake``."""

from __future__ import annotations

import asyncio
import contextlib
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from urbihw.kernel.uobject import NotReady

_PATIENCE = 10.0
PACKAGE = "urbihw_fakes"
"""What ``python -m`` runs; nothing of it is imported here."""


def _home_of_fakes() -> str:
    """The folder that holds the package of the fakes: beside this one, or in the tree of the sources in ``fakes``."""
    root = Path(__file__).resolve().parents[2]
    return str(root if (root / PACKAGE).is_dir() else root / "fakes")


class Fake:
    """A running ``python -m urbihw_fakes``; it ends when its standard input does, so it cannot outlive us."""

    def __init__(self, arguments: Sequence[str]) -> None:
        # It must be the fakes of this very installation, wherever it was imported from.
        path = os.pathsep.join(filter(None, (_home_of_fakes(), os.environ.get("PYTHONPATH"))))
        self._process = subprocess.Popen(
            (sys.executable, "-m", PACKAGE, *arguments),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": path},
            # Ctrl-C must reach us alone: the robot is stopped first, and a fake that is gone cannot be.
            start_new_session=True,
        )

    async def url(self) -> str:
        """The url to reach it by, once it serves.  Raises NotReady."""
        stdout = self._process.stdout
        assert stdout is not None
        try:
            line = await asyncio.wait_for(asyncio.to_thread(stdout.readline), _PATIENCE)
        except TimeoutError:
            raise NotReady(f"the fake robot (process {self._process.pid}) did not start") from None
        if not line:
            raise NotReady("the fake robot did not start; its own message stands above")
        return line.decode().strip()

    def close(self) -> None:
        """End it; twice is fine."""
        process = self._process
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        try:
            process.wait(1.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
