"""Subscriptions beside clients that do not read, come and go; jobs, tags and the log as texts for panels."""

from __future__ import annotations

import json
import logging
from typing import Any

import pytest

from urbihw.kernel import Kernel
from urbihw.kernel.lobby.lobby import Lobby
from urbihw.kernel.server.log_tap import MAX_PENDING, LogTap
from urbihw.robot import ROBOT_LIBRARY

SLOTS = ", ".join(f'"m{number}"' for number in range(100))
VARIABLES = "".join(f"var Global.m{number} = {number}.25;" for number in range(100))


class Client:
    """A client whose connection takes nothing while ``deaf``, like one whose network is down."""

    def __init__(self, kernel: Kernel) -> None:
        self.kernel = kernel
        self.lobby: Lobby = kernel.open_lobby()
        self.lobby.output.give_up = self._given_up
        self.lobby.output.unread = lambda: self._unread
        self.deaf = False
        self.lost = False
        self._unread = 0
        self._text = ""

    def say(self, text: str, seconds: float = 0.0) -> None:
        """Send a program, and let time pass."""
        self.kernel.feed(self.lobby, text.encode())
        end = self.kernel.clock.now() + seconds
        while True:
            self.kernel.scheduler.run_simulated(min(self.kernel.clock.now() + 0.05, end))
            data = self.lobby.output.take_bytes()
            if self.deaf:
                self._unread += len(data)
            self._text += data.decode()
            if self.kernel.clock.now() >= end - 1e-9:
                return

    def hear(self) -> list[str]:
        """The lines so far, without time stamps."""
        lines = [line.partition("] ")[2] for line in self._text.splitlines()]
        self._text = ""
        return lines

    def hear_again(self) -> None:
        """Take everything from now on."""
        self.deaf = False
        self._unread = 0
        self.lobby.output.update_unread()

    def samples(self) -> list[dict[str, Any]]:
        """The samples so far."""
        told = [json.loads(line) for line in self.hear() if line.startswith("{")]
        return [sample for sample in told if "n" in sample]

    def _given_up(self, unread: int) -> None:
        self.lost = True


@pytest.fixture
def kernel() -> Kernel:
    made = Kernel(fast=True, libraries=(ROBOT_LIBRARY,))
    made.complete()
    return made


def test_a_client_that_does_not_read_loses_samples_and_is_told_how_many(kernel: Kernel) -> None:
    client = Client(kernel)
    client.say(VARIABLES)
    client.say(f'var s = Subscription.new("T", [{SLOTS}], 50)|;', 1.0)
    assert client.samples()[-1]["n"] == pytest.approx(51, abs=1)
    client.deaf = True
    client.say("", 60.0)
    queued = client.samples()
    assert len(json.dumps(queued)) < 100_000, "nothing queues up"
    assert not client.lost
    client.hear_again()
    client.say("", 1.0)
    first, *_, last = client.samples()
    assert first["lost"] == pytest.approx(60 * 50 - len(queued), abs=2)
    assert last["n"] - last["lost"] == pytest.approx(51 + len(queued) + 50, abs=3)
    assert last["v"] == [number + 0.25 for number in range(100)]


def test_one_client_that_does_not_read_delays_no_other(kernel: Kernel) -> None:
    deaf, other = Client(kernel), Client(kernel)
    deaf.say(VARIABLES)
    deaf.deaf = True
    deaf.say(f'var s = Subscription.new("T", [{SLOTS}], 50)|;', 10.0)
    other.say('var s = Subscription.new("T", ["m1"], 50)|;')
    for _ in range(20):
        deaf.say("", 0.05)
        other.say("")
    assert other.samples()[-1]["lost"] == 0


def test_a_subscription_ends_with_its_connection_whatever_its_tags(kernel: Kernel) -> None:
    client, other = Client(kernel), Client(kernel)
    client.say('var x = 1; disown(Subscription.new("A", ["x"], 50)); Subscription.new("B", ["x"], 50)|; '
               'function slow() { sleep(1h) }; get y() { slow }; Subscription.new("C", ["y"], 50)|;', 1.0)
    before = kernel.scheduler.shares.of(client.lobby)
    client.lobby.close()
    other.say("", 3.0)
    assert before > 3
    assert kernel.scheduler.shares.of(client.lobby) == 0
    assert client.lobby.holdings.held() == []


def test_the_number_of_subscriptions_is_bounded_and_comes_back(kernel: Kernel) -> None:
    client = Client(kernel)
    client.say('var x = 1; for (var i : 70) Subscription.new("S%s" % i, ["x"], 1)|;', 0.1)
    assert "too many subscriptions: this connection has 64; close one" in "\n".join(client.hear())
    client.say("for (var s : lobby.subscriptions) s.stop|; lobby.subscriptions.size;", 0.1)
    assert "0" in client.hear()
    client.say('Subscription.new("S", ["x"], 1).running;', 0.1)
    assert "true" in client.hear()


def test_a_value_that_is_too_long_or_too_deep_is_null_with_a_reason(kernel: Kernel) -> None:
    client = Client(kernel)
    client.say('var big = "x" * 100000|; var round = []|; round << round|; var fan = [1, 2, 3, 4, 5, 6, 7, 8]|; '
               "for (8) fan = [fan, fan, fan, fan]|; "
               'Subscription.new("T", ["big", "round", "fan"], 10)|;', 0.05)
    lines = [json.loads(line) for line in client.hear() if line.startswith("{")]
    assert [line["text"] for line in lines if "error" in line] == [
        "the value is longer than 65536 characters",
        "the value nests deeper than 20",
        "the value is longer than 65536 characters",
    ]
    assert lines[-1]["v"] == [None, None, None]


def test_a_getter_that_stops_its_own_subscription_or_loops_harms_no_other(kernel: Kernel) -> None:
    client = Client(kernel)
    client.say('var n = 0|; var s = nil|; get self() { n++ | if (n == 3) s.stop | n };'
               's = Subscription.new("A", ["self"], 10)|; get busy() { loop { sleep(1ms) } };'
               'Subscription.new("B", ["busy", "n"], 10)|;', 1.0)
    samples = client.samples()
    assert [sample["v"] for sample in samples if len(sample["v"]) == 1] == [[1.0], [2.0]]
    assert len([sample for sample in samples if sample["v"] == [None, 3.0]]) >= 6
    client.say("s.running;", 0.1)
    assert "false" in client.hear()


# ---------------------------------------------------------------- jobs and tags


def jobs(client: Client) -> dict[str, Any]:
    client.hear()
    client.say("lobby.send(System.jobsText)|;")
    (line,) = (line for line in client.hear() if line.startswith("{"))
    told: dict[str, Any] = json.loads(line)
    return told


def test_jobs_and_tags_of_all_connections_are_told_and_can_be_stopped_by_another(kernel: Kernel) -> None:
    worker, panel = Client(kernel), Client(kernel)
    worker.say("var Global.turns = 0|; swing: loop { sleep(0.1s) | Global.turns++ },", 0.05)
    worker.say("var e = Event.new|; var h = Tag.new(\"hear\")|; h: at (e?) echo(1);\nsleep(1h),", 0.05)
    told = jobs(panel)
    hour, swing = sorted(told["jobs"], key=lambda job: len(job["tags"]))
    assert (swing["tags"], swing["state"], swing["lobby"], swing["in"]) == (["swing"], "sleeping", "Lobby_1", "sleep")
    assert swing["line"].startswith("1.")
    assert hour["until"] == pytest.approx(3600, abs=1)
    tags = {tag["name"]: tag for tag in told["tags"]}
    assert (tags["swing"]["jobs"], tags["swing"]["lobbies"], tags["hear"]["handlers"]) == (1, ["Lobby_1"], 1)

    panel.say(f'System.controlTag("{tags["swing"]["id"]}", "freeze");', 0.1)
    panel.say("turns;")
    before = panel.hear()[-1]
    panel.say("turns;", 1.0)
    assert panel.hear()[-1] == before
    assert {job["frozen"] for job in jobs(panel)["jobs"]} == {False, True}
    panel.say(f'System.controlTag("{tags["swing"]["id"]}", "unfreeze");', 1.0)
    panel.say("turns;")
    assert panel.hear()[-1] != before
    panel.say(f'System.controlTag("{tags["swing"]["id"]}", "stop"); System.stopJob("{hour["id"]}");', 0.1)
    assert jobs(panel)["jobs"] == []
    panel.say(f'System.controlTag("{tags["swing"]["id"]}", "stop"); System.stopJob("{hour["id"]}");', 0.1)
    errors = [line.partition(": ")[2] for line in panel.hear() if line.startswith("!!!")]
    assert errors == [
        f"controlTag: no tag {tags['swing']['id']}: nothing runs under it", f"stopJob: no job {hour['id']}: it is over"
    ]  # fmt: skip


# ---------------------------------------------------------------- the log


def test_the_log_is_told_with_its_fields_and_by_an_event(kernel: Kernel) -> None:
    client = Client(kernel)
    tap = LogTap(kernel.post, kernel.programs.log.add)
    tap.attach()
    log = logging.getLogger("urbihw.test")
    try:
        client.say('at (System.logged?(var entry)) echo(entry["text"]);')
        log.warning("servo %d is lost", 6, extra={"robot": "bio", "devices": ["motor 6"], "event": "lost"})
        client.say("", 0.01)
        assert "*** servo 6 is lost" in client.hear()
        log.error("long " * 1000)
        client.say("lobby.send(System.logText(1))|; System.log.size;", 0.01)
        text, size = (line for line in client.hear() if not line.startswith("***"))
        (entry,) = json.loads(text)
        assert (entry["n"], entry["level"], len(entry["text"]), size) == (2, "error", 1000, "2")
        client.say('System.log[0]["fields"]["devices"]; System.log[0]["level"];', 0.01)
        assert client.hear() == ['["motor 6"]', '"warning"']
    finally:
        tap.detach()
    log.warning("after")
    client.say("System.log.size;", 0.01)
    assert client.hear() == ["2"]


def test_a_flood_of_log_lines_is_bounded_and_counted(kernel: Kernel) -> None:
    client = Client(kernel)
    tap = LogTap(kernel.post, kernel.programs.log.add)
    tap.attach()
    log = logging.getLogger("urbihw.test")
    try:
        for number in range(5 * MAX_PENDING):
            log.error("line %d", number)
        client.say("System.log.size;", 0.01)
        assert client.hear() == ["200"]
        log.error("after")
        client.say('System.log.back["fields"]["dropped"];', 0.01)
        assert client.hear() == [str(4 * MAX_PENDING)]
    finally:
        tap.detach()
