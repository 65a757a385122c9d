"""Topics that are read from the server, each while somebody follows it: what is not asked for costs nothing."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import AsyncGenerator, Callable, Iterator, Mapping
from typing import Any, Final, NamedTuple

from urbihw.client.aio import AsyncRobot
from urbihw.client.errors import ClientError
from urbihw.repeats import LimitedLog
from urbihw.ros.errors import MessageError
from urbihw.ros.node import RosNode
from urbihw.ros.publications import RosPublication
from urbihw.ros.robot import readings
from urbihw.ros.robot.parts import RosParts

log = logging.getLogger("urbihw.ros")

JOINTS_HZ: Final = 50.0
BASE_HZ: Final = 20.0
SENSORS_HZ: Final = 10.0
BATTERY_HZ: Final = 1.0
RETRY_S: Final = 1.0
Messages = Mapping[str, Mapping[str, Any] | None]
"""Messages by the names of their topics; None for no message."""


class RosFeed(NamedTuple):
    """What is read together.

    Attributes:
        topics: the topics with their types.
        slots: the paths that are watched, ``hz`` times in a second; one path of a picture if ``pictures``.
        make: the messages of the values.
    """

    topics: dict[str, str]
    slots: tuple[str, ...]
    hz: float
    make: Callable[[float, Any], Messages]
    pictures: bool = False


def feeds_of(parts: RosParts, node: RosNode) -> Iterator[RosFeed]:
    """The feeds of a robot with these parts."""
    if parts.joints:
        slots = tuple(f"{name}.val" for name in parts.joints)
        yield RosFeed({"/joint_states": "sensor_msgs/JointState"}, slots, JOINTS_HZ,
                      lambda t, values: {"/joint_states": readings.joint_state(t, parts.joints, values)})
    if parts.drives:
        odometer = readings.RosOdometer()

        def base(t: float, values: Any) -> Messages:
            if not isinstance(values[0], dict):
                return {}
            odometry, transform = odometer.read(t, values[0])
            return {"/odom": odometry, "/tf": transform}

        topics = {"/odom": "nav_msgs/Odometry", "/tf": "tf2_msgs/TFMessage"}
        yield RosFeed(topics, ("robot.position",), BASE_HZ, base)
    if parts.laser:
        slots = tuple(f"{parts.laser}.{slot}" for slot in readings.SCAN_SLOTS)
        yield RosFeed({"/scan": "sensor_msgs/LaserScan"}, slots, SENSORS_HZ,
                      lambda t, values: {"/scan": readings.laser_scan(t, parts.laser, values)})
    yield from _sensor_feeds(parts, node)


def _sensor_feeds(parts: RosParts, node: RosNode) -> Iterator[RosFeed]:
    if parts.ranges:
        topics = {f"/range/{each.name}": "sensor_msgs/Range" for each in parts.ranges}
        yield RosFeed(topics, tuple(each.slot for each in parts.ranges), SENSORS_HZ, lambda t, values: {
            topic: readings.distance(t, part, value)
            for topic, part, value in zip(topics, parts.ranges, values, strict=True)
        })  # fmt: skip
    inertial = (*parts.accelerations, *parts.turns)
    if inertial:
        def inertia(t: float, values: Any) -> Messages:
            known = len(parts.accelerations)
            rows = [axis for axis, _ in inertial]
            return {"/imu": readings.imu(t, dict(zip(rows[:known], values[:known], strict=True)),
                                         dict(zip(rows[known:], values[known:], strict=True)))}

        yield RosFeed({"/imu": "sensor_msgs/Imu"}, tuple(slot for _, slot in inertial), JOINTS_HZ, inertia)
    if parts.battery:
        template = node.types.find("sensor_msgs/BatteryState").template()
        slots = tuple(f"{parts.battery}.{slot}" for slot in readings.BATTERY_SLOTS)
        yield RosFeed({"/battery_state": "sensor_msgs/BatteryState"}, slots, BATTERY_HZ,
                      lambda t, values: {"/battery_state": readings.battery_state(t, template, values)})
    if parts.camera:
        topic = "/image_raw/compressed"
        yield RosFeed({topic: "sensor_msgs/CompressedImage"}, (f"{parts.camera}.val",), SENSORS_HZ, lambda t, blob: {
            topic: {"header": readings.header(t, parts.camera), "format": "jpeg", "data": bytes(blob.data)}
            if blob.keywords.startswith("jpeg") else None
        }, pictures=True)  # fmt: skip


class RunningFeed:
    """A feed with its topics, advertised."""

    def __init__(self, robot: AsyncRobot, node: RosNode, feed: RosFeed) -> None:
        self._robot, self._node, self._feed = robot, node, feed
        self._publications: dict[str, RosPublication] = {}
        self._wanted = asyncio.Event()
        self._log = LimitedLog(log)

    def _note_peer(self, node: str, here: bool) -> None:
        if any(each.subscribers for each in self._publications.values()):
            self._wanted.set()
        else:
            self._wanted.clear()

    async def run(self) -> None:
        """Publish while there are subscribers, until the task is cancelled."""
        try:
            for topic, kind in self._feed.topics.items():
                self._publications[topic] = await self._node.publish(topic, kind, on_peer=self._note_peer)
            while True:
                await self._wanted.wait()
                try:
                    await self._publish_all()
                except ClientError as error:
                    self._log.say("read", "%s: %s", ", ".join(self._feed.topics), error)
                    await asyncio.sleep(RETRY_S)
        finally:
            for topic in self._publications:
                await self._node.unpublish(topic)

    async def _publish_all(self) -> None:
        feed = self._feed
        async with contextlib.aclosing(self._values()) as values:
            async for t, read in values:
                if not self._wanted.is_set():
                    return
                for topic, message in feed.make(t, read).items():
                    if message is not None:
                        self._publish(topic, message)

    def _publish(self, topic: str, message: Mapping[str, Any]) -> None:
        publication = self._publications[topic]
        try:
            publication.publish(publication.kind.encode(message))
        except MessageError as error:
            self._log.say(topic, "%s: %s", topic, error)

    async def _values(self) -> AsyncGenerator[tuple[float, Any], None]:
        """What the server sends, until the feed is not wanted any more."""
        feed = self._feed
        stream: Any = self._robot.pictures(feed.slots[0], feed.hz) if feed.pictures \
            else self._robot.watch(*feed.slots, hz=feed.hz)
        async with stream:
            async for t, read in stream:
                yield t, read
