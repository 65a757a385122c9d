"""The driver of the wire by itself: one telegram in flight, slow and bad links, what is said and what is not."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from driver_rig import START, DriverRig

from urbihw.buses import messages as m
from urbihw.buses.errors import LinkGone, Unavailable
from urbihw.platforms.nxt.driver import NxtDriver
from urbihw.platforms.nxt.exchange import MAX_MISSED_REPLIES
from urbihw_fakes.nxt.stream import NxtDevice
from urbihw_fakes.nxt.tribot import TriBot

TICK = 0.01


class Rig(DriverRig):
    """A driver on a link to a TriBot; ``delay`` seconds are added to each reply."""

    driver_class = NxtDriver
    url = "pipe://robot"
    tick = TICK
    driver: NxtDriver
    device: NxtDevice

    def __init__(self, delay: float = 0.0, **settings: Any) -> None:
        super().__init__(NxtDevice(TriBot()), **settings)
        self.brick = self.device.brick
        self.delay = delay
        self.sent: list[bytes] = []
        self.unanswered = 0
        self.most_in_flight = 0

    def run_ticks(self, count: int) -> list[m.FromWorker]:
        """Some ticks; all that they brought."""
        news: list[m.FromWorker] = []
        for _ in range(count):
            start = self.clock.now()
            news += self.driver.tick(start, lambda: None)
            assert self.clock.now() <= start + TICK, "a tick took longer than it lasts"
            self.clock.sleep_until(start + TICK)
        return news

    def values(self, ticks: int, device: Any, item: str) -> list[Any]:
        """The values of an item that some ticks bring."""
        found = [news.values.get(device, {}).get(item) for news in self.run_ticks(ticks) if isinstance(news, m.Samples)]
        return [value for value in found if value is not None]

    def receive(self, data: bytes, at: float) -> None:
        self.sent.append(data[2:])
        answers = self.device.feed(data, at)
        if not data[2] & 0x80:
            self.unanswered += 1
            self.most_in_flight = max(self.most_in_flight, self.unanswered)
        for answer in answers:
            self.end.send(answer.data, answer.at + self.delay)
            if not self.delay:
                self.unanswered -= 1

    def take_sent(self) -> list[str]:
        """What was sent since the last call, in hex."""
        sent, self.sent = self.sent, []
        return [telegram.hex(" ") for telegram in sent]


@pytest.fixture
def rig() -> Rig:
    made = Rig()
    (found,) = made.attach().news
    assert isinstance(found, m.Found)
    made.take_sent()
    return made


def aim(rig: Rig, **values: Any) -> list[m.FromWorker]:
    """Targets such as ``A_power=50``; brick_tone, n1_mode."""
    keys = {"n1": 1, "n2": 2, "n3": 3, "n4": 4}
    split = [name.split("_") for name in values]
    places = [(keys.get(device, device), item) for device, item in split]
    targets = dict(zip(places, values.values(), strict=True))
    return rig.driver.targets(m.Targets(targets))


def test_attaching_meets_the_brick_and_touches_nothing() -> None:
    rig = Rig()
    (message,) = rig.attach().news
    assert isinstance(message, m.Found)
    (brick,) = message.devices
    assert (brick.name, brick.address, brick.firmware, brick.protocol) == ("NXT", "00:16:53:01:02:03", "1.29", "1.124")
    assert (brick.free, brick.sleep_limit) == (65536, 600.0)
    assert rig.take_sent() == ["01 88", "01 9b", "00 0d"]


def test_targets_go_out_together_and_what_a_motor_has_is_not_said_again(rig: Rig) -> None:
    aim(rig, A_power=50, C_power=-50)
    aim(rig, A_power=60)
    rig.run_ticks(1)
    assert rig.take_sent() == ["80 04 02 ce 07 01 00 20 00 00 00 00", "80 04 00 3c 07 01 00 20 00 00 00 00"]
    aim(rig, A_power=60, C_power=-50)
    rig.run_ticks(1)
    assert rig.take_sent() == []
    aim(rig, A_coast=True)
    rig.run_ticks(1)
    assert rig.take_sent() == ["80 04 00 00 00 00 00 00 00 00 00 00"]


def test_one_telegram_is_in_flight(rig: Rig) -> None:
    for motor in "ABC":
        rig.driver.watch(m.Watch(motor, ("rotation",), 0.0), rig.clock.now())
    aim(rig, n1_mode=(1, 0x20), n2_mode=(11, 0))
    rig.driver.watch(m.Watch(2, ("distance",), 0.05), rig.clock.now())
    rig.run_ticks(50)
    assert rig.most_in_flight == 1


def test_a_slow_link_makes_readings_rarer_and_targets_no_later_than_a_reply() -> None:
    rig = Rig(delay=0.03)
    rig.attach()
    for motor in "ABC":
        rig.driver.watch(m.Watch(motor, ("rotation",), 0.0), rig.clock.now())
    rig.take_sent()
    news = rig.run_ticks(100)
    samples = [each for each in news if isinstance(each, m.Samples)]
    # 1 s, 31 ms each: all three motors in turn.
    assert 25 <= len(samples) <= 33
    assert {device for each in samples for device in each.values} == {"A", "B", "C"}
    aim(rig, A_power=50)
    rig.run_ticks(4)
    assert rig.brick.motor("A").power == 50


def test_targets_do_not_wait_for_a_lost_reply(rig: Rig) -> None:
    rig.driver.watch(m.Watch("B", ("rotation",), 0.0), rig.clock.now())
    aim(rig, A_power=50)
    rig.run_ticks(2)
    rig.device.faults.start("silence")
    rig.run_ticks(2)
    rig.device.faults.stop()
    aim(rig, A_power=0)
    rig.run_ticks(9)
    assert rig.brick.motor("A").power == 0
    assert rig.driver.errors()["timeouts"] == 0


def test_a_slow_reply_is_not_taken_for_the_next(rig: Rig) -> None:
    rig.driver.watch(m.Watch("B", ("rotation",), 0.0), rig.clock.now())
    rig.brick.motor("B").count(0, 0, 77)
    rig.device.faults.start("late", amount=1.6, times=1)
    assert set(rig.values(400, "B", "rotation")) == {77}
    assert rig.driver.errors()["timeouts"] == 1


def test_a_reply_about_another_port_is_thrown_away(rig: Rig) -> None:
    rig.driver.watch(m.Watch("B", ("rotation",), 0.0), rig.clock.now())
    rig.run_ticks(1)
    rig.end.send(bytes.fromhex("19 00 02 06 00 00") + bytes(21), rig.clock.now() + 0.0001)
    before = rig.driver.errors()
    assert set(rig.values(5, "B", "rotation")) == {0}
    assert rig.driver.errors() == before


@pytest.mark.parametrize("noise", ["ff ff", "00 00", "03 00 02 77 00", "05 00 02", "02 00 02 06"])
def test_garbage_is_got_over(rig: Rig, noise: str) -> None:
    rig.driver.watch(m.Watch("A", ("rotation",), 0.0), rig.clock.now())
    rig.run_ticks(3)
    rig.end.send(bytes.fromhex(noise), rig.clock.now() + 0.0001)
    rig.run_ticks(400)
    assert rig.values(3, "A", "rotation") == [0, 0, 0]


def test_something_that_babbles_is_given_up() -> None:
    rig = Rig()
    for number in range(20_000):
        rig.end.send(bytes(4096), rig.clock.now() + number * 1e-4)
    with pytest.raises((Unavailable, LinkGone)):
        rig.attach()
    assert rig.clock.now() < START + 10


def test_a_brick_that_falls_silent_is_gone_after_some_tries(rig: Rig) -> None:
    rig.driver.watch(m.Watch("A", ("rotation",), 0.0), rig.clock.now())
    rig.device.faults.start("silence")
    with pytest.raises(LinkGone, match="the brick does not answer any more; is it switched off"):
        rig.run_ticks(int(MAX_MISSED_REPLIES * 1.6 / TICK))


def test_a_brick_that_was_off_too_shortly_to_be_missed_has_forgotten_its_motors(rig: Rig) -> None:
    rig.driver.watch(m.Watch("A", ("rotation",), 0.0), rig.clock.now())
    aim(rig, A_goal=-60)
    rig.run_ticks(300)
    rig.device.power_off(rig.clock.now())
    rig.run_ticks(20)
    rig.device.power_on(rig.clock.now())
    with pytest.raises(LinkGone, match="switched off and on"):
        rig.run_ticks(300)
    assert rig.brick.motor("A").power == 0


def test_who_moves_a_motor_by_a_telegram_has_it(rig: Rig) -> None:
    rig.driver.watch(m.Watch("A", ("rotation",), 0.0), rig.clock.now())
    aim(rig, A_goal=-60)
    rig.run_ticks(300)
    coast = bytes.fromhex("04 00 00 00 00 00 00 00 00 00 00")
    rig.driver.request(m.Request(1, "write", "brick", "silent", coast))
    rig.brick.motor("A").count(0, 0, 30)
    rig.run_ticks(100)
    assert rig.brick.motor("A").power == 0


def test_nobody_answers() -> None:
    rig = Rig()
    rig.device.faults.start("silence")
    with pytest.raises(Unavailable, match="no NXT answers"):
        rig.attach()


def test_what_is_refused_is_told(rig: Rig) -> None:
    (refused,) = aim(rig, A_power=101)
    assert isinstance(refused, m.Refused) and "101 is no power for port 'A'" in refused.reason
    for values in ({"A_tone": (440, 0)}, {"n1_power": 3}, {"brick_tone": (100, 10)}, {"A_goal": float("inf")}):
        (refused,) = aim(rig, **values)
        assert isinstance(refused, m.Refused)
    (refused,) = rig.driver.watch(m.Watch("A", ("distance",), 0.0), 0.0)
    assert isinstance(refused, m.Refused) and refused.reason == "port 'A' of an NXT has no 'distance'"
    rig.run_ticks(2)
    assert rig.take_sent() == []


def replied(rig: Rig, verb: str, device: Any, item: str, value: Any = 0) -> m.Reply:
    (reply,) = rig.driver.request(m.Request(7, verb, device, item, value))
    assert isinstance(reply, m.Reply) and reply.reply_id == 7
    return reply


def test_requests(rig: Rig) -> None:
    assert replied(rig, "read", "brick", "millivolts").value == 7890
    assert replied(rig, "write", "brick", "telegram", b"\x0b").value == bytes.fromhex("0b 00 d2 1e")
    assert replied(rig, "write", "brick", "silent", b"\x03\xb8\x01\xf4\x01").ok
    rig.brick.motor("B").count(0, 0, 500)
    assert replied(rig, "write", "B", "rotation").ok
    assert rig.brick.motor("B").rotation == 0
    failed = replied(rig, "read", "A", "weight")
    assert not failed.ok and "has no 'weight' to read" in failed.error
    aim(rig, n2_mode=(11, 0))
    rig.run_ticks(20)
    assert replied(rig, "write", 2, "i2c", (b"\x02\x08", 4)).value == b"LEGO"
    assert "no sensor answers" in replied(rig, "write", 2, "i2c", (b"\x04\x08", 4)).error
    assert "not set up" in replied(rig, "write", 1, "i2c", (b"\x02\x08", 4)).error


def test_the_brick_is_told_to_stay_awake_once_a_minute(rig: Rig) -> None:
    rig.run_ticks(18_100)
    assert rig.take_sent() == ["80 0d"] * 3


STOPS: list[tuple[bool, str]] = [
    (False, "00 04 ff 00 07 01 00 20 00 00 00 00"),
    (True, "00 04 ff 00 00 00 00 00 00 00 00 00"),
]


@pytest.mark.parametrize(("let_go", "telegram"), STOPS)
def test_the_safe_stop_is_confirmed(let_go: bool, telegram: str) -> None:
    rig = Rig(torque_off_on_stop=let_go)
    rig.attach()
    aim(rig, A_power=50, B_goal=1000)
    rig.driver.watch(m.Watch("B", ("rotation",), 0.0), rig.clock.now())
    rig.run_ticks(5)
    rig.take_sent()
    rig.driver.safe_stop()
    assert rig.take_sent() == [telegram, "80 0c", "80 01", f"8{telegram[1:]}"]
    rig.run_ticks(20)
    assert [motor.power for motor in rig.brick.motors] == [0, 0, 0]


def test_a_stop_that_is_not_confirmed_is_owed(rig: Rig) -> None:
    rig.device.faults.start("silence", times=2)
    with pytest.raises(LinkGone, match="did not confirm that it stopped"):
        rig.driver.safe_stop()


def test_what_we_had_moved_is_stopped_when_the_link_is_back(rig: Rig) -> None:
    aim(rig, A_power=50)
    rig.run_ticks(1)
    rig.driver.detach()
    assert aim(rig, B_power=30) == []
    rig.take_sent()
    rig.attach()
    rig.driver.stop_on_reconnect()
    assert rig.take_sent()[-4:-2] == [STOPS[0][1], "80 0c"]
    rig.run_ticks(3)
    assert [motor.power for motor in rig.brick.motors] == [0, 0, 0]


def test_without_a_link_nothing_is_done() -> None:
    driver = NxtDriver()
    assert driver.tick(0.0, lambda: None) == []
    assert driver.targets(m.Targets({("A", "power"): 30})) == []
    assert driver.request(m.Request(1, "read", "brick", "millivolts")) == [m.Reply(1, False, error="the link is down")]
    driver.safe_stop()
    assert driver.errors() == {}


def test_watches_outlive_the_link(rig: Rig) -> None:
    rig.driver.watch(m.Watch("brick", ("millivolts",), 0.0), rig.clock.now())
    assert rig.values(2, "brick", "millivolts") == [7890, 7890]
    rig.driver.detach()
    rig.attach()
    assert rig.values(2, "brick", "millivolts") == [7890, 7890]
    rig.driver.watch(m.Watch("brick", ("millivolts",), None), rig.clock.now())
    assert rig.values(2, "brick", "millivolts") == []


def test_a_device_is_read_once_a_tick_or_at_its_own_pace(rig: Rig) -> None:
    rig.driver.watch(m.Watch("A", ("rotation",), 0.0), rig.clock.now())
    rig.driver.watch(m.Watch("brick", ("millivolts",), 0.05), rig.clock.now())
    rig.run_ticks(20)
    sent = rig.take_sent()
    assert (sent.count("00 06 00"), sent.count("00 0b")) == (20, 4)


def test_meanwhile_is_called_while_a_reply_is_awaited(rig: Rig) -> None:
    calls: list[int] = []
    note: Callable[[], None] = lambda: calls.append(len(rig.sent))  # noqa: E731
    rig.driver.watch(m.Watch("A", ("rotation",), 0.0), rig.clock.now())
    rig.driver.tick(rig.clock.now(), note)
    assert calls == [1]
