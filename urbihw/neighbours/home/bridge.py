"""The bridge: a connection to the daemon, one to the broker, both made again when they are lost.

The broker says ``offline`` for it (the last will) when this process dies.  What it moves belongs to connections of its
own with a lease (``neighbours.orders``), so it stands then.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import deque
from typing import Any, Final

import aiomqtt

from urbihw.backoff import BackOff
from urbihw.client.aio import AsyncRobot
from urbihw.client.errors import ClientError
from urbihw.neighbours.home.orders_in import HomeOrder, JointQueue, goal_of, inbox_for
from urbihw.neighbours.home.settings import BridgeSettings
from urbihw.neighbours.home.things import (
    ESTOP,
    PROBLEMS,
    HomeThing,
    HomeTopics,
    discovery_text,
    safe,
    state_text,
    things_of,
)
from urbihw.neighbours.orders import OrderGiver, OrderRefused, short

log = logging.getLogger("urbihw.mqtt")

NAME: Final = "MQTT"
FIRST_PAUSE_S: Final = 1.0
MAX_PAUSE_S: Final = 30.0
SILENCE_S: Final = 10.0
KEEP_ALIVE_S: Final = 10
MAX_QUEUED: Final = 200
"""Messages of the broker that wait; further ones are dropped, but no stop."""


class HomeBridge:
    """One robot at one broker."""

    def __init__(self, settings: BridgeSettings) -> None:
        self._settings = settings
        self._orders = OrderGiver(settings.orders)
        self._topics = HomeTopics(settings.name)

    async def run(self) -> None:
        """Serve until cancelled.  Raises ValueError for joints that the robot has not."""
        pauses = BackOff(FIRST_PAUSE_S, MAX_PAUSE_S)
        while True:
            try:
                async with await self._orders.dial(NAME, deque(maxlen=1)) as robot:
                    await self._serve(robot, pauses)
            except (ClientError, aiomqtt.MqttError, OSError) as error:
                log.warning("%s", short(error))
            await asyncio.sleep(pauses.next_pause())

    async def _serve(self, robot: AsyncRobot, pauses: BackOff) -> None:
        """Be the bridge while both connections live.  Raises ClientError, MqttError."""
        settings = self._settings
        things = things_of(await robot.overview(), settings.joints)
        told, model = await robot.run("[robot.name, robot.model]", timeout=SILENCE_S)
        topics = self._topics = HomeTopics(settings.name or safe(str(told)) or "robot")
        will = aiomqtt.Will(topics.availability, "offline", qos=1, retain=True)
        async with aiomqtt.Client(
            settings.host, settings.port, username=settings.user or None, password=settings.password or None,
            identifier=f"urbihw-{topics.id}", will=will, clean_session=True, keepalive=KEEP_ALIVE_S,
            tls_params=aiomqtt.TLSParameters() if settings.tls else None, max_queued_incoming_messages=MAX_QUEUED,
            queue_type=inbox_for(topics),
        ) as broker:  # fmt: skip
            discovery = discovery_text(topics, short(told), short(model), things)
            await broker.publish(f"{settings.discovery}/device/urbihw_{topics.id}/config", discovery, 1, True)
            await broker.publish(topics.availability, "online", 1, True)
            for topic in (topics.stop, topics.goal("+")):
                await broker.subscribe(topic, qos=0)
            log.info("%s is at %s:%s as %s", short(told), settings.host, settings.port, topics.root)
            pauses.reset()
            try:
                await self._until_one_fails(self._tell(robot, broker, things), self._obey(robot, broker, things))
            finally:
                with contextlib.suppress(aiomqtt.MqttError):
                    await broker.publish(topics.availability, "offline", 1, True)

    async def _until_one_fails(self, *works: Any) -> None:
        """Run all until one ends; its error is raised, the others are cancelled."""
        tasks = [asyncio.ensure_future(work) for work in works]
        try:
            done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
            for task in done:
                task.result()
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    async def _tell(self, robot: AsyncRobot, broker: aiomqtt.Client, things: list[HomeThing]) -> None:
        """Publish the state when it has changed."""
        slots = [*(thing.slot for thing in things), ESTOP, PROBLEMS]
        before = ""
        async with robot.watch(*slots, hz=self._settings.rate, timeout=SILENCE_S) as samples:
            async for _, values in samples:
                text = state_text(things, values)
                if text != before:
                    await broker.publish(self._topics.state, text, retain=False)
                before = text

    async def _obey(self, robot: AsyncRobot, broker: aiomqtt.Client, things: list[HomeThing]) -> None:
        """Carry out the orders of the broker."""
        movable = {thing.name: thing for thing in things}
        queues: dict[str, JointQueue] = {}
        tasks = []
        try:
            async for message in broker.messages:
                topic = str(message.topic)
                if message.retain:
                    continue
                if topic == self._topics.stop:
                    for queue in queues.values():
                        queue.clear()
                    await self._orders.stop(robot)
                    continue
                try:
                    thing, goal = goal_of(self._topics, movable, topic, _bytes(message.payload))
                except HomeOrder as error:
                    await broker.publish(self._topics.error, str(error))
                    continue
                if thing.name not in queues:
                    queue = queues[thing.name] = JointQueue(self._mover(broker, thing))
                    tasks.append(asyncio.create_task(queue.run()))
                queues[thing.name].put(goal)
        finally:
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def _mover(self, broker: aiomqtt.Client, thing: HomeThing) -> Any:
        async def move(goal: float) -> None:
            settings = self._settings
            try:
                await self._orders.move(NAME, {thing.slot: goal}, settings.speed, settings.seconds)
            except (ClientError, OrderRefused) as error:
                await broker.publish(self._topics.error, f"{thing.name}: {short(error)}")

        return move


def _bytes(payload: Any) -> bytes:
    return payload if isinstance(payload, bytes) else str(payload).encode()
