"""Ros.Topic: messages of a topic as Dictionaries, received by an event, sent by ``publish`` or ``<<``.

Source: manual, specs/ros.  A topic belongs to the connection that has subscribed or advertised: it ends with it.  A
handler that is slow misses messages: ``WINDOW`` handlers run at most, and half as many messages wait.
"""

from __future__ import annotations

from collections import deque
from typing import Any, Final

from urbihw.kernel.library import Event, Obj, Table, Value, World, automatic_service, errors, holdings_of
from urbihw.ros.errors import RosError
from urbihw.ros.names import checked_name
from urbihw.ros.orders import WINDOW, PeerChange, ServiceAsked, TopicMessage
from urbihw.ros.script.conversion import message_of, value_of
from urbihw.ros.script.link import RosLink, ros_link

TABLE = Table("Ros.Topic")
NOTES = {
    "Ros.Topic": "A topic of ROS, to follow or to publish.",
    "Ros.Topic.onMessage": "The event that is emitted with each message, a Dictionary.",
    "Ros.Topic.onConnect": "The event that is emitted with the name of a node that has subscribed here.",
    "Ros.Topic.onDisconnect": "The event that is emitted with the name of a node that has gone.",
}
"""Descriptions of classes and of slots that hold values or fields, which have no docstrings."""
EVENTS: Final = ("onMessage", "onConnect", "onDisconnect")
MAX_TOPICS: Final = 64
"""Maximum number of topics of a connection."""


class RosTopicObject(Obj):
    """An urbiscript Ros.Topic.

    Attributes:
        name: the name, "" for the prototype.
        template: an empty message; None before the type is known.
        peers: the nodes that have subscribed to what is advertised here.
        missed: number of messages that came too fast.
    """

    __slots__ = ("_handlers", "_handle", "_holdings", "_owner", "_waiting", "advertised", "missed", "name", "peers",
                 "subscribed", "template")  # fmt: skip

    def __init__(self, world: World, protos: list[Obj]) -> None:
        super().__init__(world, protos)
        self.name = ""
        self.template: dict[str, Any] | None = None
        self.subscribed = self.advertised = False
        self.peers: list[str] = []
        self.missed = 0
        self._handle = 0
        self._handlers = 0
        self._waiting: deque[TopicMessage] = deque()
        self._owner: Any = None
        self._holdings: Any = None

    def clone(self) -> RosTopicObject:
        """A topic without a name."""
        return RosTopicObject(self.world, [self])

    def begin(self, verb: str, *arguments: Any) -> None:
        """Subscribe or advertise.  Raises Exception.Primitive."""
        if not self.name:
            raise errors.primitive("Ros.Topic without a name: use Ros.Topic.new")
        link = ros_link(self.world)
        self._owner, holdings = self.world.scheduler.running().context, holdings_of(self.world)
        holdings.register(self, "ROS topics", MAX_TOPICS)
        self._holdings = holdings
        self._handle = self._handle or link.new_handle()
        link.listen(self._handle, self)
        self.template = link.ask(verb, self._handle, self.name, *arguments)[1]

    def end(self, verb: str) -> None:
        """Unsubscribe or unadvertise: the job waits for it."""
        ros_link(self.world).ask(verb, self._handle, self.name)
        self.leave_if_unused()

    def leave_if_unused(self) -> None:
        """Free the place of a topic that is neither subscribed nor advertised."""
        if not self.subscribed and not self.advertised and self._holdings is not None:
            ros_link(self.world).forget(self._handle)
            self._holdings.unregister(self)

    def lose(self) -> None:
        """The process has ended."""
        self.subscribed = self.advertised = False
        self.peers = []
        self._holdings.unregister(self)

    def close(self) -> None:
        """The connection has ended."""
        link = ros_link(self.world)
        if self.subscribed:
            link.tell("unsubscribe", self._handle, self.name)
        if self.advertised:
            link.tell("unadvertise", self._handle, self.name)
        self.subscribed = self.advertised = False
        link.forget(self._handle)
        # Others that follow the topic must not wait for what this one will not handle.
        while self._waiting:
            link.taken(self._waiting.popleft())

    # ---------------------------------------------------------------- what comes

    def hear(self, link: RosLink, said: TopicMessage | PeerChange | ServiceAsked) -> None:
        """Queue a message or a change of the subscribers for a job of the owner."""
        if isinstance(said, PeerChange):
            self._note_peer(said)
            return
        assert isinstance(said, TopicMessage)
        self.missed += said.missed
        if len(self._waiting) >= WINDOW // 2 or self._handlers >= WINDOW:
            self.missed += 1
            link.taken(said)
            return
        self._waiting.append(said)
        automatic_service(self.world).queue_event(self._owner, lambda: self._emit_message(link))

    def _emit_message(self, link: RosLink) -> None:
        if not self._waiting:
            return
        said = self._waiting.popleft()
        link.taken(said)
        if not self.subscribed:
            return
        event = self.slots.get("onMessage")
        if isinstance(event, Event):
            for job in event.emit([value_of(self.world, said.message)]).jobs:
                self._handlers += 1
                job.when_ended(self._end_handler)

    def _end_handler(self, _: Value) -> None:
        self._handlers -= 1

    def _note_peer(self, said: PeerChange) -> None:
        if said.here:
            self.peers.append(said.node)
        elif said.node in self.peers:
            self.peers.remove(said.node)
        automatic_service(self.world).queue_event(self._owner, lambda: self._emit_peer(said))

    def _emit_peer(self, said: PeerChange) -> None:
        event = self.slots.get("onConnect" if said.here else "onDisconnect")
        if isinstance(event, Event):
            event.emit([value_of(self.world, said.node)])


CLASSES = {"Ros.Topic": RosTopicObject}


@TABLE.primitive("init")
def init(world: World, this: RosTopicObject, name: str) -> None:
    """Stand for the topic of a name, of letters, digits, ``/`` and ``_``."""
    try:
        this.name = checked_name(name)
    except RosError as error:
        raise errors.primitive(str(error)) from error
    for event in EVENTS:
        world.ops.put_slot(this, event, Event(world, [world.event_proto]))


@TABLE.primitive("name")
def topic_name(world: World, this: RosTopicObject) -> str:
    """The name of the topic."""
    return this.name


@TABLE.primitive("structure")
def structure(world: World, this: RosTopicObject) -> Value:
    """A message with default values, a new Dictionary each time; void before ``subscribe`` or ``advertise``."""
    return world.void if this.template is None else value_of(world, this.template)


@TABLE.primitive("subscribe")
def subscribe(world: World, this: RosTopicObject) -> None:
    """Receive messages: ``onMessage`` is emitted with each.  Raises an error if the topic or its type is unknown."""
    if this.subscribed:
        raise errors.primitive(f"{this.name}: already subscribed")
    this.subscribed = True
    try:
        this.begin("subscribe", "")
    except BaseException:
        this.subscribed = False
        this.leave_if_unused()
        raise


@TABLE.primitive("unsubscribe")
def unsubscribe(world: World, this: RosTopicObject) -> None:
    """Receive no more messages."""
    if not this.subscribed:
        raise errors.primitive(f"{this.name}: not subscribed")
    this.subscribed = False
    this.end("unsubscribe")


@TABLE.primitive("advertise")
def advertise(world: World, this: RosTopicObject, type: str = "", latch: bool = False) -> None:
    """Begin to publish messages of a type, such as ``std_msgs/String``; "" is the type that other nodes have told.

    With ``latch``, later subscribers get the last message.
    """
    if this.advertised:
        raise errors.primitive(f"{this.name}: already advertised")
    this.advertised = True
    try:
        this.begin("advertise", type, latch)
    except BaseException:
        this.advertised = False
        this.leave_if_unused()
        raise


@TABLE.primitive("unadvertise")
def unadvertise(world: World, this: RosTopicObject) -> None:
    """Publish no more: the subscribers are sent away."""
    if not this.advertised:
        raise errors.primitive(f"{this.name}: not advertised")
    this.advertised = False
    this.peers = []
    this.end("unadvertise")


@TABLE.primitive("publish")
def publish(world: World, this: RosTopicObject, message: Value) -> None:
    """Send a message, a Dictionary with all fields of ``structure``.  Raises an error that names a wrong field."""
    if not this.advertised:
        raise errors.primitive(f"{this.name}: not advertised")
    ros_link(world).ask("publish", this.name, message_of(world, message))


@TABLE.primitive("<<")
def send(world: World, this: RosTopicObject, message: Value) -> Value:
    """Send a message like ``publish``; returns this topic."""
    publish(world, this, message)
    return this


@TABLE.primitive("subscriberCount")
def subscriber_count(world: World, this: RosTopicObject) -> float:
    """The number of nodes that have subscribed to what is advertised here; 0 before ``advertise``."""
    return float(len(this.peers))


@TABLE.primitive("missed")
def missed(world: World, this: RosTopicObject) -> float:
    """The number of messages that came faster than their handlers ended, and were dropped."""
    return float(this.missed)
