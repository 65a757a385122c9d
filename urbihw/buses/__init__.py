"""Byte links and shared wire protocols; nothing here knows of urbiscript, platforms or fakes.

Where to start: `open(url)` below, then `link.py` (what a link is), `servos/packet.py` (bytes only),
`servos/bus.py` (one wire, asked and answered), `servos/cycle.py` (the cyclic work), `worker.py` (that work in
its own process, and the example of how a platform uses it).

A bus is a url; a fake robot is just one more url::

    /dev/ttyUSB0?baud=57600      a serial device, or the path of a pty
    serial:///dev/ttyUSB0        the same, spelt out
    socket://localhost:6000      a bus behind TCP
    usb://0694:0002              a USB device with a pair of bulk endpoints, by vendor and product
    can://socketcan/can0         a CAN bus, by the interfaces of python-can: see `can`
    spykee://192.168.1.20        a Spykee; without an address, the one that is found
    mujoco:///home/me/arm.xml    a simulated world: a MuJoCo model, a URDF, or the name of a bundled world
    ipc://1234/NAME              a robot of Webots on this machine; tcp://host:1234/NAME elsewhere
    webots://NAME                of the last Webots that was started here; without a name, the only robot
    spy:///dev/ttyUSB0           the same as without spy://, printing every byte
    pipe://name                  an in-memory pair, for tests

Other packages add theirs, such as `qi://192.168.1.30` of urbihw-nao.

The links: `fd` (what ends in a file descriptor), `serial`, `tcp`, `usb`, `pipe`, `spy`, with `capture` (traffic as
text), `ports` (those of this machine), `listening` (a TCP socket that waits), `clock` and `errors`.

The worker, from its start: `supervisor` (the handle that a robot has), `worker`, `child` and `spare` (its process),
`silence` (whether it hangs), `engine` (the loop), `mailbox` and `messages` (to and from the daemon), `inbox`, `control`
and `control_client` (the socket for stops), `ticker`, `robot_link`, `driver` (the base of all drivers), `gate` with
`authority` (who may move it) and `latches` with `latch_view` and `owed_releases` (who holds it), `thresholds` and
`setpoints` (limits), `reports` with `counter` and `processor`.

What it tells of the wire: `health`, `inventory` (expected devices), `readings` (their units), `verdict`, `pace` and
`turnaround` (why it is slow), `traffic` and `trace` (bytes for people), `events` and `journal` (messages for
recorders). Packets cut short: `halfpacket`. The wires of several robots are packages: `servos`, `can`.
"""

from __future__ import annotations

import importlib
from typing import Final

from urbihw.buses.errors import BadUrl, Unavailable
from urbihw.buses.link import Context, Link, Port, Url, byte_link
from urbihw.extras import install_command

# scheme -> "module:Class". Strings, so that listing costs no import and a missing library breaks only its own row.
BUSES: Final = {
    "serial": "urbihw.buses.serial:SerialLink",
    "socket": "urbihw.buses.tcp:TcpLink",
    "pipe": "urbihw.buses.pipe:PipeLink",
    "spy": "urbihw.buses.spy:SpyLink",
    "usb": "urbihw.buses.usb:UsbLink",
    "can": "urbihw.buses.can.port:CanPort",
    "spykee": "urbihw.platforms.spykee.link:SpykeeLink",
    "mujoco": "urbihw.platforms.webots.port:MujocoPort",
    "ipc": "urbihw.platforms.webots.port:WebotsPort",
    "tcp": "urbihw.platforms.webots.port:WebotsPort",
    "webots": "urbihw.platforms.webots.port:WebotsPort",
}
ENTRY_POINTS: Final = "urbihw.buses"  # group under which other packages add rows: name = scheme, value = module:Class


def open(url: str, context: Context | None = None) -> Port:
    """Return the port named by `url`, opened.

    Raises BadUrl when the url cannot be understood, Unavailable when the port cannot be opened now.
    """
    port = port_for(url, context if context is not None else Context())
    port.open()
    return port


def open_link(url: str, context: Context | None = None) -> Link:
    """The same for who needs bytes. Raises BadUrl also when the port moves something else."""
    return byte_link(open(url, context))


def port_for(url: str, context: Context) -> Port:
    """Return the port named by `url`, still closed. Raises BadUrl, or Unavailable when its library is missing."""
    parsed = Url.parse(url)
    return _port_class(parsed)(parsed, context)


def port_class(url: str) -> type[Port]:
    """Return the class of the port named by `url`, imported. Raises BadUrl, and Unavailable without its library."""
    return _port_class(Url.parse(url))


def _port_class(url: Url) -> type[Port]:
    row = BUSES.get(url.scheme)
    if row is None:
        # Imported here because it costs a worker 15 ms of its start, and most never need it.
        from importlib.metadata import entry_points

        extra = {entry.name: entry.value for entry in entry_points(group=ENTRY_POINTS)}
        row = extra.get(url.scheme)
        if row is None:
            known = ", ".join(sorted({*BUSES, *extra}))
            raise BadUrl(f"bus url {url.text!r}: unknown kind {url.scheme!r}; known: {known}")
    module_name, _, class_name = row.partition(":")
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        # What not everybody has is an extra with the name of the scheme.
        how = install_command(url.scheme) if url.scheme in BUSES else f"pip install {error.name}"
        raise Unavailable(f"{url.scheme}:// needs the Python package {error.name}: {how}") from error
    found: type[Port] = getattr(module, class_name)
    return found
