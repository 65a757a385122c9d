"""Ros.Service: calls of services of other nodes.

Source: manual, specs/ros.
"""

from __future__ import annotations

import weakref
from functools import partial
from typing import Any

from urbihw.kernel.library import Obj, Table, Value, World, errors
from urbihw.ros.script.conversion import message_of, value_of
from urbihw.ros.script.link import ros_link

TABLE = Table("Ros.Service")
NOTES = {"Ros.Service": "A service of another node."}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""


class RosServiceObject(Obj):
    """An urbiscript Ros.Service.

    Attributes:
        name: the name, "" for the prototype.
        templates: an empty request and an empty response.
    """

    __slots__ = ("handle", "name", "templates")

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.name = ""
        self.templates: tuple[dict[str, Any], dict[str, Any]] | None = None
        self.handle = 0

    def clone(self) -> RosServiceObject:
        """A service without a name."""
        return RosServiceObject(self.world, [self])

    def known(self) -> tuple[dict[str, Any], dict[str, Any]]:
        """The templates.  Raises Exception.Primitive for the prototype."""
        if self.templates is None:
            raise errors.primitive("Ros.Service without a name: use Ros.Service.new")
        return self.templates


CLASSES = {"Ros.Service": RosServiceObject}


@TABLE.primitive("init")
def init(world: World, this: RosServiceObject, name: str, keepOpen: bool = False) -> None:
    """Stand for a service; with ``keepOpen`` its connection stays open between requests.  Raises an error if there is
    no such service.
    """
    link = ros_link(world)
    this.handle = link.new_handle()
    this.templates = link.ask("service", this.handle, name, keepOpen)
    this.name = name
    weakref.finalize(this, world.scheduler.post, partial(link.tell, "release", this.handle))


@TABLE.primitive("name")
def service_name(world: World, this: RosServiceObject) -> str:
    """The name of the service."""
    return this.name


@TABLE.primitive("initialized")
def initialized(world: World, this: RosServiceObject) -> bool:
    """Whether requests can be made: true when ``new`` has returned."""
    return this.templates is not None


@TABLE.primitive("reqStruct")
def req_struct(world: World, this: RosServiceObject) -> Value:
    """A request with default values, a new Dictionary each time."""
    return value_of(world, this.known()[0])


@TABLE.primitive("resStruct")
def res_struct(world: World, this: RosServiceObject) -> Value:
    """A response with default values, a new Dictionary each time."""
    return value_of(world, this.known()[1])


@TABLE.primitive("request")
def request(world: World, this: RosServiceObject, request: Value) -> Value:
    """The response to a request, both Dictionaries; the job waits for it.  Raises an error that names a wrong field, or
    tells why the service has failed.
    """
    this.known()
    return value_of(world, ros_link(world).ask("request", this.handle, message_of(world, request, "request")))
