"""The access policy of the TCP port: plain connections from this machine, TLS with tokens from others.

Clients on this machine need no authentication.  An address that other machines can reach requires TLS and tokens,
unless ``allow_plain`` allows every client to do everything.
"""

from __future__ import annotations

import ipaddress
import logging
from collections.abc import Iterable, Iterator
from pathlib import Path
from ssl import SSLContext

from urbihw.daemon import tls
from urbihw.daemon.access import CREDENTIAL, Authenticator, TokenHandshake, Tokens
from urbihw.daemon.config import Config
from urbihw.daemon.state import credential, state_folder
from urbihw.frozen import frozen
from urbihw.kernel.server.connection import LobbyConnection
from urbihw.kernel.server.handshake import HandshakeFactory, HandshakeRefusal, PlainHandshake, line
from urbihw.kernel.uobject import BadConfig
from urbihw.started import as_typed

log = logging.getLogger("urbihw.access")


@frozen(slots=False)
class AccessPolicy:
    """The requirements for clients that connect by TCP.

    Attributes:
        handshake: makes the handshake of each connection.
        ssl: the context for TLS; None for plain TCP.
        authenticator: checks the tokens; None without authentication.
        files: the certificate and its key; None without TLS.
    """

    handshake: HandshakeFactory = PlainHandshake
    ssl: SSLContext | None = None
    authenticator: Authenticator | None = None
    files: tls.Files | None = None

    def problems(self) -> Iterator[str]:
        """Check the files of tokens, certificate and key; yields a line for each one that cannot be used.

        Open connections stay open.  Changed tokens take effect at once, a changed certificate at the next start.
        """
        if self.authenticator is not None:
            try:
                self.authenticator.check()
            except BadConfig as error:
                yield f"no token is accepted until this is mended: {error}"
        if self.files is not None:
            try:
                tls.context(self.files)
            except BadConfig as error:
                yield f"the certificate stays as it was: {error}"

    def disconnect_removed(self, connections: Iterable[LobbyConnection]) -> None:
        """Disconnect clients whose token has been removed since their login."""
        if self.authenticator is None:
            return
        holders = {
            connection: connection.handshake.entry
            for connection in connections
            if isinstance(connection.handshake, TokenHandshake) and connection.handshake.entry is not None
        }
        removed_entries = self.authenticator.removed_entries(holders.values())
        for connection, entry in holders.items():
            if entry in removed_entries:
                connection.refuse(HandshakeRefusal(line("token refused: it was removed"), "its token was removed"))


def _certificate(config: Config, folder: Path) -> tls.Files:
    """The certificate of the settings, else that of the service manager, else one in the state folder, made if needed.

    Raises BadConfig.
    """
    passed = credential(tls.CREDENTIAL)
    if config.tls_cert or passed is None:
        if not config.tls_cert:
            tls.make(folder)
        return tls.files(config.tls_cert, config.tls_key, folder)
    return tls.Files(passed, passed)


def access_policy(config: Config, addresses: Iterable[str]) -> AccessPolicy:
    """The policy for the addresses of ``config.host``; a certificate is made if there is none yet.

    Raises BadConfig.
    """
    if all(ipaddress.ip_address(address.partition("%")[0]).is_loopback for address in addresses):
        return AccessPolicy()
    if config.allow_plain:
        log.warning("allow_plain: every computer that reaches %s moves the robot and runs programs as the user of "
                    "this process, and everybody on the way can read along; without it TLS and a token are asked for",
                    config.host)
        return AccessPolicy()
    folder = state_folder()
    tokens = Tokens(folder, credential(CREDENTIAL))
    count = len(tokens.entries())
    if not count:
        raise BadConfig(f"others than this machine reach host {config.host}, and there is no token yet: "
                        f"{as_typed('urbihw access add')} NAME, as the same user (with sudo for the service); or set "
                        "allow_plain = true, which lets in everybody")
    files = _certificate(config, folder)
    context = tls.context(files)
    log.info("TLS on %s for %d who have a token; fingerprint %s", config.host, count, tls.fingerprint(files))
    authenticator = Authenticator(tokens)
    return AccessPolicy(authenticator.handshake, context, authenticator, files)
