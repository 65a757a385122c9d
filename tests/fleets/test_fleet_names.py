"""Names, keys and endpoints of a fleet."""

from __future__ import annotations

import pytest

from urbihw.fleets.names import (
    BadEndpoint,
    BadFleetName,
    FleetKeys,
    FleetOrder,
    checked_endpoint,
    checked_fleet_name,
    fleet_name_of,
    owner_in,
)


@pytest.mark.parametrize(
    "text", ["", "Bob", "1bob", "-bob", "bob smith", "a/b", "*", "bob.local", "b" * 41, "böb", "a\n"]
)
def test_names_that_none_can_have(text: str) -> None:
    with pytest.raises(BadFleetName, match="is no name in a fleet"):
        checked_fleet_name(text)


@pytest.mark.parametrize(
    ("host", "name"),
    [("bob", "bob"), ("Raspberry_Pi.local", "raspberry-pi-local"), ("4711", "robot"), ("--", "robot"), ("ä", "robot"),
     ("x" * 60, "x" * 40)],
)  # fmt: skip
def test_any_host_has_a_name(host: str, name: str) -> None:
    assert fleet_name_of(host) == name == checked_fleet_name(name)


@pytest.mark.parametrize(
    ("key", "order"),
    [
        ("school/alice/motor6/val", FleetOrder("", "motor6.val")),
        ("school/alice/info", FleetOrder("", "info")),
        ("school/alice/from/anna/estop", FleetOrder("anna", "estop")),
        ("school/*/from/anna/estop", FleetOrder("anna", "estop")),
        ("*/alice/info", FleetOrder("", "info")),
        ("school/bob/info", None),
        ("lab/alice/info", None),
        ("school/alice/from/anna", None),
        ("school/alice/from/anna/estop/now", None),
        ("school/alice/from/Anna Smith/estop", None),
        ("school/alice/from//estop", None),
        ("school/alice/**", None),
    ],
)
def test_what_a_key_asks_alice_for(key: str, order: FleetOrder | None) -> None:
    assert FleetKeys("school", "alice").order_in(key) == order


def test_an_answer_has_a_key_of_the_robot() -> None:
    keys = FleetKeys("school", "alice")
    assert keys.answer_to(FleetOrder("anna", "estop")) == "school/alice/from/anna/estop"
    assert keys.answer_to(FleetOrder("", "motor6.val")) == "school/alice/motor6/val"
    assert owner_in(keys.client("7f")) == ("school", "alice", "7f")


@pytest.mark.parametrize("text", ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tcp/localhost:1"])
def test_endpoints_where_a_fleet_can_meet(text: str) -> None:
    assert checked_endpoint(text) == text


@pytest.mark.parametrize(
    "text",
    ["", "127.0.0.1:7447", "tcp/127.0.0.1", "tcp/:7447", "tcp/127.0.0.1:0", "tcp/127.0.0.1:70000", "udp/127.0.0.1:1",
     "tls/127.0.0.1:1"],
)
def test_endpoints_that_are_none(text: str) -> None:
    with pytest.raises(BadEndpoint, match="is no endpoint"):
        checked_endpoint(text)


@pytest.mark.parametrize(
    "text", ["tcp/192.168.1.5:7447", "tcp/0.0.0.0:7447", "tcp/teacher.local:7447", "tcp/[::]:7447"]
)
def test_nothing_goes_in_clear_off_this_machine(text: str) -> None:
    with pytest.raises(BadEndpoint, match="a fleet is on one machine alone"):
        checked_endpoint(text)
