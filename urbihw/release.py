"""The version of urbihw that is installed.

``importlib.metadata`` tells it, too, but imports the library for e-mails first, which takes longer than all else that
``urbihw --version`` does.
"""

from __future__ import annotations

import os
import sys


def installed_version() -> str:
    """The version, such as ``0.2.0``; "" if urbihw is not installed but only found on the path."""
    for folder in sys.path:
        try:
            names = os.listdir(folder or ".")
        except OSError:  # a zip file, or a folder that is not there
            continue
        for name in names:
            if name.startswith("urbihw-") and name.endswith((".dist-info", ".egg-info")):
                return name[len("urbihw-") :].rpartition(".")[0]
    return ""
