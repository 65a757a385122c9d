"""The session over a port, whatever its kind."""

from __future__ import annotations

from urbihw import buses
from urbihw.buses.link import Context, Link, Port, byte_link
from urbihw.buses.tcp import TcpLink
from urbihw_nao.qimessaging.session import QiSession
from urbihw_nao.qimessaging.wire_session import OTHER_TIMEOUT_S, WireSession


class SessionPort(Port):
    """A port that moves no bytes but has a session of its own."""

    def make_session(self) -> QiSession:
        """The session over the open port."""
        raise NotImplementedError


def open_session(port: Port) -> QiSession:
    """The session over an open port, not yet logged in.  Raises BadUrl for a port that can have none."""
    if isinstance(port, SessionPort):
        return port.make_session()
    context = Context(port.clock)

    def open_link(url: str) -> Link:
        """A link to another end point, with the parameters of this port."""
        _, separator, query = port.url.text.partition("?")
        link = byte_link(buses.port_for(url + separator + query, context))
        if isinstance(link, TcpLink):
            link.connect_timeout_s = OTHER_TIMEOUT_S
        link.open()
        return link

    link = byte_link(port)
    # A pipe of a test has no address.
    robot = link.peer_host if isinstance(link, TcpLink) else port.url.target.partition(":")[0]
    return WireSession(link, open_link, robot)
