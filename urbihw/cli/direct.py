"""``urbihw stop --direct``: stop a robot whose daemon and bus worker may both be dead.

Whoever serves the robot is asked first.  If nobody does, the bus is opened here, the devices are found, and what moves
is stopped, as a bus worker does when it begins and when it ends.  The latch of an emergency stop stays as it is.
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
from urbihw.buses.driver import Driver, driver_of
from urbihw.buses.errors import BadUrl, BadValue, Unavailable
from urbihw.buses.link import Url, take_off
from urbihw.buses.messages import Begin, Configure, Found, FromWorker, LinkState, Stopped
from urbihw.buses.worker import Worker
from urbihw.cli import control
from urbihw.cli.options import EX_CONFIG, EX_UNAVAILABLE
from urbihw.daemon.config import Config, Loaded, load
from urbihw.daemon.holders import holder_of_file
from urbihw.daemon.runtime import SERVICE_FOLDER, control_path
from urbihw.kernel.uobject import BadConfig
from urbihw.settings import BadSetting

PORT_PATIENCE: Final = 2.0
"""Seconds in which a port must let itself be opened; who held it may be about to end."""
TO_ASK: Final = {"", "platform", "port", "control"}
"""The settings by which a daemon is found; "" is the file as a whole."""
TO_OPEN: Final = {"url", "fake", "torque_off_on_stop", "options"}
"""The settings by which the bus is opened and the robot stopped."""
RATE: Final = 50.0
"""Ticks a second; there is no driver that cannot have as many."""
PATIENCE: Final = 6.0
"""Seconds in which the robot must be found."""
END: Final = 1.0
"""Seconds for the worker to end, twice at most; all of it stays below ten seconds."""


class NotStopped(Exception):
    """The robot could not be stopped; the message is one line that says why, with an exit code."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


def stop(options: argparse.Namespace) -> int:
    """Stop the robot that the options name; returns the exit code."""
    try:
        loaded = load(options.config, {name: getattr(options, name) for name in ("platform", "url")})
        config = loaded.config
        _refuse(loaded, TO_ASK)
        if not config.platform:
            raise BadConfig("which robot? Give --config FILE, or --platform NAME and --url URL")
        for path in sockets(config) if options.socket is None else [options.socket]:
            (answer,) = control.ask([path], "stop", options.who or control.asker("stop"))
            if not answer.problem:
                return control.report("stop", [answer])
        _refuse(loaded, TO_OPEN)
        if config.fake:
            print(f"{config.platform}: nothing to stop: a robot in software ends with its daemon")
            return 0
        print(f"{config.platform}: {stopped(config)}")
    except BadConfig as error:
        return control.complain(str(error), EX_CONFIG)
    except NotStopped as error:
        return control.complain(f"{config.platform} is not stopped: {error}", error.code)
    return 0


def _refuse(loaded: Loaded, needed: Collection[str]) -> None:
    """Raise BadConfig for a mistake in what is needed; any other keeps nobody from stopping the robot."""
    for mistake in loaded.mistakes:
        if mistake.setting in needed:
            raise BadConfig(mistake.line)


def sockets(config: Config) -> list[Path]:
    """Where the robot of these settings can be asked to stop."""
    if config.control == "off":
        return []
    if config.control:
        return [Path(config.control)]
    try:
        path = control_path(config.platform, config.port)
    except BadConfig:
        return [SERVICE_FOLDER / f"{config.platform}-{config.port}.sock"]
    return list(dict.fromkeys((path, SERVICE_FOLDER / path.name)))


def stopped(config: Config) -> str:
    """Stop the robot over its bus: what was stopped, in words.  Raises BadConfig, NotStopped."""
    manifest = platforms.find(config.platform)
    family = getattr(platforms.load(manifest), "family", "")
    url = config.url or manifest.default_url
    settings = Configure(RATE, 0.0, config.torque_off_on_stop, options=config.options)
    heard = _Heard()
    try:
        driver = driver_of(family)
        worker = Worker.start(url, post=heard.queue.put, process=False, family=family, begin=Begin(settings))
    except (BadUrl, BadValue, BadSetting) as error:
        raise BadConfig(f"{config.platform}: {error}") from error
    try:
        heard.listen()
    finally:
        worker.stop(END)
    heard.take()
    if not heard.devices:
        raise _explained(url, driver.url_parameters, heard.problem)
    if heard.moved:
        return f"stopped: {heard.moved}"
    if type(driver).stop_what_moves is Driver.stop_what_moves:
        return "told to stop"
    return "nothing moved"


@dataclass
class _Heard:
    """What a worker says that matters here."""

    queue: SimpleQueue[FromWorker] = field(default_factory=SimpleQueue)
    devices: tuple[object, ...] = ()
    looked: bool = False
    up: bool = False
    problem: str = ""
    moved: str = ""

    def listen(self) -> None:
        """Return when the robot is found, or will not be."""
        begin = time.monotonic()
        while not self.looked:
            left = begin + (PATIENCE if self.up or not self.problem else PORT_PATIENCE) - time.monotonic()
            try:
                self._hear(self.queue.get(timeout=max(left, 0.001)))
            except Empty:
                return

    def take(self) -> None:
        """Hear what is still to be heard."""
        while not self.queue.empty():
            self._hear(self.queue.get())

    def _hear(self, message: FromWorker) -> None:
        match message:
            case LinkState():
                self.up, self.problem = message.up, message.reason
            case Found():
                # Nobody there: what has no power does not move.
                self.devices, self.looked = self.devices or message.devices, True
            case Stopped() if not self.up and message.devices is None:
                self.moved = message.reason
            case _:
                pass


def _explained(url: str, own: Collection[str], problem: str) -> NotStopped:
    """Tell a port that cannot be opened from a robot that does not answer."""
    port, _ = take_off(url, own)
    try:
        buses.open(port).close()
    except (BadUrl, Unavailable) as error:
        reason, target = str(error), Url.parse(port)
        holder = holder_of_file(target.target) if target.scheme == "serial" and "in use" in reason else ""
        return NotStopped(reason.replace("by another program", f"by {holder}") if holder else reason, EX_CONFIG)
    return NotStopped(problem or f"no robot answers on {url}: is it switched on?", EX_UNAVAILABLE)
