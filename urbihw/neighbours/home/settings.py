"""The settings of a bridge to a broker."""

from __future__ import annotations

from urbihw.frozen import frozen
from urbihw.neighbours.orders import OrderSettings


@frozen(slots=False)
class BridgeSettings:
    """What a home sees of a robot, and what it may do.

    Attributes:
        orders: the daemon, and the lease of each order.
        host, port: the broker.
        tls: whether to use TLS with the certificates that the system trusts.
        user, password: those of the broker, "" for none.
        name: of the robot in topics, letters, digits and _; "" for that of the robot.
        discovery: the first part of the topics of discovery.
        joints: the joints that the home may move; none by default.
        rate: states a second at most.
        speed: greatest speed of a joint that the home moves, in its unit a second.
        seconds: the longest that a movement may take.
    """

    orders: OrderSettings
    host: str = "127.0.0.1"
    port: int = 1883
    tls: bool = False
    user: str = ""
    password: str = ""
    name: str = ""
    discovery: str = "homeassistant"
    joints: tuple[str, ...] = ()
    rate: float = 1.0
    speed: float = 0.5
    seconds: float = 20.0
