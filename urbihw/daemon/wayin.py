"""By which way clients come in: who may reach the address, and what is asked of them.

This machine may come in as it is.  An address that others reach is for TLS and tokens, unless ``allow_plain`` says
that whoever reaches it may do everything.
"""

from __future__ import annotations

import ipaddress
import logging
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from ssl import SSLContext

from urbihw.daemon import tls
from urbihw.daemon.access import Admission, FirstLine, Tokens
from urbihw.daemon.config import Config
from urbihw.daemon.state import state_folder
from urbihw.kernel.server.connection import Connection
from urbihw.kernel.server.greeting import FirstBytes, Greeter, Refusal, line
from urbihw.kernel.uobject import BadConfig

log = logging.getLogger("urbihw.access")


@dataclass(frozen=True)
class WayIn:
    """What is asked of those who come in by TCP.

    Attributes:
        greeting: decides about the first bytes.
        ssl: what TLS is spoken with; None for plain TCP.
        admission: who let them in, None if nobody is asked.
        files: the certificate and its key; None without TLS.
    """

    greeting: Greeter = FirstBytes
    ssl: SSLContext | None = None
    admission: Admission | None = None
    files: tls.Files | None = None

    def problems(self) -> Iterator[str]:
        """Look at the files of tokens, certificate and key: a line for each that cannot be used.

        Who is in stays.  A certificate that was changed counts from the next start on, tokens at once.
        """
        if self.admission is not None:
            try:
                self.admission.check()
            except BadConfig as error:
                yield f"nobody else is let in by a token until this is mended: {error}"
        if self.files is not None:
            try:
                tls.context(self.files)
            except BadConfig as error:
                yield f"the certificate stays as it was: {error}"

    def let_go(self, connections: Iterable[Connection]) -> None:
        """Disconnect those whose token has been removed since they came in."""
        if self.admission is None:
            return
        holders = {
            connection: connection.greeting.entry
            for connection in connections
            if isinstance(connection.greeting, FirstLine) and connection.greeting.entry is not None
        }
        gone = self.admission.gone(holders.values())
        for connection, entry in holders.items():
            if entry in gone:
                connection.refuse(Refusal(line("token refused: it was removed"), "its token was removed"))


def way_in(config: Config, addresses: Iterable[str]) -> WayIn:
    """The way in by the addresses that ``config.host`` stands for; a certificate is made if there is none yet.

    Raises BadConfig.
    """
    if all(ipaddress.ip_address(address.partition("%")[0]).is_loopback for address in addresses):
        return WayIn()
    if config.allow_plain:
        log.warning("allow_plain: whoever reaches %s moves the robot and runs programs as the user of this process, "
                    "and everybody on the way can read along; without it TLS and a token are asked for", config.host)
        return WayIn()
    folder = state_folder()
    tokens = Tokens(folder)
    count = len(tokens.entries())
    if not count:
        raise BadConfig(f"others than this machine reach host {config.host}, and nobody has a token yet: urbihw access "
                        "add NAME, as the same user (with sudo for the service); or set allow_plain = true, which lets "
                        "in everybody")
    if not config.tls_cert:
        tls.make(folder)
    files = tls.files(config.tls_cert, config.tls_key, folder)
    context = tls.context(files)
    log.info("TLS on %s for %d who have a token; fingerprint %s", config.host, count, tls.fingerprint(files))
    admission = Admission(tokens)
    return WayIn(admission.greeting, context, admission, files)
