"""Whether a model can be loaded, tried in a process of its own (``model_trial``).

A model is a program for MuJoCo's compiler: a few lines of it can ask for more memory than there is, or for hours.  The
worker must not hang or die of it, so a model that is not ours is first loaded there, with bounds.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Final

PROCESSOR_S: Final = 6
"""Seconds of processor that a model may take, MuJoCo's own start included: a busy machine does not decide."""
TIMEOUT_S: Final = 15.0
"""Seconds that it may take by the clock: less than the silence for which the worker has leave."""
REFUSED: Final = 1
"""The exit status of the trial for a model that cannot be loaded."""


def reason_against(path: Path) -> str:
    """Try to load a model; why it cannot be had, in one line, "" if it can."""
    root = str(Path(__file__).resolve().parents[3])
    path_of_modules = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    try:
        done = subprocess.run(
            (sys.executable, "-m", "urbihw.platforms.webots.model_trial", str(path)), timeout=TIMEOUT_S, check=False,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, encoding="utf-8",
            env={**os.environ, "PYTHONPATH": path_of_modules, "PYTHONIOENCODING": "UTF-8", "MUJOCO_GL": "disable"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return _too_long(path)
    if done.returncode == 0:
        return ""
    if done.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return _too_long(path)
    said = done.stdout.strip().splitlines()
    if done.returncode == REFUSED and said:
        return said[-1]
    return f"{path}: MuJoCo fails on it, or needs more than half of the memory; make it smaller (bodies, meshes)"


def _too_long(path: Path) -> str:
    return f"{path}: it takes longer than {PROCESSOR_S} s to load; make it smaller (bodies, meshes)"
