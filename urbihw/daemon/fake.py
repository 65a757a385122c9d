"""A simulated robot in a process of its own: ``urbihw serve --fake``."""

from __future__ import annotations

import asyncio
import contextlib
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from urbihw.kernel.uobject import NotReady

_START_TIMEOUT_S = 10.0
PACKAGE = "urbihw_fakes"
"""The package that ``python -m`` runs; it is never imported here."""


def _home_of_fakes() -> str:
    """The folder that contains the package of the fakes: the one of this package, or ``fakes`` in the source tree."""
    root = Path(__file__).resolve().parents[2]
    return str(root if (root / PACKAGE).is_dir() else root / "fakes")


class Fake:
    """A running ``python -m urbihw_fakes``.  It ends with its standard input, so it cannot outlive the daemon."""

    def __init__(self, arguments: Sequence[str]) -> None:
        # It must be the fakes of this installation, wherever that was imported from.
        path = os.pathsep.join(filter(None, (_home_of_fakes(), os.environ.get("PYTHONPATH"))))
        self._process = subprocess.Popen(
            (sys.executable, "-m", PACKAGE, *arguments),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": path},
            # Ctrl-C must reach the daemon alone, which stops the robot first; a fake that has ended cannot be stopped.
            start_new_session=True,
        )

    async def url(self) -> str:
        """The url of the simulated robot, once it serves.  Raises NotReady."""
        stdout = self._process.stdout
        assert stdout is not None
        try:
            line = await asyncio.wait_for(asyncio.to_thread(stdout.readline), _START_TIMEOUT_S)
        except TimeoutError:
            raise NotReady(f"the fake robot (process {self._process.pid}) did not start") from None
        if not line:
            raise NotReady("the fake robot did not start; its own message stands above")
        return line.decode().strip()

    def close(self) -> None:
        """End the process.  A second call does nothing."""
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
