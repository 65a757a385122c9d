"""Announces the port of a daemon in the network by multicast DNS (RFC 6762, RFC 6763), for ``urbihw find``.

The service type is ``_urbi._tcp``; the TXT record has ``platform``, ``version`` and ``tls`` (1 or 0).  Needs the extra
``find``.  The announcement is withdrawn when the daemon ends.
"""

from __future__ import annotations

import ipaddress
import logging
import socket
import threading
from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from urbihw.release import installed_version

if TYPE_CHECKING:
    from zeroconf import ServiceInfo, Zeroconf

log = logging.getLogger("urbihw.daemon")

SERVICE_TYPE: Final = "_urbi._tcp.local."
MAX_NAME_BYTES: Final = 63
"""Longest label of a DNS name (RFC 1035)."""
_END_TIMEOUT_S: Final = 3.0


def reachable(addresses: Iterable[str]) -> list[str]:
    """The addresses that other machines reach; ``0.0.0.0`` and ``::`` stand for all of this machine."""
    found: dict[str, None] = {}
    for text in addresses:
        address = ipaddress.ip_address(text.partition("%")[0])
        if address.is_unspecified:
            found |= dict.fromkeys(_own_addresses())
        elif not address.is_loopback:
            found[text] = None
    return list(found)


def service_name(platform: str, port: int, machine: str) -> str:
    """The name under which a robot is listed, such as ``bioloid-54000 on lab``."""
    return f"{platform}-{port} on {machine.partition('.')[0]}".encode()[:MAX_NAME_BYTES].decode("utf-8", "ignore")


class Announcement:
    """The announcement of one port; made and withdrawn in a thread, since each takes a second or two."""

    def __init__(self, platform: str, port: int, addresses: Iterable[str], *, tls: bool) -> None:
        """Raises ImportError without the package."""
        import zeroconf  # noqa: F401

        self._platform, self._port, self._addresses, self._tls = platform, port, list(addresses), tls
        self._network: Zeroconf | None = None
        self._thread = threading.Thread(target=self._announce, name="announce", daemon=True)

    def start(self) -> None:
        """Begin to announce the server on the network."""
        self._thread.start()

    def close(self) -> None:
        """Withdraw the announcement from the network."""
        self._thread.join(_END_TIMEOUT_S)
        network = self._network
        if network is not None:
            ending = threading.Thread(target=network.close, daemon=True)
            ending.start()
            ending.join(_END_TIMEOUT_S)

    def _announce(self) -> None:
        from zeroconf import Error, IPVersion, Zeroconf

        try:
            self._network = network = Zeroconf(ip_version=IPVersion.V4Only)
            network.register_service(self._service(), allow_name_change=True)
        except (OSError, Error) as error:
            log.error("the robot is not announced in the network: %s", getattr(error, "strerror", "") or error)

    def _service(self) -> ServiceInfo:
        from zeroconf import ServiceInfo

        machine = socket.gethostname()
        return ServiceInfo(
            SERVICE_TYPE,
            f"{service_name(self._platform, self._port, machine)}.{SERVICE_TYPE}",
            port=self._port,
            parsed_addresses=self._addresses,
            properties={"platform": self._platform, "version": installed_version(), "tls": "1" if self._tls else "0"},
            server=f"{machine.partition('.')[0]}.local.",
        )


def _own_addresses() -> list[str]:
    import ifaddr  # comes with zeroconf

    found = [str(each.ip) for adapter in ifaddr.get_adapters() for each in adapter.ips if each.is_IPv4]
    return [text for text in found if not ipaddress.ip_address(text).is_loopback]
