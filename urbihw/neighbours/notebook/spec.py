"""The kernel specification, by which Jupyter finds the kernel: a folder with ``kernel.json``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, Final

ADDRESS: Final = "URBIHW_ADDRESS"
"""The variable with the address of the daemon."""


def kernel_spec(title: str, address: str) -> dict[str, Any]:
    """The specification of a kernel for a daemon, in this environment of Python."""
    return {
        "argv": [sys.executable, "-m", "urbihw.neighbours.notebook", "-f", "{connection_file}"],
        "display_name": title,
        "language": "urbiscript",
        "interrupt_mode": "message",
        "env": {ADDRESS: address},
    }


def install(folder: Path, name: str, title: str, address: str) -> Path:
    """Write the specification below ``folder``, a data folder of Jupyter; the file.  Raises OSError."""
    file = folder / "kernels" / name / "kernel.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(kernel_spec(title, address), indent=1) + "\n", encoding="utf-8")
    return file
