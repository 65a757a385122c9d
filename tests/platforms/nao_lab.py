"""A Nao in simulated time: see ``lab``; and what it says of its motion: see ``motions``."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

from lab import SpeakingLab
from motions import Kind, Motion, Numbers, OtherMaster
from slot_units import BATTERY, BUS, BUTTON, GAINS, MOBILE, PICTURE, Units, UnitTable

from urbihw.buses.link import Context
from urbihw.buses.pipe import PipeEnd
from urbihw_fakes.console import Console
from urbihw_fakes.device import Answer
from urbihw_nao.robot import Nao as NaoRobot
from urbihw_nao_fakes.behaviours import Behaviours
from urbihw_nao_fakes.body import Body
from urbihw_nao_fakes.connection import Connection
from urbihw_nao_fakes.console import commands
from urbihw_nao_fakes.device import Nao


class Door(PipeEnd):
    """The robot's port: one link gets the lab's own end, each further one at the same time an end of its own."""

    def __init__(self, lab: Lab) -> None:
        super().__init__()
        self._lab = lab
        self._busy = False

    @property
    def plugged(self) -> bool:
        return self._lab.end.plugged

    def accept(self) -> PipeEnd:
        if self._busy:
            return self._lab.add_connection()
        self._busy = True
        self._lab.end.on_close = self._leave
        return self._lab.end.accept()

    def _leave(self) -> None:
        self._busy = False


class Lab(SpeakingLab):
    """A robot at the end of a connection, or of several.

    Attributes:
        others: the ends of the second and later connections.
        delay: seconds that the robot's bytes take on those.
    """

    robot: NaoRobot
    device: Nao

    platform = "nao"
    url = "pipe://robot?baud=100000000"
    tick = 0.02

    def __init__(self, device: Nao | None = None, **options: Any) -> None:
        self.device = device if device is not None else Nao()
        self.seen: deque[tuple[float, tuple[float, ...]]] = deque(maxlen=4)
        """When the body was looked at last, and its joints then."""
        self.others: dict[PipeEnd, Connection] = {}
        self.delay = 0.0
        self.door = Door(self)
        super().__init__(**options)
        self.end.on_open = self._connected

    def _connected(self) -> None:
        self.end.hang_up()  # what was said on another connection is gone with it
        self.device.reconnect()

    def context(self) -> Context:
        return Context(self.bus_clock, {"robot": self.door})

    def add_connection(self) -> PipeEnd:
        """Another client, or another connection of the same one."""
        connection = self.device.connect()

        def receive(data: bytes, at: float) -> None:
            self.device.receive_from(connection, data, at)
            self._answer(())

        def leave() -> None:
            self.device.disconnect(connection)
            self.others.pop(end, None)

        end = PipeEnd(receive)
        end.on_close = leave
        self.others[end] = connection
        return end

    def _answer(self, answers: Iterable[Answer]) -> None:
        super()._answer(answers)
        for end, connection in self.others.items():
            for answer in self.device.server.pop_answers(connection):
                end.send(answer.data, answer.at + self.delay)

    def unplug(self) -> None:
        """The network is gone; what the robot was told goes on."""
        for end in list(self.others):
            end.unplug()
        self.end.unplug()
        self.device.reconnect()

    def console(self) -> Console:
        return self.console_of(self.device, self.end, commands(self.device, self.bus_clock.now))


def stand(body: Body) -> None:
    """Somebody has put it on its feet."""
    body.put_on_feet()


def _body(lab: Lab) -> tuple[Numbers, Numbers]:
    body, now = lab.device.body, lab.bus_clock.now()
    angles = tuple(joint.angle for joint in body.joints.values())
    # A motor goes from goal to goal at its full speed, so what counts is its way in some ticks.
    if not lab.seen or now > lab.seen[-1][0]:
        lab.seen.append((now, angles))
    since, before = lab.seen[0]
    elapsed = now - since
    speeds = [(angle - old) / elapsed if elapsed else 0.0 for angle, old in zip(angles, before, strict=True)]
    return (*speeds, body.walk[0], body.walk[2]), (*angles, body.x, body.heading)


def _stand(lab: Lab, folder: Path) -> None:
    stand(lab.device.body)
    lab.run(0.2)
    lab.seen.clear()  # it was put there, it did not move


def _swing_joint(lab: Lab) -> None:
    """Another client of ALMotion turns the head, by a call that lasts long."""
    joint = lab.device.body.joints["HeadYaw"]
    joint.stiffness = 1.0
    joint.order(-1.5 if joint.angle > 0 else 1.5, 0.1)


def _behave(lab: Lab) -> None:
    """Somebody starts a behaviour that moves an arm."""
    (manager,) = [each for each in lab.device.services.values() if isinstance(each, Behaviours)]
    lab.device.body.joints["RShoulderPitch"].stiffness = 1.0
    manager.start("animations/wave")


MOTION = Motion(
    make=Lab.ready,
    look=_body,
    slot="nao",
    unplug=Lab.unplug,
    plug=lambda lab: lab.end.replug(),
    revive="motors.load = 1",
    standstill=0.6,
    kinds={
        "joint": Kind("headYaw.val = -2 | headYaw.val = 2 | shoulderPitchL.val = -2;", 3.0, lead=0.1,
                      again="headYaw.val = -2; sleep(1s); headYaw.val = 2;"),
        "trajectory": Kind("headYaw.val = 0 sin:2s ampli:1,", 2.0, lead=2.3, live=True),
        "at": Kind(
            "trip!;", 3.0, lead=1.5, live=True,
            prepare='if (!Global.hasLocalSlot("trip")) var Global.trip = Event.new|;'
            " at (trip?) loop { headYaw.val = 0.5; sleep(200ms); headYaw.val = -0.5; sleep(400ms) };",
        ),
        "go": Kind("robot.go(2);", 0.05, error=True, ready=_stand),
        "turn": Kind("robot.turn(10);", 0.3, error=True, ready=_stand),
        "speeds": Kind("robot.xSpeed = 0.1;", 0.05, ready=_stand),
        "service": Kind("motion.moveTo(1.0, 0.0, 0.0);", 0.05, error=True, ready=_stand),
        "remote": Kind("HeadYaw.val = 2", 3.0, lead=0.1, again="HeadYaw.val = -2", remote=True),
    },
    others={
        "walk": OtherMaster(lambda lab: lab.device.body.drive((0.1, 0.0, 0.0)), 0.05, ready=_stand),
        "joint": OtherMaster(_swing_joint, 0.5),
        "behaviour": OtherMaster(_behave, 0.5),
    },
)  # fmt: skip


_NAO_MOTOR: Final[Units] = {"N m": "torque", "degC": "temperature", "1": GAINS}
UNITS: Final[UnitTable] = {
    "Nao": BUS | {"%": "volume"},
    "NaoJoint": _NAO_MOTOR | {"rad": "val angle requested applied", "turn": "turn", "ratio": "load"},
    "NaoHand": _NAO_MOTOR | {"ratio": "val requested applied load"},
    "NaoLed": {"ratio": "val r g b", "1": "rgb"},
    "NaoCamera": PICTURE | {"Hz": "rate",
                             "1": "load index format formatDetail threaded frames gain wb quality resolution"},
    "NaoMicro": {"ms": "duration", "ratio": "gain"},
    "NaoSpeaker": {"ms": "remain", "dB": "volume"},
    "NaoVoice": {"ratio": "volume", "1": "speed pitch"},
    "NaoSpeech": {"ratio": "confidence"},
    "NaoWalk": {"m/s": "xSpeed ySpeed requested applied", "rad/s": "yawSpeed", "m": "x y", "rad": "theta"},
    "NaoMotorControl": {"s": "dcmShift"},
    **{f"sonar{side}": {"m": "val distance"} for side in "LR"},
    **{f"accel{axis}": {"m/s^2": "val acceleration"} for axis in "XYZ"},
    **{f"gyro{axis}": {"rad/s": "val speed"} for axis in "XY"},
    **{f"headSensor{place}": BUTTON for place in "FMR"},
    "NaoBumper": BUTTON,
    "NaoBattery": BATTERY,
    "NaoFsr": {"1": "val left right", "kg": "leftFootTotalWeight rightFootTotalWeight"},
    "robot": MOBILE | {"rad/s": MOBILE["rad/s"] + " blendSpeed"},
}  # fmt: skip
