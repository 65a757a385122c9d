"""The login: request, reply, first level of the battery.  A robot that gets a move before those closes the connection.

The errors tell a refusal from silence: the settings of the user can be wrong, or the robot switched off.  Source: fact
sheet, section 5.
"""

from __future__ import annotations

import errno
from typing import Final

from urbihw.buses.errors import BadFrame, LinkGone, Unavailable
from urbihw.buses.link import Link
from urbihw.frozen import frozen
from urbihw.platforms.spykee import protocol as p
from urbihw.settings import one_line

REPLY_TIMEOUT_S: Final = 2.0
"""Seconds to wait for each of the two packets."""


@frozen
class SpykeeRobotInfo:
    """The robot as ``Found`` reports it; ``power`` is raw: percent, or negative while it charges."""

    uid: str
    name: str
    firmware: str
    docked: bool
    power: int


def log_in(
    link: Link, framer: p.SpykeeFramer, user: str, password: str
) -> tuple[SpykeeRobotInfo, list[tuple[int, bytes]]]:
    """Log in, and wait until the robot accepts moves.

    Returns the description of the robot, and the packets that came after the level of the battery.  Raises Unavailable.
    """
    where = link.url.text
    packets: list[tuple[int, bytes]] = []

    def wait_for(kind: int) -> bytes | None:
        deadline = link.clock.now() + REPLY_TIMEOUT_S
        while True:
            while packets:
                found, payload = packets.pop(0)
                if found == kind:
                    return payload
            data = link.read(4096, deadline)
            if not data:
                return None
            packets.extend(framer.feed(data))

    try:
        link.write(p.login(user, password))
        reply = wait_for(p.LOGIN_REPLY)
        identity = None if reply is None else p.read_login_reply(reply)
        if identity is None:
            raise _silent(where) if reply is None else _refused(where, user)
        level = wait_for(p.POWER)
        if level is None:
            why = f"{where}: the robot let {user!r} in and then said nothing of its battery"
            raise Unavailable(errno.ETIMEDOUT, why)
        power = p.read_power(level)
    except BadFrame as error:
        raise Unavailable(errno.EPROTO, f"{where}: {error}; is this a Spykee?") from error
    except LinkGone as error:
        raise _refused(where, user) from error
    # What it calls itself goes to logs and terminals.
    uid, name, firmware = map(one_line, (*identity.names[:2], identity.firmware))
    return SpykeeRobotInfo(uid, name, firmware, identity.docked, power), packets


def _silent(where: str) -> Unavailable:
    return Unavailable(errno.ETIMEDOUT, f"{where}: no answer to the login in {REPLY_TIMEOUT_S:g} s; is this a Spykee?")


def _refused(where: str, user: str) -> Unavailable:
    return Unavailable(
        errno.EACCES,
        f"{where}: the robot refuses user {user!r}: wrong user or password (options.user, options.password), or"
        " somebody else is connected",
    )


