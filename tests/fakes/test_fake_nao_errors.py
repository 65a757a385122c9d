"""The simulated Nao answers wrong arguments with an error, as NAOqi does, and goes on."""

from __future__ import annotations

import math
from typing import Any

import pytest

from urbihw_nao_fakes import codec
from urbihw_nao_fakes.body import Body
from urbihw_nao_fakes.connection import Connection
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.services import Method, Service

NUMBERS = "fdiIlLwWcC"
ODD: tuple[Any, ...] = (
    "far", "", "HeadYaw", "Head", "Body", 0, -1, 1e9, math.nan, math.inf, None, True, [], [[]], [["HeadYaw"]], {"a": 1},
    [{"k": 1}], [1.0, "x"], ["HeadYaw", 5], b"\0", [["a", "Merge", [[math.nan, 0]]]], [3, "b"],
)  # fmt: skip
"""Values for parameters of any type."""


class Client:
    """Calls methods, and gives what comes back."""

    def __init__(self, robot: Nao) -> None:
        self.robot, self.now, self.number = robot, 0.0, 0
        self.connection: Connection = robot.connect()
        self.send(codec.Target(0, 0, 8), codec.encode("{sm}", {}))

    def send(self, target: codec.Target, payload: bytes) -> list[codec.Message]:
        """The answers that have come at once."""
        self.number += 1
        self.robot.receive_from(self.connection, codec.frame(codec.CALL, self.number, target, payload), self.now)
        return self.read()

    def read(self) -> list[codec.Message]:
        """What has come."""
        splitter = codec.Splitter()
        return [each for one in self.robot.server.pop_answers(self.connection) for each in splitter.feed(one.data)]

    def call(self, service: Service, method: Method, *arguments: Any) -> list[codec.Message]:
        """The answers, within 100 ms."""
        target = codec.Target(service.number, 1, method.uid)
        told = self.send(target, codec.encode(method.parameters, arguments))
        return told + self.wait(0.1)

    def wait(self, seconds: float) -> list[codec.Message]:
        """What comes in a time."""
        self.now += seconds
        self.robot.advance(self.now)
        return self.read()


def methods() -> list[tuple[str, str, str]]:
    """All of all services that have parameters."""
    return [
        (service.name, each.name, each.parameters)
        for service in Nao().services.values()
        for each in service.methods.values()
        if each.parameters != "()" and "(sIsI" not in each.parameters
    ]


def odd_values(signature: str) -> list[Any]:
    """Odd values for one parameter."""
    if signature == "m":
        return list(ODD)
    if signature == "s":
        return ["far", ""]
    if signature in NUMBERS:
        return [math.nan, math.inf, -1.0, 0.0] if signature in "fd" else [0, 1, 100]
    others: dict[str, list[Any]] = {"b": [True], "r": [b"", b"x"]}
    return others.get(signature, [[]])


def find(robot: Nao, service: str, name: str, parameters: str = "") -> tuple[Service, Method]:
    """A method by its name, and the signature of its parameters where there are several."""
    (thing,) = [each for each in robot.services.values() if each.name == service]
    rows = [each for each in thing.methods.values() if each.name == name and parameters in ("", each.parameters)]
    return thing, rows[0]


def is_sound(body: Body) -> bool:
    """Whether the body is somewhere."""
    return all(math.isfinite(joint.angle) for joint in body.joints.values()) and math.isfinite(body.x + body.heading)


@pytest.mark.parametrize(("service", "name", "parameters"), methods())
def test_odd_arguments_never_end_the_robot(service: str, name: str, parameters: str) -> None:
    rows = [odd_values(each) for each in codec.inner(parameters)]
    for index in range(max(len(row) for row in rows) * 2):
        robot = Nao()
        robot.body.put_on_feet()
        client = Client(robot)
        # The first parameter stays a good one half of the time, so that the others are looked at too.
        values = [row[(index // 2 + place) % len(row)] for place, row in enumerate(rows)]
        if index % 2 and codec.inner(parameters)[0] == "m":
            values[0] = "HeadYaw"
        try:
            client.call(*find(robot, service, name, parameters), *values)
        except OverflowError:
            continue  # no such value of this type
        for _ in range(10):
            client.wait(0.1)
        assert is_sound(robot.body), values
        assert client.call(*find(robot, "ALMotion", "moveIsActive"))[0].kind == codec.REPLY, values


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("setAngles", ("HeadYaw", "far", 0.2)),
        ("setAngles", ("HeadYaw", math.nan, 0.2)),
        ("angleInterpolation", ("HeadYaw", "x", 1.0, True)),
        ("angleInterpolation", ("HeadYaw", 0.5, 0.0, True)),
        ("setStiffnesses", ("HeadYaw", "stiff")),
    ],
)
def test_a_wrong_type_is_an_error_answer(name: str, arguments: tuple[Any, ...]) -> None:
    robot = Nao()
    client = Client(robot)
    (answer,) = client.call(*find(robot, "ALMotion", name), *arguments)
    assert answer.kind == codec.ERROR and codec.decode("m", answer.payload)
