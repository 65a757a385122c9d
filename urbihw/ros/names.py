"""Names of nodes, topics and services."""

from __future__ import annotations

import os
import random
import re
from typing import Final

from urbihw.ros.errors import RosError

MAX_NAME_LENGTH: Final = 255
_NAME: Final = re.compile(r"[A-Za-z0-9/_]+", re.ASCII)


def checked_name(name: str) -> str:
    """The name with ``/`` first.  Raises RosError for other signs than letters, digits, ``/`` and ``_``."""
    if _NAME.fullmatch(name) is None or len(name) > MAX_NAME_LENGTH:
        raise RosError(f"invalid name {name[:80]!r}: letters, digits, / and _ only")
    return "/" + name.strip("/")


def own_address() -> str:
    """The address on which a node of this process listens: ``ROS_IP``, ``ROS_HOSTNAME``, else the loopback one."""
    return os.environ.get("ROS_IP") or os.environ.get("ROS_HOSTNAME") or "127.0.0.1"


def unique_name(base: str) -> str:
    """A name that no other node has: a node of the same name would be ended by the master."""
    return f"/{base}_{random.SystemRandom().randrange(10**18, 10**19)}"
