"""How fast the body of a joint or a wheel gets, whatever happens to it: real daemons before simulated servos.

For ``bench/safety.py``; in simulated time ``tests/platforms/test_bounded_by_body.py`` tests the same for more models.
"""

from __future__ import annotations

import math
import signal
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from faults_lab import Client, Daemon, Watcher, wait_for
from moving_robots import Look

from urbihw_fakes.bioloid import Bioloid
from urbihw_fakes.chain.parts import chain_of
from urbihw_fakes.dynamixel.ax12 import DEGREES
from urbihw_fakes.dynamixel.xseries import XSeries
from urbihw_fakes.dynamixel.xtables import STEPS
from urbihw_fakes.endpoint import PtyEndpoint
from urbihw_fakes.feetech.servo import FeetechServo
from urbihw_fakes.serving import Endpoint

_HOLDS = "{var t = time| while| (time < t + 0.8) {}},"


@dataclass(frozen=True)
class Body:
    """A simulated servo: how fast its horn turns, ``hold`` holds it or lets it go, ``turn`` turns it by hand, rad."""

    end: Endpoint
    look: Look
    hold: Callable[[bool], None]
    turn: Callable[[float], None]


@dataclass(frozen=True)
class ServoRig:
    """A kit with one servo, number 1; ``wheel`` makes it a wheel."""

    name: str
    make: Callable[[], Body]
    platform: str = "bioloid"
    wheel: str = "motor1.cwLimit = motor1.ccwLimit = 0;"


@dataclass(frozen=True)
class BoundCase:
    """A joint or a wheel under way: what is said, what happens, and the speed in rad/s that it may have.

    ``WHEEL;`` and ``ROBOT`` in what is said stand for words of the robot.
    """

    name: str
    go: str
    told: float
    happens: Callable[[Bench], None]
    limits: str = ""


@dataclass
class Bench:
    """The processes of one case."""

    folder: Path
    body: Body
    daemon: Daemon
    client: Client
    watcher: Watcher
    go: str


def _ax() -> Body:
    kit = Bioloid(servos=(1,), sensors=(), baud=1_000_000)
    end, servo = PtyEndpoint(kit), kit.servo(1)

    def look() -> float:
        kit.tick(end.clock())
        return math.radians(abs(servo.speed) * DEGREES)

    def turn(way: float) -> None:
        servo.position += way / math.radians(DEGREES)

    return Body(end, look, lambda held: setattr(servo, "held", held), turn)


def _x() -> Body:
    kit = Bioloid.x_series(1, baud=1_000_000)
    end, servo = PtyEndpoint(kit), kit[1]
    assert isinstance(servo, XSeries)

    def look() -> float:
        kit.tick(end.clock())
        return abs(servo.motor.speed) * math.tau / STEPS

    def turn(way: float) -> None:
        servo.motor.position += way / math.tau * STEPS

    return Body(end, look, lambda held: setattr(servo.motor, "held", held), turn)


def _sts() -> Body:
    kit = chain_of("STS3215:1")
    unit = kit[1]
    assert isinstance(unit, FeetechServo)
    unit.set_baud(1_000_000)
    end, motor = PtyEndpoint(kit), unit.motor

    def look() -> float:
        kit.tick(end.clock())
        return abs(motor.speed) * math.tau / unit.steps

    def turn(way: float) -> None:
        motor.turn(way / math.tau * unit.steps)

    return Body(end, look, lambda held: setattr(motor, "held", held), turn)


def _let_go(bench: Bench) -> None:
    end, hold = bench.body.end, bench.body.hold
    end.call(lambda: hold(True))
    bench.client.say(bench.go)
    time.sleep(1.8)
    end.call(lambda: hold(False))
    time.sleep(2.0)


def _turn_away(bench: Bench) -> None:
    """A hand turns the joint by 0.8 rad in 0.4 s, and lets it go, twice."""
    end, body = bench.body.end, bench.body
    bench.client.say(bench.go)
    time.sleep(1.5)
    bench.watcher.samples.clear()
    for held in (0.0, 0.5):
        end.call(lambda: body.hold(True))
        for _ in range(40):
            end.call(lambda: body.turn(0.02))
            time.sleep(0.01)
        time.sleep(held)
        end.call(lambda: body.hold(False))
        time.sleep(1.5)


def _cut_power(bench: Bench) -> None:
    """The servo is without power for 50 ms, and then gets another goal."""
    end = bench.body.end
    bench.client.say(bench.go)
    time.sleep(1.5)
    bench.watcher.samples.clear()
    end.call(lambda: end.device.power_off(end.clock()))
    time.sleep(0.05)
    end.call(lambda: end.device.power_on(end.clock()))
    time.sleep(0.3)
    bench.client.say("motor1.load = 1; motor1.val = -0.9;")
    time.sleep(2.0)


def _neighbour(bench: Bench) -> None:
    bench.client.say(bench.go)
    other = Client(bench.daemon.port)
    for _ in range(2):
        time.sleep(0.4)
        other.say(_HOLDS)
        time.sleep(0.8)
    time.sleep(1.0)
    other.close()


def _reload(bench: Bench) -> None:
    bench.client.say(bench.go)
    time.sleep(0.5)
    config = bench.folder / "config.toml"
    config.write_text(config.read_text() + "[limits]\nspeed = 1.0\n")
    bench.daemon.process.send_signal(signal.SIGHUP)
    wait_for(lambda: "settings read again" in bench.daemon.log(), "the new settings")
    time.sleep(0.3)
    bench.watcher.samples.clear()
    time.sleep(1.0)


BOUND_RIGS = (
    ServoRig("AX-12", _ax), ServoRig("XL430", _x), ServoRig("STS3215", _sts, "chain", 'motor1.mode = "wheel";'),
)  # fmt: skip
_WHEEL = "WHEEL; sleep(0.5s); motor1.speed = 4;"
_STAND = "motor1.val = 0.2; sleep(0.8s);"
_LIMIT = '[limits]\nspeed = 1.0\n[options]\noverspeed = "tell"\n'
BOUND_CASES = (
    BoundCase("held joint let go, limit of 1 rad/s", "motor1.val = 0.9;", 1.0, _let_go, _LIMIT),
    BoundCase("held joint let go, `speed:0.5`", "motor1.val = 0.9 speed:0.5,", 0.5, _let_go),
    BoundCase("standing joint turned by hand and let go, limit of 1 rad/s", _STAND, 1.0, _turn_away, _LIMIT),
    BoundCase("the same, while an emergency stop holds", f"{_STAND} ROBOT.estop = true;", 0.0, _turn_away, _LIMIT),
    BoundCase("power cut for 50 ms, `motor1.speed = 1`", "motor1.speed = 1; motor1.val = 0.9;", 1.0, _cut_power),
    BoundCase("neighbour holds the interpreter 0.8 s, `speed:0.5`", "motor1.val = 1.5 speed:0.5,", 0.5, _neighbour),
    BoundCase("neighbour holds the interpreter 0.8 s, `smooth:4s`", "motor1.val = 1.5 smooth:4s,", 0.59, _neighbour),
    BoundCase("limits reloaded: 1 rad/s for a wheel at 4", _WHEEL, 1.0, _reload),
)


def measure_peak(rig: ServoRig, case: BoundCase) -> float:
    """Return the highest speed of the body in rad/s, each time over ``faults_lab.SPAN``."""
    with tempfile.TemporaryDirectory(prefix="bounds-") as name, ExitStack() as stack:
        body = rig.make()
        stack.enter_context(body.end)
        body.end.start()
        folder = Path(name)
        daemon = Daemon(folder, rig.platform, body.end.url, case.limits)
        stack.callback(daemon.close)
        client = Client(daemon.port)
        stack.callback(client.close)
        client.say('motor1.load = 1; sleep(0.5s); echo("ready");')
        client.wait("ready")
        watcher = Watcher(body.end, body.look)
        stack.callback(watcher.close)
        go = case.go.replace("WHEEL;", rig.wheel).replace("ROBOT", rig.platform)
        case.happens(Bench(folder, body, daemon, client, watcher, go))
        return watcher.peak(0.0)
