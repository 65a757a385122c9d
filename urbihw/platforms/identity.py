"""Name, model, serial number and network address of a robot, in the same words for all (manual, chapter 22, "Identity"
and "Network").

The slots belong to the object of the platform (``nxt``, ``P3dx``); the tree ``robot`` shares them (``identify`` in
``component.u``), so that both always tell the same.
"""

from __future__ import annotations

import socket
import threading
from typing import Final
from urllib.parse import urlsplit

from urbihw.kernel.uobject import DevicePart, UObject, reading
from urbihw.settings import is_address

NETWORK_SCHEMES: Final = frozenset({"socket", "spykee", "qi", "qis", "libqi", "libqis"})
"""Schemes of bus urls whose host is the robot, or what connects it to the network."""
LOOPBACK: Final = "127.0.0.1"
_ELSEWHERE: Final = ("192.0.2.1", 9)
"""An address that is never used (RFC 5737): only the route to it is looked up."""


class RobotIdentity(DevicePart):
    """The slots of Identity and Network of one robot."""

    name_ = reading("", "name")
    model = reading("")
    serial = reading("")
    IP = reading("")

    def __init__(self, device: UObject, name: str, model: str) -> None:
        """``name`` and ``model`` are those of a robot that tells none."""
        super().__init__(device)
        self._default_name, self._default_model = name, model

    def show(self, *, name: str = "", model: str = "", serial: str = "") -> None:
        """Show what the robot tells of itself; an unknown serial number is empty."""
        self.name_.sense(name or self._default_name)
        self.model.sense(model or self._default_model)
        self.serial.sense(serial)

    def show_address(self, url: str) -> None:
        """Show the address of the robot at this url; without a network of its own, that of this computer."""
        parts = urlsplit(url)
        if parts.scheme not in NETWORK_SCHEMES:
            self.device.notify_access(self.IP, lambda: self.IP.sense(own_address()))
            return
        host = parts.hostname or ""
        if not host or is_address(host):
            self.IP.sense(host)
            return
        # The name service may take seconds.
        threading.Thread(target=self._look_up, args=(host,), name="address", daemon=True).start()

    def _look_up(self, host: str) -> None:
        try:
            found = str(socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)[0][4][0])
        except (OSError, UnicodeError):
            return
        self.host.post(lambda: self.IP.sense(found))


def own_address() -> str:
    """The address of this computer on its network; that of the loopback where there is none.  Sends nothing."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(_ELSEWHERE)
        except OSError:
            return LOOPBACK
        return str(probe.getsockname()[0])
