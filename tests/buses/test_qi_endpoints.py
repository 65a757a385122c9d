"""Services that live in another process of the robot, at an end point of their own."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from urbihw.buses.clock import BusSimClock
from urbihw.buses.errors import BadValue, LinkGone, Unavailable
from urbihw.buses.link import Context, Link, Url
from urbihw.buses.pipe import PipeEnd, PipeLink
from urbihw_nao.qimessaging.endpoints import ServicePlace
from urbihw_nao.qimessaging.login import Login
from urbihw_nao.qimessaging.wire_session import MOST_CONNECTIONS, RETRY_S, WireSession
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.services import Service, Signal, method

ROBOT = "192.168.1.30"
REFUSED_PORT = 7
"""An address without a listener."""


class Elsewhere(Service):
    """A service of another process."""

    turned = Signal("turned", "(f)")

    def __init__(self, name: str) -> None:
        super().__init__()
        self.name = name

    @method("getHeading", "()", "f")
    def get_heading(self) -> float:
        """A number."""
        self.emit(self.turned, 0.25)
        return 0.5


class Rig:
    """A robot, a second process of it, and a session that reaches both by pipes."""

    def __init__(
        self, *endpoints: str, user: str = "", names: tuple[str, ...] = ("Compass",), other_hosts: bool = False
    ) -> None:
        self.clock = BusSimClock(100.0)
        self.opened: list[str] = []
        self.ends: dict[str, PipeEnd] = {}
        self.links: list[Link] = []
        password = "secret" if user else ""
        self.robot, self.other = Nao(user, password), Nao(user, password)
        for name in names:
            self.other.server.add_service(Elsewhere(name))
        numbers = {each.name: number for number, each in self.other.services.items()}
        known = self.robot.directory.get_services

        def get_services() -> list[Any]:
            rows = known()
            place = rows[0]._replace(process=9, endpoints=list(endpoints))
            return rows + [place._replace(name=name, number=numbers[name]) for name in names]

        self.robot.directory.get_services = get_services  # type: ignore[method-assign]
        link = self._connect("nao", self.robot)
        self.session = WireSession(link, self._open, ROBOT)
        self.session.authenticate(Login(user, password, other_hosts=other_hosts))

    def _connect(self, name: str, device: Nao) -> Link:
        end = self.ends[name] = PipeEnd()
        connection = device.connect()

        def receive(data: bytes, at: float) -> None:
            device.receive_from(connection, data, at)
            for answer in device.server.pop_answers(connection):
                end.send(answer.data, answer.at)

        end.on_receive = receive
        link = PipeLink(Url.parse(f"pipe://{name}?baud=100000000"), Context(self.clock, {name: end}))
        link.open()
        return link

    def _open(self, url: str) -> Link:
        self.opened.append(url)
        if url.endswith(f":{REFUSED_PORT}"):
            raise Unavailable(111, f"cannot connect to {url}")
        self.links.append(self._connect(f"other{len(self.ends)}", self.other))
        return self.links[-1]

    def ask(self, service: str, name: str, *arguments: Any) -> Any:
        """Call and wait."""
        return self.session.wait(self.session.call(self.session.look_up(service), name, *arguments))


@pytest.fixture
def rig() -> Iterator[Rig]:
    """With one service at an end point of its own."""
    yield Rig("tcp://192.168.1.30:4000")


def test_a_service_is_called_at_its_own_end_point(rig: Rig) -> None:
    assert rig.ask("Compass", "getHeading") == 0.5
    assert rig.ask("ALBattery", "getBatteryCharge") == 80
    assert rig.opened == ["qi://192.168.1.30:4000"]
    rig.ask("Compass", "getHeading")
    assert len(rig.opened) == 1, "one connection is enough"
    assert rig.other.motion.calls.total() == 0


def test_signals_of_such_a_service_are_heard(rig: Rig) -> None:
    heard: list[Any] = []
    subscription = rig.session.listen(rig.session.look_up("Compass"), "turned", heard.append)
    rig.ask("Compass", "getHeading")
    rig.session.poll()
    assert heard == [(0.25,)]
    rig.session.stop_listening(subscription)
    rig.ask("Compass", "getHeading")
    assert len(heard) == 1


def test_several_services_of_one_process_share_a_connection() -> None:
    rig = Rig("tcp://192.168.1.30:4000", names=("Compass", "Map"))
    assert (rig.ask("Compass", "getHeading"), rig.ask("Map", "getHeading")) == (0.5, 0.5)
    assert len(rig.opened) == 1


def test_the_same_login_is_used_there() -> None:
    rig = Rig("tcp://192.168.1.30:4000", user="nao")
    assert rig.ask("Compass", "getHeading") == 0.5
    rig.session.close("the link went down")
    rig.other.server.password = "another"
    with pytest.raises(Unavailable, match=r"Compass is in another process, out of reach: .* refuses user or password"):
        rig.session.look_up("Compass")
    assert not rig.links[-1].is_open


def test_the_end_points_are_tried_in_turn_and_few_of_them() -> None:
    rig = Rig("tcp://10.0.0.2:7", "tcp://10.0.0.1:5", other_hosts=True)
    assert rig.ask("Compass", "getHeading") == 0.5
    assert rig.opened == ["qi://10.0.0.2:7", "qi://10.0.0.1:5"]
    rig = Rig("tcp://10.0.0.2:7", "tcp://10.0.0.3:7", "tcp://10.0.0.4:7", "tcp://10.0.0.1:5", other_hosts=True)
    with pytest.raises(Unavailable, match="Compass is in another process, out of reach: cannot connect"):
        rig.session.look_up("Compass")
    assert len(rig.opened) == 2


def test_an_end_point_out_of_reach_is_not_tried_with_each_call() -> None:
    # Connecting holds the robot's cycle, and a stop.
    rig = Rig("tcp://192.168.1.30:7")
    for _ in range(5):
        with pytest.raises(Unavailable, match="out of reach: cannot connect to qi://192.168.1.30:7"):
            rig.session.look_up("Compass")
    assert len(rig.opened) == 1
    rig.clock.sleep_until(rig.clock.now() + RETRY_S)
    with pytest.raises(Unavailable):
        rig.session.look_up("Compass")
    assert len(rig.opened) == 2


def test_an_end_point_that_says_nothing_holds_little() -> None:
    rig = Rig("tcp://192.168.1.30:5")
    rig.other.faults.start("silence")
    begun = rig.clock.now()
    with pytest.raises(Unavailable, match=r"no answer to the login in 0\.3 s"):
        rig.session.look_up("Compass")
    assert rig.clock.now() - begun < 0.5
    assert not rig.links[0].is_open


def test_a_lost_process_fails_its_calls_alone_and_is_found_again(rig: Rig) -> None:
    session = rig.session
    compass = session.look_up("Compass")
    rig.other.faults.start("silence")
    pending = session.call(compass, "getHeading")
    rig.ends["other1"].hang_up()
    session.poll()
    assert pending.done and "closed" in pending.error
    assert not rig.links[0].is_open
    assert rig.ask("ALBattery", "getBatteryCharge") == 80
    with pytest.raises(BadValue, match="look the service up again"):
        session.call(compass, "getHeading")
    rig.other.faults.stop()
    assert rig.ask("Compass", "getHeading") == 0.5
    assert len(rig.opened) == 2


def test_the_number_of_connections_is_bounded() -> None:
    rig = Rig(f"tcp://{ROBOT}:1", names=tuple(f"Service{number}" for number in range(MOST_CONNECTIONS + 1)))
    known = rig.robot.directory.get_services()

    def get_services() -> list[Any]:
        return [
            row._replace(process=number, endpoints=[f"tcp://{ROBOT}:{number}"]) if row.name[:7] == "Service" else row
            for number, row in enumerate(known, 1000)
        ]

    rig.robot.directory.get_services = get_services  # type: ignore[method-assign]
    for number in range(MOST_CONNECTIONS):
        assert rig.ask(f"Service{number}", "getHeading") == 0.5
    with pytest.raises(Unavailable, match=f"{MOST_CONNECTIONS} connections to other processes already"):
        rig.session.look_up(f"Service{MOST_CONNECTIONS}")


def test_closing_the_session_closes_these_connections(rig: Rig) -> None:
    compass = rig.session.look_up("Compass")
    rig.other.faults.start("silence")
    pending = rig.session.call(compass, "getHeading")
    rig.session.close("the link went down")
    assert pending.error == "the link went down"
    assert [link.is_open for link in rig.links] == [False]


def test_the_loss_of_the_directory_is_the_loss_of_the_session(rig: Rig) -> None:
    rig.session.look_up("Compass")
    rig.ends["nao"].hang_up()
    with pytest.raises(LinkGone):
        rig.session.poll()


def place(*endpoints: str, process: int = 1, machine: str = "m") -> ServicePlace:
    """A place with these end points."""
    return ServicePlace("X", 5, machine, process, endpoints)


def test_which_services_are_with_the_directory() -> None:
    directory = place("tcp://127.0.0.1:9559", "tcp://192.168.1.30:9559")
    assert place("tcp://10.0.0.1:1").is_with(directory), "the same process"
    assert place("tcp://192.168.1.30:9559", process=2).is_with(directory), "the same end point"
    assert place(process=2).is_with(directory), "none of its own"
    assert not place("tcp://192.168.1.30:4000", process=2).is_with(directory)
    assert not place("tcp://192.168.1.30:4000", machine="n").is_with(directory)


@pytest.mark.parametrize(
    ("robot", "encrypted", "other_hosts", "expected"),
    [
        ("192.168.1.30", False, False, ["qi://192.168.1.30:4"]),
        ("192.168.1.30", False, True, ["qi://192.168.1.30:4", "qi://10.0.0.1:4"]),
        # Reached by loopback, ours or through a tunnel: its loopback may be ours.
        ("127.0.0.1", False, False, ["qi://127.0.0.1:4"]),
        ("127.0.0.1", False, True, ["qi://127.0.0.1:4", "qi://10.0.0.1:4"]),
        # The password goes there too.
        ("192.168.1.30", True, True, ["qis://192.168.1.30:5"]),
        ("fe80::1", False, False, []),
    ],
)
def test_which_end_points_are_tried(robot: str, encrypted: bool, other_hosts: bool, expected: list[str]) -> None:
    odd = "qi:Compass", "tcp://10.0.0.9", "ssh://192.168.1.30:22", "tcp://10.0.0.8:x", ""
    found = place(
        *odd, "tcp://127.0.0.1:4", "tcp://10.0.0.1:4", "tcp://192.168.1.30:4", "tcps://127.0.0.1:5",
        "tcps://192.168.1.30:5",
    )  # fmt: skip
    assert found.urls(robot, encrypted, other_hosts) == expected


@pytest.mark.parametrize("other_hosts", [False, True])
@pytest.mark.parametrize(
    "host",
    [
        "localhost", "LOCALHOST", "localhost.", "0", "0.0.0.0", "2130706433", "0x7f.1", "0177.0.0.1", "127.1", "[::1]",
        "::1", "::ffff:127.0.0.1", "user@192.168.1.30", "192.168.1.30?baud=1", "192.168.1.30 ", "\x1b[31m", "\x00",
        "a..b", "\xe9" * 80, "", "224.0.0.1", "255.255.255.255", "127.0.0.1", "nao.local",
    ],
)  # fmt: skip
def test_names_and_odd_ways_to_write_an_address_are_not_followed(host: str, other_hosts: bool) -> None:
    rig = Rig(f"tcp://{host}:4000", other_hosts=other_hosts)
    with pytest.raises(Unavailable, match="Compass is in another process, out of reach: its end points are") as error:
        rig.session.look_up("Compass")
    assert rig.opened == [] and str(error.value).isprintable() and len(str(error.value)) < 400


@pytest.mark.parametrize("port", ["\xb2", "\u0663", "0", "65536", "9" * 30, "-1", " 5", "", "x"])
def test_odd_ports_are_not_followed(port: str) -> None:
    rig = Rig(f"tcp://192.168.1.30:{port}")
    with pytest.raises(Unavailable, match="out of reach: its end points are"):
        rig.session.look_up("Compass")
    assert rig.opened == []


def test_another_host_gets_no_password_unless_the_settings_say_so() -> None:
    rig = Rig("tcp://10.0.0.1:4000", user="nao")
    with pytest.raises(Unavailable, match="on another host than the robot: options.other_hosts = true sends"):
        rig.session.look_up("Compass")
    assert rig.opened == []
    rig = Rig("tcp://10.0.0.1:4000", user="nao", other_hosts=True)
    assert rig.ask("Compass", "getHeading") == 0.5
