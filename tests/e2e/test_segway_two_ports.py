"""The real daemon with a base on two CAN adapters, and with the two halves of an RMP 400.  On the real clock."""

from __future__ import annotations

import contextlib
import threading
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_serve import Daemon, until

from urbihw_fakes.can.device import CanDevice
from urbihw_fakes.can.node import CanFrame, CanNode, Timed
from urbihw_fakes.can.slcan import Slcan
from urbihw_fakes.can.slcan_pty import SlcanPty
from urbihw_fakes.segway.frames import TRACTOR
from urbihw_fakes.segway.rmp import SegwayRmp

pytestmark = pytest.mark.e2e


class Channel(CanNode):
    """One of the buses of a base: each frame of the base is on all of them."""

    def __init__(self, base: SegwayRmp, lock: threading.Lock, all_of: list[Channel]) -> None:
        self.base, self._lock, self._all = base, lock, all_of
        self._queue: deque[Timed] = deque(maxlen=1000)
        all_of.append(self)

    def receive_frame(self, frame: CanFrame, now: float) -> list[Timed]:
        with self._lock:
            return self.base.receive_frame(frame, now)

    def due(self) -> float | None:
        return self.base.due()

    def tick(self, now: float) -> list[Timed]:
        with self._lock:
            sent = self.base.tick(now)
            for channel in self._all:
                channel._queue.extend(sent)
            mine = list(self._queue)
            self._queue.clear()
            return mine

    def power_off(self, now: float, who: int | None = None) -> None:
        self.base.power_off(now)

    def power_on(self, now: float, who: int | None = None) -> None:
        self.base.power_on(now)


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., Daemon]]:
    with contextlib.ExitStack() as stack:

        def start(first: SlcanPty, **options: str) -> Daemon:
            settings = tmp_path / "segway.toml"
            lines = [f'{name} = "{value}"' for name, value in options.items()]
            settings.write_text("\n".join(["[options]", *lines, ""]))
            arguments = ("--config", str(settings), "--platform", "segway", "--quiet", "--url", first.url)
            return stack.enter_context(contextlib.closing(Daemon(tmp_path, *arguments)))

        yield start


def test_a_base_on_two_channels_loses_one_and_drives_on(serve: Callable[..., Daemon]) -> None:
    base, lock, buses = SegwayRmp(mode=TRACTOR), threading.Lock(), list[Channel]()
    with SlcanPty(CanDevice(Channel(base, lock, buses), Slcan())) as first, \
            SlcanPty(CanDevice(Channel(base, lock, buses), Slcan())) as second:  # fmt: skip
        first.start()
        second.start()
        daemon = serve(first, second_channel=second.url)
        client = daemon.client()
        client.say("rmp.forwardSpeed = 0.5|;")
        until(lambda: base.body.speed > 0.49)
        first.unplug()
        until(lambda: "the first channel does not work" in daemon.log())
        assert client.ask("segway.state;") == '"ok"'
        assert base.body.speed > 0.49
        first.plug()
        until(lambda: "the first channel works again" in daemon.log())
        second.unplug()
        until(lambda: "the second channel does not work" in daemon.log())
        assert client.ask("segway.state;") == '"ok"'
        assert base.body.speed > 0.49
        client.say("rmp.forwardSpeed = 0|;")
        until(lambda: base.body.speed == 0.0)


def test_the_halves_of_an_rmp_400_drive_and_stop_together(serve: Callable[..., Daemon]) -> None:
    front, back = SegwayRmp("400", mode=TRACTOR), SegwayRmp("400", mode=TRACTOR)
    with SlcanPty(CanDevice(front, Slcan())) as first, SlcanPty(CanDevice(back, Slcan())) as second:
        first.start()
        second.start()
        daemon = serve(first, model="400", second_base=second.url)
        client = daemon.client()
        client.say("rmp.forwardSpeed = 0.5|;")
        until(lambda: front.body.speed > 0.49 and back.body.speed > 0.49)
        second.unplug()
        until(lambda: front.body.speed == 0.0 and back.body.speed == 0.0)
        assert front.last_command == (0, 0)
        second.plug()
        until(lambda: client.ask("segway.state;") == '"ok"')
        client.say("rmp.forwardSpeed = 0.3|;")
        until(lambda: front.body.speed > 0.29 and back.body.speed > 0.29)
        daemon.process.kill()
        until(lambda: front.body.speed == 0.0 and back.body.speed == 0.0)
