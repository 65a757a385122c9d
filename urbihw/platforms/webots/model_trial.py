"""Load a model with bounds: ``python -m urbihw.platforms.webots.model_trial PATH``, started by ``model_check``.

The exit status is 0 for a model that can be loaded; else the last line of the output tells why not.
"""

from __future__ import annotations

import os
import resource
import sys
from pathlib import Path
from typing import Final

from urbihw.platforms.scene.library import NoMujoco
from urbihw.platforms.webots.model_check import PROCESSOR_S, REFUSED
from urbihw.platforms.webots.mujoco_world import BadModel, MujocoWorld

MEMORY_SHARE: Final = 0.5
"""Largest memory of a model, as a share of the machine's."""


def main(arguments: list[str]) -> int:
    """Run the process; returns the exit status."""
    memory = int(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") * MEMORY_SHARE)
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    # The worker may have been killed meanwhile: nothing else would end this process.
    resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_S, PROCESSOR_S + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        MujocoWorld(Path(arguments[0])).close()
    except BadModel as error:
        print(error)
        return REFUSED
    except MemoryError:
        print(f"{arguments[0]}: it needs more than half of the memory; make it smaller (bodies, meshes)")
        return REFUSED
    except NoMujoco:
        return 0
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
