"""What a daemon offers to those who watch it: metrics, the panel for browsers, the flight recorder, the bridge to a
fleet, the node of ROS, the announcement in the network.

``bind`` comes before the robot is opened, so that a mistake ends the start; ``start`` when clients can connect.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

from urbihw.daemon.announce import Announcement, reachable
from urbihw.daemon.config import Config
from urbihw.daemon.fleet import check_fleet, fleet_command
from urbihw.daemon.flight import FAREWELL, check_flight, flight_command
from urbihw.daemon.kept_child import KeptChild
from urbihw.daemon.metrics import MetricsServer, parse_address
from urbihw.daemon.panel import check_panel, panel_command
from urbihw.daemon.ros import check_ros, ros_command
from urbihw.extras import install_command
from urbihw.kernel.uobject import BadConfig

END_TIMEOUT_S: Final = 10.0
"""Seconds that ``close`` takes at most."""


class Observers:
    """The metrics, the children and the announcement of one daemon; without these settings it does nothing."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._metrics: MetricsServer | None = None
        self._announcement: Announcement | None = None
        self._children: list[KeptChild] = []

    def bind(self, addresses: Sequence[str], port: int) -> None:
        """Take the address of the metrics; prepare the announcement of a port.  Raises BadConfig."""
        config = self._config
        if config.metrics:
            try:
                self._metrics = MetricsServer(parse_address(config.metrics))
            except OSError as error:
                why = f"cannot listen on {config.metrics}: {error.strerror or error}"
                raise BadConfig(f"metrics: {why}; choose another port") from error
        if config.web:
            check_panel(config)
        if config.flight:
            check_flight()
        if config.fleet:
            check_fleet()
        if config.ros != "off":
            check_ros()
        if not config.announce:
            return
        try:
            known = reachable(addresses)
            if known:
                self._announcement = Announcement(config.platform, port, known, tls=not config.allow_plain)
        except ImportError as error:
            raise BadConfig(f"announce: this needs a package: {install_command('find')}") from error
        except OSError as error:
            raise BadConfig(f"announce: the addresses of this machine are not known: {error.strerror}") from error

    def start(self, control: str, server: str) -> None:
        """Serve the metrics of the worker at a control socket, a panel and a node for the server at an address or path;
        announce the port."""
        if self._config.web:
            command = panel_command(self._config, server, control)
            self._children.append(KeptChild(command, "panel", "what its browsers move ends"))
        if self._config.flight:
            command = flight_command(self._config, control)
            lost = "the last minutes are lost"
            self._children.append(KeptChild(command, "flight recorder", lost, FAREWELL))
        if self._config.fleet:
            command = fleet_command(self._config, server, control)
            self._children.append(KeptChild(command, "bridge to the fleet", "what others move through it ends"))
        if self._config.ros != "off":
            command = ros_command(self._config, server, control)
            self._children.append(KeptChild(command, "ROS node", "what its publishers move ends"))
        for child in self._children:
            child.start()
        if self._metrics is not None:
            self._metrics.start(Path(control))
        if self._announcement is not None:
            self._announcement.start()

    def close(self) -> None:
        """Withdraw all; calling it twice is allowed."""
        metrics, announcement, children = self._metrics, self._announcement, self._children
        self._metrics = self._announcement = None
        self._children = []
        for child in children:
            child.close()
        if announcement is not None:
            announcement.close()
        if metrics is not None:
            metrics.close()
