"""``urbihw stop --direct``: stop a robot whose daemon and bus worker may both be dead.

A daemon that serves the robot is asked first.  If there is none, the command opens the bus, finds the devices, and
stops all that move, as a bus worker does at its beginning and at its end.  The latch of an emergency stop is unchanged.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Final

from urbihw import buses, platforms
from urbihw.buses.driver import driver_of
from urbihw.buses.errors import BadUrl, BadValue, Unavailable
from urbihw.buses.link import Url, split_parameters
from urbihw.buses.messages import Begin, Configure, Found, FromWorker, LinkState, Stopped
from urbihw.buses.worker import Worker
from urbihw.cli import control
from urbihw.daemon.config import Config, Loaded, load
from urbihw.daemon.holders import holder_of_file
from urbihw.daemon.runtime import SERVICE_FOLDER, control_path
from urbihw.exitcodes import EX_CONFIG, EX_UNAVAILABLE
from urbihw.kernel.uobject import BadConfig
from urbihw.settings import BadSetting

PORT_TIMEOUT_S: Final = 2.0
"""Seconds within which the port must open; the process that has it open may be about to end."""
CONTROL_SETTINGS: Final = {"", "platform", "port", "control"}
"""The settings needed to find a daemon; "" is the file as a whole."""
BUS_SETTINGS: Final = {"url", "fake", "torque_off_on_stop", "options"}
"""The settings needed to open the bus and to stop the robot."""
TICK_RATE_HZ: Final = 50.0
"""Ticks of the worker per second, which every driver supports."""
FIND_TIMEOUT_S: Final = 6.0
"""Seconds within which the robot must be found."""
WORKER_END_TIMEOUT_S: Final = 1.0
"""Seconds for the worker to end, at most twice; the whole command takes less than ten seconds."""


class NotStopped(Exception):
    """The robot could not be stopped; the message is one line with the reason, ``code`` the exit code."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


def stop(options: argparse.Namespace) -> int:
    """Stop the robot that the options name; returns the exit code."""
    try:
        loaded = load(options.config, {name: getattr(options, name) for name in ("platform", "url")})
        config = loaded.config
        _refuse(loaded, CONTROL_SETTINGS)
        if not config.platform:
            raise BadConfig("which robot? Give --config FILE, or --platform NAME and --url URL")
        for path in sockets(config) if options.socket is None else [options.socket]:
            (answer,) = control.ask([path], "stop", options.who or control.requester_name("stop"))
            if not answer.problem:
                return control.report("stop", [answer])
        _refuse(loaded, BUS_SETTINGS)
        if config.fake:
            print(f"{config.platform}: nothing to stop: a simulated robot ends with its daemon")
            return 0
        print(f"{config.platform}: {stopped(config)}")
    except BadConfig as error:
        return control.complain(str(error), EX_CONFIG)
    except NotStopped as error:
        return control.complain(f"{config.platform} is not stopped: {error}", error.code)
    return 0


def _refuse(loaded: Loaded, needed: Collection[str]) -> None:
    """Raise BadConfig for a mistake in a needed setting; other mistakes must not prevent a stop."""
    for mistake in loaded.mistakes:
        if mistake.setting in needed:
            raise BadConfig(mistake.line)


def sockets(config: Config) -> list[Path]:
    """The control sockets of the robot with these settings."""
    if config.control == "off":
        return []
    if config.control:
        return [Path(config.control)]
    try:
        path = control_path(config.platform, config.port)
    except BadConfig:
        return [Path(SERVICE_FOLDER) / f"{config.platform}-{config.port}.sock"]
    return list(dict.fromkeys((path, Path(SERVICE_FOLDER) / path.name)))


def stopped(config: Config) -> str:
    """Stop the robot over its bus.  Returns what was stopped, in words.  Raises BadConfig, NotStopped."""
    manifest = platforms.find(config.platform)
    family = getattr(platforms.load(manifest), "family", "")
    url = config.url or manifest.default_url
    settings = Configure(TICK_RATE_HZ, 0.0, config.torque_off_on_stop, options=config.options)
    heard = _WorkerReport()
    try:
        driver = driver_of(family)
        worker = Worker.start(url, post=heard.queue.put, process=False, family=family, begin=Begin(settings))
    except (BadUrl, BadValue, BadSetting) as error:
        raise BadConfig(f"{config.platform}: {error}") from error
    try:
        heard.listen()
    finally:
        worker.stop(WORKER_END_TIMEOUT_S)
    heard.drain_queue()
    if not heard.devices:
        raise _port_problem(url, driver.url_parameters, heard.problem)
    if heard.moved:
        return f"stopped: {heard.moved}"
    return "nothing moved" if driver.knows_motion else "told to stop"


@dataclass
class _WorkerReport:
    """Collects the messages of the worker that matter here."""

    queue: SimpleQueue[FromWorker] = field(default_factory=SimpleQueue)
    devices: tuple[object, ...] = ()
    looked: bool = False
    up: bool = False
    problem: str = ""
    moved: str = ""

    def listen(self) -> None:
        """Return when the robot is found, or cannot be."""
        begin = time.monotonic()
        while not self.looked:
            left = begin + (FIND_TIMEOUT_S if self.up or not self.problem else PORT_TIMEOUT_S) - time.monotonic()
            try:
                self._hear(self.queue.get(timeout=max(left, 0.001)))
            except Empty:
                return

    def drain_queue(self) -> None:
        """Process the messages that have arrived since."""
        while not self.queue.empty():
            self._hear(self.queue.get())

    def _hear(self, message: FromWorker) -> None:
        match message:
            case LinkState():
                self.up, self.problem = message.up, message.reason
            case Found():
                # No devices: without power nothing moves.
                self.devices, self.looked = self.devices or message.devices, True
            case Stopped() if not self.up and message.devices is None:
                self.moved = message.reason
            case _:
                pass


def _port_problem(url: str, own: Collection[str], problem: str) -> NotStopped:
    """The error for a robot that was not found: the port cannot be opened, or the robot does not answer."""
    port, _ = split_parameters(url, own)
    try:
        buses.open(port).close()
    except (BadUrl, Unavailable) as error:
        reason, target = str(error), Url.parse(port)
        holder = holder_of_file(target.target) if target.scheme == "serial" and "in use" in reason else ""
        return NotStopped(reason.replace("by another program", f"by {holder}") if holder else reason, EX_CONFIG)
    return NotStopped(problem or f"no robot answers on {url}: is it switched on?", EX_UNAVAILABLE)
