"""The settings of a gateway."""

from __future__ import annotations

from dataclasses import field
from pathlib import Path
from ssl import SSLContext
from typing import Final

from urbihw.client.credentials import Credentials
from urbihw.client.where import Where
from urbihw.frozen import frozen

DEFAULT_PORT: Final = 54080


@frozen(slots=False)
class WebLimits:
    """What a browser of role drive may ask for at most.

    Attributes:
        speed: speed of a joint on its way to a goal, rad/s.
        x, yaw: speeds of a base, m/s and rad/s.
        share: share of the range of a slot that is a speed in another unit, such as percent.
    """

    speed: float = 1.0
    x: float = 0.3
    yaw: float = 1.0
    share: float = 0.5


@frozen(slots=False)
class WebSettings:
    """What a gateway serves, and where.

    Attributes:
        where: the daemon.
        credentials: those for a daemon that wants a token.
        control: the control socket of the bus worker; None for a robot of another machine.
        platform: the name of the platform, "" if it is not known.
        fake: whether the robot is simulated by the daemon.
        host, port: where to listen; port 0 is any free one.
        port_file: file for the port, written when browsers can connect; None for none.
        tls: the context for TLS; None for plain HTTP, on this machine only.
        folder: folder of the paired browsers.
        owner: the name of the user who started the gateway, for the first browser.
        limits: those of role drive.
    """

    where: Where
    credentials: Credentials
    folder: Path
    control: Path | None = None
    platform: str = ""
    fake: bool = False
    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT
    port_file: Path | None = None
    tls: SSLContext | None = None
    owner: str = ""
    limits: WebLimits = field(default_factory=WebLimits)
