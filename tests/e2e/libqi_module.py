"""A client of a real libqi that offers a service to the Nao at a url, until its input ends: see ``test_nao_foreign``.

The second argument, if any, is the end point at which it listens; without one libqi chooses.
"""

from __future__ import annotations

import sys
from typing import Any

import qi


class Module:
    """A service that tells what it is asked."""

    def add(self, one: Any, other: Any) -> Any:
        return one + other

    def boom(self) -> None:
        raise ValueError("no")

    @qi.bind(qi.Void, [qi.String, qi.Dynamic, qi.String], "onEvent")  # type: ignore[untyped-decorator]
    def on_event(self, key: str, value: Any, message: str) -> None:
        print("told event", key, value, message, flush=True)


session = qi.Session()
session.connect(sys.argv[1])
if len(sys.argv) > 2:
    session.listen(sys.argv[2])
number = session.registerService("mathematics", Module())
session.service("ALMemory").subscribeToEvent("tick", "mathematics", "text", "onEvent")
print("told ready", flush=True)
for line in sys.stdin:
    if line == "leave\n":
        session.unregisterService(number)
        print("told left", flush=True)
# Without this the process may crash at its end.
session.close()
