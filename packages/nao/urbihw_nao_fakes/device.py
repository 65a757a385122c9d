"""The robot: its body, its services, and its power."""

from __future__ import annotations

from pathlib import Path

from urbihw_fakes.device import Answer, Device
from urbihw_nao_fakes.audio import AudioDevice, AudioPlayer
from urbihw_nao_fakes.battery import Battery
from urbihw_nao_fakes.behaviours import Behaviours
from urbihw_nao_fakes.body import Body
from urbihw_nao_fakes.connection import Connection
from urbihw_nao_fakes.core import AutonomousLife, FrameManager, Logger
from urbihw_nao_fakes.dcm import Dcm
from urbihw_nao_fakes.directory import Directory
from urbihw_nao_fakes.leds import Leds
from urbihw_nao_fakes.memory import Memory
from urbihw_nao_fakes.motion import Motion
from urbihw_nao_fakes.posture import Posture
from urbihw_nao_fakes.server import Server
from urbihw_nao_fakes.services import Service
from urbihw_nao_fakes.sonar import Sonar
from urbihw_nao_fakes.speech import Recognition, Speech
from urbihw_nao_fakes.video import Video
from urbihw_nao_fakes.watchdog import Watchdog

UNIT = 0
"""The only unit there is, for faults."""


class Nao(Device):
    """A Nao with one client, or several (``receive_from``).

    Attributes:
        body: joints, walking, and what is around.
        services: by number; motion, memory, speech, recognition, audio, player, behaviours, leds, video: some of them.
        directory: services of the robot, and of clients.
        server: connections and messages.
        endpoint: what the directory says of where it is.
    """

    def __init__(self, user: str = "", password: str = "", *, body: Body | None = None) -> None:
        super().__init__()
        self.endpoint = "tcp://127.0.0.1:9559"
        self.body = body if body is not None else Body()
        self.server = Server(user, password, lambda data: self.faults.disturb(UNIT, data))
        self.services = self.server.services
        self.directory = Directory(self.server, lambda: self.endpoint)
        self.server.on_disconnect = self.directory.remove_services_of
        self.motion, self.memory = Motion(self.body), Memory(self.body, self.directory.call_service)
        self.speech, self.recognition = Speech(self.read_clock, self.memory), Recognition(self.memory)
        self.audio = AudioDevice(self.read_clock, self.directory.call_service)
        self.player = AudioPlayer(self.read_clock)
        self.behaviours, self.leds = Behaviours(self.body, self.read_clock), Leds()
        self.video = Video(self.body, self.read_clock)
        self.body.on_tip = self._manage_fall
        self.body.on_fall = lambda: self.memory.raise_event("robotHasFallen", 1)
        self._client = Connection()
        services: tuple[Service, ...] = (
            self.directory,  # the first, as it has number 1
            self.motion,
            Posture(self.body),
            self.memory,
            self.speech,
            self.recognition,
            self.audio,
            self.player,
            self.behaviours,
            self.leds,
            Battery(self.body),
            Sonar(self.memory),
            Dcm(self.body, self.read_clock),
            self.video,
            Logger(),
            FrameManager(),
            AutonomousLife(),
        )
        for service in services:
            self.server.add_service(service)

    def add_watchdog(self, program: Path) -> None:
        """Somebody has put urbihw's program on the robot.  Raises UnknownRequest."""
        self.server.add_service(Watchdog(program, self.motion, self._find_service))

    def _manage_fall(self) -> None:
        """It tips over: NAOqi's fall manager lets all motors go slack.  The arms do not protect it here."""
        if self.motion.fall_manager:
            self.body.slack()

    def _find_service(self, name: str) -> Service:
        """A service by its name.  Raises RuntimeError."""
        for each in self.services.values():
            if each.name == name:
                return each
        raise RuntimeError(f"Cannot find service '{name}' in index")

    def read_clock(self) -> float:
        """The robot's time, seconds."""
        return self.server.now

    # ---------------------------------------------------------------- connections

    def connect(self) -> Connection:
        """A client connects to the robot."""
        return self.server.connect()

    def disconnect(self, connection: Connection) -> None:
        """A client is gone; what it has begun goes on."""
        self.server.disconnect(connection)

    def reconnect(self) -> None:
        """The only client connects anew, where there is but one (``receive``)."""
        self.disconnect(self._client)
        self._client = self.connect()

    def receive(self, data: bytes, now: float) -> list[Answer]:
        """See `Device`: of the only client."""
        self.receive_from(self._client, data, now)
        return self.server.pop_answers(self._client)

    def receive_from(self, connection: Connection, data: bytes, now: float) -> None:
        """Bytes of a client; answers go to the server's ``unsent``."""
        self.advance(now)
        if self.body.powered:
            self.server.receive(connection, data)

    def tick(self, now: float) -> list[Answer]:
        self.advance(now)
        return self.server.pop_answers(self._client)

    def due(self) -> float | None:
        times = [time for time in (self.server.due(), self.body.due()) if time is not None]
        return min(times, default=None)

    def advance(self, now: float) -> None:
        """Let time pass until ``now``."""
        self.body.advance(now)
        self.server.advance(now)

    # ---------------------------------------------------------------- power

    def power_off(self, now: float, who: int | None = None) -> None:
        """See `Device`: the motors are slack; the services do not hear that the connections are gone."""
        self.body.advance(now)
        self.body.powered = False
        self.body.slack()
        self.body.drive((0.0, 0.0, 0.0))
        for connection in self.server.connections:
            connection.closed = True

    def power_on(self, now: float, who: int | None = None) -> None:
        """See `Device`: NAOqi has started, and knows of no connection."""
        self.body.advance(now)
        self.body.powered = True
        self.body.walk = [0.0, 0.0, 0.0]
        self.body.hold_joints()
        self.memory.sonars.clear()
        self.video.subscribers.clear()
