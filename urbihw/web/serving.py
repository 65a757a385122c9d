"""Listens for browsers and serves them until the process is told to stop."""

from __future__ import annotations

import contextlib
import logging
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from urbihw.client.where import is_loopback
from urbihw.daemon.kept_work import run_until_told
from urbihw.daemon.state import write_secret
from urbihw.web.connections import accepting
from urbihw.web.gateway import Gateway
from urbihw.web.settings import WebSettings

log = logging.getLogger("urbihw.web")

_SOMEWHERE: Final = ("192.0.2.1", 9)
"""An address of TEST-NET-1 (RFC 5737): a datagram socket that is connected to it tells the own address; nothing is
sent."""


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens.  Raises OSError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    found = socket.getaddrinfo(host, port, family, socket.SOCK_STREAM, 0, socket.AI_PASSIVE)
    return socket.create_server(found[0][4][:2], family=family, backlog=64)


def address_of(settings: WebSettings, port: int) -> str:
    """The address that users type, such as ``http://127.0.0.1:54080``."""
    host = settings.host
    if host in ("0.0.0.0", "::", ""):
        host = _own_address() or f"{socket.gethostname()}.local"
    shown = f"[{host}]" if ":" in host else host
    return f"{'https' if settings.tls is not None else 'http'}://{shown}:{port}"


async def serve(
    settings: WebSettings,
    listener: socket.socket,
    ready: Callable[[str, Gateway], None],
    *,
    ends_with_input: bool = False,
) -> None:
    """Serve until SIGTERM or SIGINT, or the end of standard input, a pipe of the daemon that must not be outlived.

    ``ready`` is called with the address when browsers can connect.
    """
    logging.getLogger("aiohttp").setLevel(logging.CRITICAL)
    port = listener.getsockname()[1]
    gateway = Gateway(settings, port)
    address = address_of(settings, port)
    async with accepting(gateway.app, listener, settings.tls):
        try:
            with _published(settings.folder / f"panel-{port}", address):
                if settings.port_file is not None:
                    write_secret(settings.port_file, f"{port}\n")
                ready(address, gateway)
                await run_until_told(gateway.run(), ends_with_input=ends_with_input)
        finally:
            await gateway.close()


@contextlib.contextmanager
def _published(file: Path, address: str) -> Iterator[None]:
    """The address in a file, for ``urbihw panel pair``."""
    write_secret(file, f"{address}\n")
    try:
        yield
    finally:
        file.unlink(missing_ok=True)


def _own_address() -> str:
    """The address of this machine that faces the network; "" without one."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, contextlib.suppress(OSError):
        probe.connect(_SOMEWHERE)
        host = str(probe.getsockname()[0])
        return "" if is_loopback(host) else host
    return ""
