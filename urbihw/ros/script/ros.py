"""Ros: who is in the ROS graph, parameters, and services that urbiscript functions offer.

Source: manual, specs/ros.  Parameters, time and offered services are not in the manual.
"""

from __future__ import annotations

import time
from typing import Any, Final

from urbihw.kernel.library import Completion, Executable, Obj, Table, Value, World, errors, holdings_of
from urbihw.ros.orders import PeerChange, ServiceAsked, TopicMessage
from urbihw.ros.script.conversion import message_of, value_of
from urbihw.ros.script.link import RosLink, ros_link

TABLE = Table("Ros")
NOTES = {"Ros": "The graph of ROS nodes, of which this server is one."}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""

MAX_SERVICES: Final = 64
MAX_WHOLE: Final = 2**31


@TABLE.primitive("checkMaster")
def check_master(world: World, this: Obj) -> bool:
    """Whether the ROS master answers; its address is in the variable ``ROS_MASTER_URI`` of the environment."""
    return bool(ros_link(world).ask("check"))


@TABLE.primitive("name")
def name(world: World, this: Obj) -> Value:
    """The name of this node, ``/urbi_`` and a random number."""
    return value_of(world, ros_link(world).ask("name"))


@TABLE.primitive("version")
def version(world: World, this: Obj) -> float:
    """The version of ROS that is spoken: 1."""
    return 1.0


@TABLE.primitive("nodes")
def nodes(world: World, this: Obj) -> Value:
    """All nodes by their names, each with the Lists of names ``publish``, ``subscribe`` and ``services``."""
    publishers, subscribers, offered, _ = ros_link(world).ask("state")
    made: dict[str, dict[str, list[str]]] = {}
    for kind, rows in (("publish", publishers), ("subscribe", subscribers), ("services", offered)):
        for what, names in rows.items():
            for node in names:
                found = made.setdefault(node, {"publish": [], "subscribe": [], "services": []})
                found[kind].append(what)
    return value_of(world, made)


@TABLE.primitive("topics")
def topics(world: World, this: Obj) -> Value:
    """All topics by their names, each with the Lists of nodes ``subscribers`` and ``publishers``, and its ``type``."""
    publishers, subscribers, _, types = ros_link(world).ask("state")
    made = {
        topic: {"subscribers": subscribers.get(topic, []), "publishers": publishers.get(topic, []),
                "type": types.get(topic, "")}
        for topic in sorted({*publishers, *subscribers})
    }  # fmt: skip
    return value_of(world, made)


@TABLE.primitive("services")
def services(world: World, this: Obj) -> Value:
    """All services by their names, each with the List of the nodes that offer it."""
    return value_of(world, ros_link(world).ask("state")[2])


@TABLE.primitive("time")
def ros_time(world: World, this: Obj) -> Value:
    """The time of a stamp, a Dictionary with ``secs`` since 1970 and ``nsecs``."""
    secs, nsecs = divmod(time.time_ns(), 10**9)
    return value_of(world, {"secs": secs, "nsecs": nsecs})


# ---------------------------------------------------------------- parameters


@TABLE.primitive("getParam")
def get_param(world: World, this: Obj, name: str) -> Value:
    """A parameter of the master, or a Dictionary of those whose names begin so.  Raises an error if it is not set."""
    return value_of(world, _plain(ros_link(world).ask("param", "getParam", name)))


@TABLE.primitive("setParam")
def set_param(world: World, this: Obj, name: str, value: Value) -> None:
    """Set a parameter of the master; a whole number becomes an integer."""
    ros_link(world).ask("param", "setParam", name, _parameter(message_of(world, value, name)))


@TABLE.primitive("hasParam")
def has_param(world: World, this: Obj, name: str) -> bool:
    """Whether a parameter of the master is set."""
    return bool(ros_link(world).ask("param", "hasParam", name))


@TABLE.primitive("deleteParam")
def delete_param(world: World, this: Obj, name: str) -> None:
    """Remove a parameter of the master.  Raises an error if it is not set."""
    ros_link(world).ask("param", "deleteParam", name)


@TABLE.primitive("params")
def params(world: World, this: Obj) -> Value:
    """The names of all parameters of the master."""
    return value_of(world, ros_link(world).ask("param", "getParamNames"))


def _parameter(value: Any) -> Any:
    """A value as XML-RPC has it."""
    if isinstance(value, float) and value.is_integer() and abs(value) < MAX_WHOLE:
        return int(value)
    if isinstance(value, list):
        return [_parameter(each) for each in value]
    if isinstance(value, dict):
        return {key: _parameter(each) for key, each in value.items()}
    return value


def _plain(value: Any) -> Any:
    """What XML-RPC has for bytes and dates, as bytes and texts."""
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return value.data if isinstance(value.data, bytes) else str(value)


# ---------------------------------------------------------------- offered services


class RosOffer:
    """A service that an urbiscript function offers; it belongs to the connection that has offered it."""

    def __init__(self, world: World, name: str, function: Executable, this: Value) -> None:
        self.name = name
        self._world, self._function, self._this = world, function, this
        self._owner = world.scheduler.running().context
        self._holdings = holdings_of(world)
        self.handle = ros_link(world).new_handle()
        self._holdings.register(self, "ROS services", MAX_SERVICES)

    def hear(self, link: RosLink, said: TopicMessage | PeerChange | ServiceAsked) -> None:
        """Answer a request in a job of its own."""
        assert isinstance(said, ServiceAsked)
        answer: Completion[Any] = Completion(self._world.scheduler)

        def work() -> None:
            value = self._world.invoke(self._function, self._this, (value_of(self._world, said.request),), self.name)
            answer.complete(message_of(self._world, value, "response"))

        def over(_: Any) -> None:
            if answer.done:
                link.respond(said.call, answer.value)
            else:
                link.respond(said.call, {}, "the function of the service has failed: urbihw tells why")

        self._world.scheduler.spawn(work, f"ROS service {self.name}", context=self._owner).when_ended(over)

    def lose(self) -> None:
        """The process has ended, and with it the service."""
        self._holdings.unregister(self)

    def close(self) -> None:
        """End the service, also when the connection has ended."""
        self._holdings.unregister(self)
        link = ros_link(self._world)
        link.forget(self.handle)
        link.tell("withdraw", self.name)
        offers_of(self._world).pop(self.name, None)


class RosOffers(dict[str, RosOffer]):
    """The services that are offered, by name; a part of the world."""


def offers_of(world: World) -> RosOffers:
    """The services that functions of a world offer."""
    if not world.has_part(RosOffers):
        world.install_part(RosOffers())
    return world.part(RosOffers)


@TABLE.primitive("offer")
def offer(world: World, this: Obj, name: str, type: str, function: Executable) -> None:
    """Offer a service of a type, such as ``std_srvs/SetBool``: the function gets each request as a Dictionary, and
    returns the response as one.  It ends with the connection, or with ``withdraw``.
    """
    made = RosOffer(world, name, function, this)
    link = ros_link(world)
    link.listen(made.handle, made)
    try:
        link.ask("offer", made.handle, name, type)
    except BaseException:
        made.lose()
        link.forget(made.handle)
        raise
    offers_of(world)[name] = made


@TABLE.primitive("withdraw")
def withdraw(world: World, this: Obj, name: str) -> None:
    """End a service that a function offers."""
    found = offers_of(world).get(name)
    if found is None:
        raise errors.primitive(f"no function offers {name}")
    found.close()
