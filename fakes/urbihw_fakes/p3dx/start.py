"""How a simulated Pioneer is reached: the arguments of `python -m urbihw_fakes p3dx`.

    --pty [PATH]     the controller on a pseudo terminal, the laser on another one (PATH-laser); lms1xx on a TCP port
    --tcp PORT       the controller behind a TCP port, as MobileSim serves it on 8101; the laser behind the next one

The url that is printed names both lines: `serial:///tmp/p3dx?laser=/tmp/p3dx-laser`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path

from urbihw_fakes.bodies.pioneer import SimulatedBody
from urbihw_fakes.bodies.simulation import is_simulated, unknown_world
from urbihw_fakes.console import Command
from urbihw_fakes.endpoint import PtyEndpoint, TcpEndpoint
from urbihw_fakes.lasers.cola import ColaLaser
from urbihw_fakes.p3dx.arcos import DISTANCE_CONV, Arcos
from urbihw_fakes.p3dx.body import BUMPERS, Body
from urbihw_fakes.p3dx.console import commands
from urbihw_fakes.p3dx.kit import LASERS, Laser, P3dx
from urbihw_fakes.p3dx.sips import Settings
from urbihw_fakes.p3dx.world import World
from urbihw_fakes.serving import Endpoint

HELP = "a Pioneer 3-DX with a SICK laser in a small world of walls"


class WithLaser(Endpoint):
    """The controller's line, which knows of the laser's."""

    laser_line: Endpoint
    laser_model: str

    @property
    def url(self) -> str:
        """Both lines in one url."""
        laser = self.laser_line.url.removeprefix("serial://")
        model = "" if self.laser_model == "lms200" else f"&laser_model={self.laser_model}"
        return f"{super().url}?laser={laser}{model}"  # type: ignore[safe-super]

    def close(self) -> None:
        """Close the lines of robot and laser."""
        self.laser_line.close()
        super().close()


class TwoPtys(WithLaser, PtyEndpoint):
    """Both lines on pseudo terminals; they follow the speed that the peer sets."""

    def __init__(self, robot: Arcos, laser: Laser, path: str | None = None, *, follow_baud: bool = True) -> None:
        super().__init__(robot, path, follow_baud=follow_baud)
        self.laser_model = laser.model
        if isinstance(laser, ColaLaser):
            # This one has a network socket.
            self.laser_line = TcpEndpoint(laser)
        else:
            self.laser_line = PtyEndpoint(laser, f"{self.path}-laser", follow_baud=follow_baud)
        self.laser_line.start()


class TwoPorts(WithLaser, TcpEndpoint):
    """Both lines behind TCP ports; the laser's is the next one, or any free one if the first was to be free."""

    def __init__(self, robot: Arcos, laser: Laser, port: int = 0) -> None:
        super().__init__(robot, port)
        self.laser_model = laser.model
        self.laser_line = TcpEndpoint(laser, port + 1 if port else 0)
        self.laser_line.start()


def options(parser: argparse.ArgumentParser) -> None:
    """The arguments of this robot."""
    where = parser.add_mutually_exclusive_group(required=True)
    where.add_argument("--pty", nargs="?", const="", metavar="PATH", help="pseudo terminals: PATH, PATH-laser")
    where.add_argument("--tcp", type=int, metavar="PORT", help="TCP ports of this machine; 0 takes free ones")
    parser.add_argument(
        "--world", metavar="WORLD", help="a world in MuJoCo (room, flat, or a file .xml), or walls from a map in ARIA's"
        " format (default: a room without physics)",
    )  # fmt: skip
    parser.add_argument("--slip", type=float, default=0.01,
                        help="without physics: share of the wheels' turning lost (%(default)s)")  # fmt: skip
    parser.add_argument("--subclass", default="p3dx-sh", choices=sorted(DISTANCE_CONV), help="(%(default)s)")
    parser.add_argument("--cycle", type=int, default=100, help="ms between SIPs (%(default)s)")
    parser.add_argument("--laser", default="lms200", choices=sorted(LASERS), help="(%(default)s)")
    parser.add_argument("--gripper", action="store_true", help="it has a gripper")
    parser.add_argument("--gyro", action="store_true", help="it has a gyro")
    parser.add_argument("--any-baud", action="store_true", help="on pseudo terminals: hear every speed")


def start(options: argparse.Namespace) -> tuple[Endpoint, Mapping[str, Command]]:
    """The robot on its lines, and its console commands."""
    settings = Settings(
        subclass=options.subclass, sip_cycle=options.cycle, front_bumps=BUMPERS, rear_bumps=BUMPERS,
        gripper=int(options.gripper), gyro_type=int(options.gyro),
    )  # fmt: skip
    kit = P3dx(settings=settings, laser=options.laser, body=_body(options))
    line: TwoPtys | TwoPorts
    if options.tcp is not None:
        line = TwoPorts(kit.robot, kit.laser, options.tcp)
    else:
        line = TwoPtys(kit.robot, kit.laser, options.pty or None, follow_baud=not options.any_baud)
    return line, commands(kit, line.clock, line.laser_line)


def _body(options: argparse.Namespace) -> Body:
    if options.world and is_simulated(options.world):
        return SimulatedBody(options.world)
    if options.world and not Path(options.world).exists():
        raise unknown_world(options.world, "a file: MJCF (.xml) or a map in ARIA's format")
    return Body(World.read(options.world) if options.world else World.room(), options.slip)
