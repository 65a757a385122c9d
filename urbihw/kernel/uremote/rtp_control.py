"""Control of RTP by programs and remotes: the property ``rtp`` of a variable, ``UObject.rtpOpen``, and the class
``URTP``.

``URTP`` is the class that remotes of the C++ SDK use to set up RTP, if both ends have it (manual, section 3.15).  Their
packet format is not supported here (see ``rtp``).  A remote that has the class, or requests an instance of this
server's, gets one message not to use RTP; its values are then sent on the connection.
"""

from __future__ import annotations

from typing import Any, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.code import make_primitive
from urbihw.kernel.runtime.primitive import Table
from urbihw.kernel.runtime.slot import meta_of
from urbihw.kernel.runtime.world import World
from urbihw.kernel.uobject.registry import Registry, registry_of
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uremote.connection import connection_of
from urbihw.kernel.uremote.remote import MessageCode
from urbihw.kernel.uremote.rtp import SECRET_SIZE

UOBJECT = Table("UObject")
URTP = Table("URTP")

CLASS: Final = "URTP"


@URTP.raw("new", least=0, most=-1)
def new(world: World) -> Any:
    """Returns void and tells the requesting remote not to use RTP."""

    def run(this: Any, *args: Any) -> Any:
        connection = registry_of(world).connections.get(world.scheduler.running().context)
        if connection is not None:
            connection.decline_rtp()
        return world.nil

    return run


@UOBJECT.primitive("rtpOpen")
def rtp_open(world: World, this: Any, secret: str, port: int, source: int) -> list[Any]:
    """Agree on RTP with a remote that receives at ``port`` and uses the source number ``source``; returns the address,
    the port and the source number of this server."""
    try:
        key = bytes.fromhex(secret)
    except ValueError:
        key = b""
    if len(key) != SECRET_SIZE or not 0 < port < 65536 or not 0 <= source < 1 << 32:
        raise errors.primitive(f"expected {SECRET_SIZE} bytes in hexadecimal digits, a port and a number of 32 bits")
    link = connection_of(world).open_rtp(key, port, source)
    return [link.address, float(link.port), float(link.source)]


class RtpSwitch:
    """The slot ``rtp`` of a UVar."""

    def __init__(self, world: World) -> None:
        self._world = world

    def read(self, target: Any) -> Any:
        """Whether values of the variable are sent by RTP, binary or not."""
        return self._world.boolean(isinstance(target, UVar) and target.rtp)

    def write(self, target: Any, value: Any) -> Any:
        """Switch RTP for the variable on or off; all remotes are notified once."""
        if isinstance(target, UVar):
            changed, target.rtp = bool(target.rtp) != bool(value), bool(value)
            for connection in list(registry_of(self._world).connections.values()):
                if changed and not connection.rtp_declined:
                    connection.send(
                        MessageCode.RTP, self._world.string(target.full_name), self._world.boolean(target.rtp)
                    )
        return value


def install(world: World, registry: Registry) -> None:
    """Install the property ``rtp`` of UVar, the functions, and ``URTP``, which a remote may replace by its own
    class.
    """
    UOBJECT.install(world, world.uobject_proto)
    switch = RtpSwitch(world)
    world.uvar_proto.slots["rtp"] = make_primitive(world, "rtp", switch.read, 0, 0)
    meta_of(world.uvar_proto, "rtp").accessor = switch
    made = world.proto(world.uobject_proto)
    made.slots["type"] = world.string(CLASS)
    URTP.install(world, made)
    registry.replaceable[CLASS] = registry.holder.slots[CLASS] = made
