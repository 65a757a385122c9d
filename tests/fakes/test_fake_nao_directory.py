"""The ServiceDirectory of the simulated Nao: services of clients, called on the connection that registered them."""

from __future__ import annotations

from typing import Any

import pytest

from urbihw_nao_fakes import codec
from urbihw_nao_fakes.connection import Connection
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.services import Failed

META_OF_ADDER: Any = ({
    100: (100, "i", "add", "(ii)", "", [], ""),
    101: (101, "s", "add", "(ss)", "", [], ""),
    102: (102, "v", "hear", "(sms)", "", [], ""),
}, {}, {}, "adder")  # fmt: skip
"""What the client's service offers."""


class Client:
    """A client, byte for byte: it calls, and answers calls for a service with two methods."""

    def __init__(self, robot: Nao) -> None:
        self.robot = robot
        self.connection: Connection = robot.connect()
        self.heard: list[tuple[Any, ...]] = []
        self.events: list[codec.Message] = []
        self._splitter = codec.Splitter()
        self._number = 0
        self._answers: dict[int, codec.Message] = {}
        self.call(codec.Target(0, 0, 8), "{sm}", {})

    def call(self, target: codec.Target, parameters: str, *arguments: Any) -> codec.Message:
        """Call the robot, and give its answer."""
        self._number += 1
        value = arguments[0] if parameters == "{sm}" else arguments
        self.send(codec.frame(codec.CALL, self._number, target, codec.encode(parameters, value)))
        return self._answers.pop(self._number)

    def ask(self, name: str, *arguments: Any) -> Any:
        """Call a method of the directory."""
        (method,) = [each for each in self.robot.directory.methods.values() if each.name == name]
        answer = self.call(codec.Target(1, 1, method.uid), method.parameters, *arguments)
        if answer.kind == codec.ERROR:
            raise Failed(codec.decode("m", answer.payload))
        return codec.decode(method.returns, answer.payload)

    def register(self, name: str = "adder") -> int:
        """A service without an end point of its own; its number."""
        return int(self.ask("registerService", (name, 0, "mine", 1, [], "")))

    def send(self, data: bytes) -> None:
        """To the robot; what comes back is handled, until nothing comes any more."""
        self.robot.receive_from(self.connection, data, 0.0)
        self.read()

    def read(self) -> None:
        """Handle what has come."""
        while answers := self.robot.server.pop_answers(self.connection):
            for message in self._splitter.feed(b"".join(answer.data for answer in answers)):
                self._handle(message)

    def _handle(self, message: codec.Message) -> None:
        if message.kind == codec.CALL:
            kind, payload = self._run(message)
            self.robot.receive_from(self.connection, codec.frame(kind, message.number, message.target, payload), 0.0)
        elif message.kind == codec.EVENT:
            self.events.append(message)
        else:
            self._answers[message.number] = message

    def _run(self, message: codec.Message) -> tuple[int, bytes]:
        if message.action == 2:
            return codec.REPLY, codec.encode(codec.META, META_OF_ADDER)
        _, returns, name, parameters, *_ = META_OF_ADDER[0][message.action]
        values = codec.decode(parameters, message.payload)
        if name == "hear":
            self.heard.append(values)
            return codec.REPLY, b""
        if values[0] == 13:
            return codec.ERROR, codec.encode("m", "not this number")
        return codec.REPLY, codec.encode(returns, values[0] + values[1])


def call_service(client: Client, name: str, method: str, *arguments: Any) -> Any:
    """The robot calls; a `Failed` is returned, too."""
    found: list[Any] = []
    client.robot.directory.call_service(name, method, arguments, found.append)
    client.read()
    (value,) = found
    return value


def test_the_robot_calls_a_client_without_an_end_point_on_its_connection() -> None:
    client = Client(Nao())
    client.ask("serviceReady", client.register())
    assert call_service(client, "adder", "add", 2, 3) == 5
    assert call_service(client, "adder", "add", "a", "b") == "ab"
    assert str(call_service(client, "adder", "add", 13, 3)) == "not this number"
    assert str(call_service(client, "adder", "add", 1)) == "adder has no method add for 1 such values"
    client.robot.memory.subscribe_module_with_text("tick", "adder", "text", "hear")
    client.robot.memory.raise_event("tick", 7)
    client.read()
    assert client.heard == [("tick", 7, "text")]


def test_a_service_is_there_when_it_is_ready_and_until_its_client_is_gone() -> None:
    robot = Nao()
    owner, other = Client(robot), Client(robot)
    for uid, signal in robot.directory.signals.items():
        other.call(codec.Target(1, 1, 0), "(IIL)", 1, uid, uid)
        assert signal.name in ("serviceAdded", "serviceRemoved")
    number = owner.register()
    with pytest.raises(Failed, match="Cannot find service 'adder'"):
        other.ask("service", "adder")
    owner.ask("serviceReady", number)
    other.read()
    assert tuple(other.ask("service", "adder"))[:3] == ("adder", number, "mine")
    robot.disconnect(owner.connection)
    other.read()
    with pytest.raises(Failed, match="Cannot find service 'adder'"):
        other.ask("service", "adder")
    told = [(message.action, codec.decode("(Is)", message.payload)) for message in other.events]
    assert told == [(106, (number, "adder")), (107, (number, "adder"))]


def test_who_may_do_what() -> None:
    robot = Nao()
    owner, other = Client(robot), Client(robot)
    number = owner.register()
    assert number not in robot.services
    with pytest.raises(Failed, match="Service 'adder' is already registered"):
        other.register()
    with pytest.raises(Failed, match="Service 'ALMotion' is already registered"):
        other.register("ALMotion")
    for name in ("serviceReady", "unregisterService"):
        with pytest.raises(Failed, match=f"Can't find service #{number}"):
            other.ask(name, number)
    owner.ask("unregisterService", number)
    assert other.register() > number, "no number is used twice"


def test_a_call_under_way_fails_when_the_client_is_gone() -> None:
    client = Client(Nao())
    client.ask("serviceReady", client.register())
    assert call_service(client, "adder", "add", 2, 3) == 5
    found: list[Any] = []
    client.robot.directory.call_service("adder", "add", (2, 3), found.append)
    client.robot.disconnect(client.connection)
    assert [str(each) for each in found] == ["the connection is closed"]


def test_an_end_point_that_nobody_can_reach_fails_the_call() -> None:
    client = Client(Nao())
    number = client.ask("registerService", ("adder", 0, "mine", 1, ["tcp://192.0.2.1:1"], ""))
    client.ask("serviceReady", number)
    assert "there is no network here" in str(call_service(client, "adder", "add", 2, 3))
