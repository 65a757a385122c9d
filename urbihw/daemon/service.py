"""One daemon: a kernel, a robot, a port; start, reload, stop.  The common part of all processes with a kernel is
``urbihw.kernel.process``.

Order of a start: bind the port, load the robot's library, find the robot and fill its slots, load the user's files,
listen for clients.  A mistake in the settings raises ``StartError``: one line, and exit code 78.  No fault of the robot
ends the daemon: one that is absent at the start is waited for, with the slots that the settings or the last run know.

Order of a stop: the robot (its effectors stop within a second), the clients (notified, then disconnected), the rest.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path

from urbihw import platforms
from urbihw.buses.errors import BadUrl
from urbihw.buses.link import serial_path
from urbihw.daemon.access_policy import AccessPolicy, access_policy
from urbihw.daemon.activation import passed_sockets
from urbihw.daemon.config import Config, Loaded
from urbihw.daemon.dead_sockets import remove_dead_sockets
from urbihw.daemon.fake import SCENE_WORD, Fake, FakeConsole, FakeScene
from urbihw.daemon.files import read_regular
from urbihw.daemon.holders import holder_of_file, holder_of_port
from urbihw.daemon.notify import ServiceNotifier
from urbihw.daemon.observers import END_TIMEOUT_S, Observers
from urbihw.daemon.record_feed import RecordFeed, shown_settings
from urbihw.daemon.reload import Reloader, check_whole, restart_settings
from urbihw.daemon.runtime import client_path, control_path, runtime_folder
from urbihw.daemon.state import motions_folder, robots_folder
from urbihw.kernel.process import KernelProcess, resolver
from urbihw.kernel.server.bounds import bounds
from urbihw.kernel.server.log_tap import LogTap
from urbihw.kernel.uobject import BadConfig, DeviceError, NotReady, PlatformRobot, RobotSettings, not_ended
from urbihw.kernel.uobject.protection import protect_robot
from urbihw.platforms import Manifest
from urbihw.platforms.scene.view import TREE, WorldView
from urbihw.repeats import LimitedLog
from urbihw.robot import ROBOT_LIBRARY
from urbihw.ros.script import ROS_LIBRARY

log = logging.getLogger("urbihw.daemon")

SEARCH_PATIENCE_S = 3.0
"""Seconds of a start without a word to the user."""
OPEN_TIMEOUT_S = 20.0
"""Maximum seconds to find the robot before the port is served without it; a scan of two protocols with a slow adapter
takes a few seconds."""
PROGRAM_PATIENCE_S = 5.0
"""Seconds after which the log names the program that the start waits for."""
STATUS_PERIOD_S = 1.0
MAX_PROGRAM_BYTES = 16 * 1024 * 1024
"""Maximum size of a file of ``load`` in bytes."""
MOST_SAID = 200
"""Lines of loaded files that are logged in a minute; of the others only their number."""
MAX_SOCKET_PATH_BYTES = 107
"""Maximum length of the path of a UNIX socket in bytes (``man 7 unix``)."""
STOP_TIMEOUT_S = 10.0
"""Maximum seconds to stop and close the robot; if its bus worker hangs, another one stops it."""


class StartError(Exception):
    """The daemon cannot serve with its configuration; the message is one line that tells what to do."""


class DaemonService:
    """``await Service(config).run()`` serves until SIGTERM, SIGINT or ``stop()``; the result is the exit code."""

    def __init__(
        self, config: Config, notifier: ServiceNotifier | None = None, reread: Callable[[], Loaded] | None = None
    ) -> None:
        """``notifier`` reports to the service manager; ``reread`` loads the settings again, for SIGHUP."""
        self._config = config
        self._notifier = notifier if notifier is not None else ServiceNotifier()
        self._reread = reread
        self._in_force = config
        self._process: KernelProcess
        self._robot: PlatformRobot | None = None
        self._robot_url = ""
        self._slot = ""
        self._waits_for_robot = False
        self._is_protected = False
        self._fake: Fake | None = None
        self._scene: FakeScene | None = None
        self._view: WorldView | None = None
        self._access_policy = AccessPolicy()
        self._observers = Observers(config)
        self._said = LimitedLog(log)
        self._control_path = ""
        self._client_path = ""
        self._record_feed: RecordFeed | None = None
        self._record_log: LogTap | None = None
        self._reloader: Reloader

    async def run(self) -> int:
        """Serve, and return the exit code.  Raises StartError when the start fails."""
        self._process = process = KernelProcess(self._abandon_robot)
        process.install_signals()
        self._reloader = Reloader(self._read_again)
        asyncio.get_running_loop().add_signal_handler(signal.SIGHUP, self._reloader.request_reload)
        try:
            await process.run_until_stopped(self._start())
            await self._report()
        finally:
            self._notifier.stopping()
            await self._close()
            process.restore_signals()
        return process.exit_status or 0

    def _abandon_robot(self) -> None:
        """Stop the robot from another thread, when a program prevents an orderly shutdown."""
        if self._robot is not None:
            self._robot.abandon()

    def stop(self) -> None:
        """Begin an orderly shutdown of the service."""
        self._process.stop()

    def _read_again(self) -> None:
        """Read settings, tokens and certificate again; mistakes are logged, and the settings in force stay."""
        if self._reread is None or self._robot is None:
            return
        self._notifier.reloading()
        try:
            read = self._reread()
            config = read.config
            if config.platform != self._config.platform:
                raise BadConfig(f"platform: {self._config.platform} is served; for another one start urbihw anew")
            check_whole(self._in_force, read)
            self._robot.configure(_robot_settings(config, self._robot_url))
            self._process.set_hold_limit(config.hold_limit)
        except BadConfig as error:
            log.error("settings stay as they were: %s", error)
        else:
            self._in_force = config
            later = restart_settings(self._config, config)
            log.info("settings read again%s", f"; with the next start: {', '.join(later)}" if later else "")
        for problem in self._access_policy.problems():
            log.error("%s", problem)
        self._notifier.ready(self._status())

    # ---------------------------------------------------------------- start

    async def _start(self) -> None:
        config = self._config
        try:
            manifest = platforms.find(config.platform)
            kind = platforms.load(manifest)
        except BadConfig as error:
            raise StartError(str(error)) from error
        self._remove_dead_sockets()
        self._bind()
        if config.fake:
            if not manifest.fake:
                raise StartError(f"platform {manifest.name} has no simulated robot; give its --url")
            self._fake = Fake((*manifest.fake, *(("--world", config.world) if config.world else ())))
        limits = bounds(config.hold_limit, config.memory_limit, config.max_jobs)
        kernel = self._process.boot(limits, led=manifest.leads_time, libraries=(ROBOT_LIBRARY, ROS_LIBRARY))
        kernel.programs.quiet = config.quiet
        kernel.world.unheard = self._log_said
        for known in (kind, *kind.classes):
            kernel.host.register(known)
        _show_to_load(manifest.folder)
        for path in manifest.library_files():
            # Users know the library by its names, not where it is installed.
            await self._load(path, path.name)
        try:
            await self._open(manifest, kind)
        except DeviceError as error:
            raise StartError(self._explained(str(error))) from error
        await self._show_world()
        if self._robot is not None:
            # Called when the first file waits, or is over: not later, since a file may wait for the robot's time.
            asyncio.get_running_loop().call_soon(self._robot.begin_programs)
        for name in config.load:
            await self._load(Path(name))
        self._slot = manifest.slot
        self._protect_robot()
        kernel.complete()
        self._listen()
        await self._feed_recorders()

    def _remove_dead_sockets(self) -> None:
        """Remove what killed daemons have left in the runtime folder, if this one has a socket there."""
        if "" in (self._config.socket, self._config.control):
            with contextlib.suppress(BadConfig):  # reported where the folder is needed
                remove_dead_sockets(runtime_folder())

    def _bind(self) -> None:
        """Bind the port and the socket path for clients before the robot is opened; no client can connect yet."""
        config = self._config
        try:
            passed = passed_sockets(config.port)
            addresses = self._process.adopt(passed) if passed else self._process.bind(config.host, config.port)
        except BadConfig as error:
            raise StartError(str(error)) from error
        except (socket.gaierror, UnicodeError) as error:
            why = getattr(error, "strerror", None) or error
            raise StartError(f"cannot listen on {config.host!r}: {why}; choose --host") from error
        except OSError as error:
            raise self._no_port(error) from error
        try:
            self._access_policy = access_policy(config, addresses)
            self._observers.bind(addresses, self._process.bound_port)
        except BadConfig as error:
            raise StartError(str(error)) from error
        if config.socket == "off":
            return
        try:
            path = Path(config.socket) if config.socket else client_path(self._process.bound_port)
        except BadConfig as error:
            raise StartError(str(error)) from error
        self._client_path = str(path)
        try:
            self._process.bind_unix(path)
        except OSError as error:
            raise StartError(f"socket: cannot listen at {path}: {error.strerror}; choose another path") from error

    def _no_port(self, error: OSError) -> StartError:
        host, port = self._config.host, self._config.port
        if error.errno == errno.EADDRINUSE:
            holder = holder_of_port(port)
            by = f" by {holder}" if holder else ""
            return StartError(f"port {port} is in use{by}; stop that, or choose another one: --port {port + 1}")
        if error.errno == errno.EACCES:
            return StartError(f"no permission to listen on port {port}; choose one above 1023: --port 54000")
        if error.errno == errno.EADDRNOTAVAIL:
            return StartError(f"this machine has no address {host}; choose --host 127.0.0.1 or --host 0.0.0.0")
        return StartError(f"cannot listen on {host}:{port}: {error.strerror}")

    async def _load(self, path: Path, shown: str = "") -> None:
        """Run an urbiscript file in Global; messages call it ``shown``, or by its path."""
        try:
            text = read_regular(path, MAX_PROGRAM_BYTES).data.decode("latin-1")
        except FileNotFoundError as error:
            raise StartError(f"cannot load {path}: {error.strerror}") from error
        except BadConfig as error:
            raise StartError(f"cannot load {error}") from error
        name = shown or str(path)
        waiting = asyncio.get_running_loop().call_later(PROGRAM_PATIENCE_S, self._tell_held_start, not_ended(name))
        try:
            problem = await self._process.run_text(text, name)
        finally:
            waiting.cancel()
        if problem and self._waits_for_robot:
            log.error("cannot load a file: %s; the robot is not there", problem)
        elif problem:
            raise StartError(f"cannot load a file: {problem}")

    def _log_said(self, line: str) -> None:
        """Log what a loaded file says: it has no connection."""
        self._said.say("said", "%s", line, level=logging.INFO, most=MOST_SAID)

    def _tell_held_start(self, reason: str) -> None:
        """The start takes long; it is reported only with a reason."""
        if reason:
            log.warning("the port is not open yet: %s", reason)

    def _tell_search(self, url: str) -> None:
        """The search for the devices of the robot takes long enough to be told."""
        log.info("%s: looking for its devices on %s", self._config.platform, url)

    async def _open(self, manifest: Manifest, kind: type[PlatformRobot]) -> None:
        """Open the robot, and wait until it is there, or known to be absent.  Raises DeviceError."""
        self._robot_url = url = await self._fake.url() if self._fake is not None else self._bus_url(manifest)
        if self._fake is not None:
            self._process.kernel.host.create(FakeConsole, "fake", self._fake)
        first: asyncio.Future[DeviceError | None] = asyncio.get_running_loop().create_future()
        answer = resolver(first)

        def answered(error: DeviceError | None) -> None:
            if first.done():
                self._robot_came(error)
            else:
                answer(error)

        self._robot = robot = self._process.kernel.host.create(kind, manifest.slot)
        self._control_path = self._control()
        settings = _robot_settings(self._config, url, self._control_path, self._memory())
        self._robot.await_programs()
        self._robot.open(settings, answered)
        self._process.drive()
        loop = asyncio.get_running_loop()
        waiting = (
            loop.call_later(SEARCH_PATIENCE_S, self._tell_search, url),
            loop.call_later(PROGRAM_PATIENCE_S, lambda: self._tell_held_start(robot.waits_for())),
        )
        try:
            error = await asyncio.wait_for(first, OPEN_TIMEOUT_S)
        except TimeoutError:
            error = NotReady(robot.waits_for() or f"no word from it in {OPEN_TIMEOUT_S:g} s")
        finally:
            for each in waiting:
                each.cancel()
        self._waits_for_robot = isinstance(error, NotReady)
        if self._waits_for_robot:
            log.warning("waiting for the robot on %s: %s", url, self._explained(str(error)))
        elif error is not None:
            raise error

    async def _show_world(self) -> None:
        """Make ``worldView``, if the simulated robot has a body in a world."""
        if self._fake is None or SCENE_WORD not in (word["name"] for word in self._fake.commands):
            return
        host = self._process.kernel.host
        try:
            file = runtime_folder() / f"world-{self._process.bound_port}.mjb"
        except BadConfig as error:
            raise StartError(str(error)) from error
        self._scene = FakeScene(self._fake, file, host.post, host.now)
        self._view = host.create(WorldView, "worldView", self._scene)
        await self._process.run_text(TREE, "scene.u")

    def _robot_came(self, error: DeviceError | None) -> None:
        """The robot has arrived after the start, or cannot be served as the settings say."""
        if error is not None:
            if not isinstance(error, NotReady):
                log.error("the robot on %s cannot be served: %s", self._robot_url, error)
            return
        self._waits_for_robot = False
        self._protect_robot()
        log.warning("the robot on %s is here: %s", self._robot_url, self._status())

    def _protect_robot(self) -> None:
        """Protect the robot's slots, once they exist: the tree of an unknown robot is built when it arrives, and takes
        the place of what ``robot`` was before."""
        robot = self._robot
        if robot is not None and not self._is_protected and robot.tree_begun and robot.host.has_slot("robot"):
            self._is_protected = True
            protect_robot(robot, self._slot)

    def _bus_url(self, manifest: Manifest) -> str:
        """The url of the settings, of the only adapter of the platform, or the default.  Raises StartError."""
        if self._config.url:
            return self._config.url
        adapters = platforms.adapters(manifest)
        if len(adapters) > 1:
            names = ", ".join(f"{each.url} ({each.name})" for each in adapters)
            raise StartError(f"several adapters may be the {manifest.name}: {names}; choose one: --url")
        return adapters[0].url if adapters else manifest.default_url

    def _memory(self) -> str:
        """The path of the file of the last run's devices; "" for a fake, and without a port that stays the same."""
        config = self._config
        if config.fake or not config.port:
            return ""
        return str(robots_folder() / f"{config.platform}-{config.port}.json")

    def _control(self) -> str:
        """The path of the control socket; "" for none.  Raises BadConfig when a live daemon listens there."""
        config = self._config
        if config.control == "off":
            return ""
        path = Path(config.control) if config.control else control_path(config.platform, self._process.bound_port)
        if not path.parent.is_dir():
            raise BadConfig(f"control: there is no folder {path.parent}; make it, or choose another path")
        if path.exists() and not path.is_socket():
            raise BadConfig(f"control: {path} is something else than a socket; choose another path")
        if len(os.fsencode(path)) > MAX_SOCKET_PATH_BYTES:
            raise BadConfig(f"control: a path of more than {MAX_SOCKET_PATH_BYTES} bytes cannot be a socket: {path}")
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe, contextlib.suppress(OSError):
            probe.connect(str(path))
            raise BadConfig(f"another urbihw serves its robot at {path}: stop that, or choose another control")
        return str(path)

    def _explained(self, reason: str) -> str:
        """Add the process that has the port open to a reason, if that is the problem."""
        with contextlib.suppress(BadUrl):
            path = serial_path(self._robot_url)
            holder = holder_of_file(path) if path and "in use" in reason else ""
            if holder:
                return reason.replace("by another program", f"by {holder}")
        return reason

    def _listen(self) -> None:
        config, process, access_policy = self._config, self._process, self._access_policy
        try:
            process.listen(
                access_policy.handshake, access_policy.ssl,
                unread_limit=config.unread_limit, max_clients=config.max_clients,
            )
        except OSError as error:
            raise self._no_port(error) from error
        self._observers.start(self._control_path, self._client_path or f"127.0.0.1:{process.port}")
        log.info("port %d of %s: %s", process.port, config.host, self._status())
        # Behind the line of the log: who waits for the file looks there next.
        if config.port_file:
            try:
                process.write_port_file(Path(config.port_file))
            except OSError as error:
                raise StartError(f"cannot write the port to {config.port_file}: {error.strerror}") from error
        self._notifier.ready(self._status())
        self._reloader.begin()

    async def _feed_recorders(self) -> None:
        """Tell recorders of the robot what the bus worker does not know."""
        server = self._process.server
        if not self._control_path or server is None:
            return
        feed = self._record_feed = RecordFeed(self._control_path, shown_settings(self._config))
        try:
            await feed.start()
        except OSError as error:
            log.error("what clients do cannot be recorded: no socket beside %s: %s", self._control_path, error.strerror)
            return
        server.overheard = feed.overhear
        self._record_log = LogTap(self._process.kernel.post, feed.add_log)
        self._record_log.attach()

    # ---------------------------------------------------------------- serve

    def _status(self) -> str:
        if self._robot is None:
            return ""
        awaited = self._robot.waits_for()
        return f"{self._config.platform}: {f'waiting for the robot: {awaited}' if awaited else self._robot.status()}"

    async def _report(self) -> None:
        """Report the status to the service manager until the service stops, and disconnect clients whose token was
        removed.

        This polls periodically instead of waiting for events: a watchdog needs messages even when nothing happens, the
        age of the worker's last message shows whether it is alive, and another process changes the file of tokens.
        """
        process, said = self._process, ""
        period = min(STATUS_PERIOD_S, self._notifier.watchdog_period or STATUS_PERIOD_S)
        while not process.stopped.done():
            status = self._status()
            if status != said:
                self._notifier.status(status)
                said = status
            if self._robot is None or self._robot.alive():
                self._notifier.watchdog()
            if process.server is not None:
                self._access_policy.disconnect_removed(process.server.connections)
            await asyncio.wait((process.stopped,), timeout=period)

    # ---------------------------------------------------------------- stop

    async def _close(self) -> None:
        process = self._process
        self._reloader.end()
        if self._robot is not None:
            process.extend_deadline(STOP_TIMEOUT_S)
            self._robot.close()
        if process.server is not None:
            for connection in list(process.server.connections):
                if connection.lobby is not None:
                    connection.lobby.output.line("*** urbihw: shutting down, the robot is stopped")
        if self._record_log is not None:
            self._record_log.detach()
        await process.close()
        self._said.close()
        if self._record_feed is not None:
            self._record_feed.close()
        process.extend_deadline(END_TIMEOUT_S)
        self._observers.close()
        if self._view is not None:
            self._view.close()
        if self._fake is not None:
            process.extend_deadline()
            self._fake.close()
        if self._scene is not None:
            self._scene.remove()
        if process.port >= 0:
            log.info("stopped")


def _show_to_load(folder: Path) -> None:
    """Make ``load`` search the folder of the platform, with its examples, after those of the user."""
    os.environ["URBI_PATH"] = os.pathsep.join((os.environ.get("URBI_PATH", ""), str(folder)))


def _robot_settings(config: Config, url: str, control: str = "", memory: str = "") -> RobotSettings:
    return RobotSettings(
        url,
        config.rate,
        config.dead_man,
        config.torque_off_on_stop,
        config.options,
        keep_motion=config.on_disconnect == "keep",
        resume=config.on_lost == "resume",
        limits=config.limits,
        devices=config.devices,
        control=control,
        memory=memory,
        motions=config.motions or str(motions_folder() / config.platform),
        realtime=config.realtime,
    )
