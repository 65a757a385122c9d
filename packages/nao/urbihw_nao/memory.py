"""Places and events of ALMemory that programs follow, as the kernel has them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from urbihw.buses.messages import Reply
from urbihw.kernel.uobject import Host, UEvent, UVar
from urbihw.platforms.channel import DeviceChannel, Done
from urbihw.platforms.devicelog import DeviceLog
from urbihw_nao.sense_part import MOST_FOLLOWED

EVENTS: Final = "nao.memoryEvents"
"""The object with the Events of ALMemory."""


class MemoryLinks:
    """Variables that follow a key of ALMemory, and events that are listened to; both outlive a lost link."""

    def __init__(self, host: Host, channel: DeviceChannel, log: DeviceLog) -> None:
        self._host, self._channel, self._log = host, channel, log
        self._vars: set[UVar] = set()
        self._bound: dict[UVar, str] = {}
        self._listened: dict[str, None] = {}
        self._events: dict[str, tuple[str, UEvent]] = {}

    def connect(self) -> None:
        """The robot was found: follow and listen to the same, for the worker may be another one."""
        for key in dict.fromkeys(self._bound.values()):
            self._follow(key, self._warn(key))
        for key in self._listened:
            self._channel.send_request("listen", key, self._warn(key))

    def _warn(self, key: str) -> Done:
        def done(reply: Reply) -> None:
            if not reply.ok:
                self._log.warning("%s: not followed: %s", key, reply.error)

        return done

    # ---------------------------------------------------------------- variables

    def bind(self, key: str, path: str, done: Done) -> None:
        """Let a variable follow a key; ``done`` gets the reply.  Raises ValueError, in words for the user."""
        var = self._host.var(path)
        if var not in self._vars and (var.owned or not var.writable):
            raise ValueError(f"{path} is a variable of another device")
        others = {each for one, each in self._bound.items() if one is not var}
        if key not in others and len(others) == MOST_FOLLOWED:
            raise ValueError(f"{MOST_FOLLOWED} places of the memory are bound: no more")
        if var not in self._vars:
            self._vars.add(var)
            var.own()
            var.protect()
        self._bound[var] = key

        def answered(reply: Reply) -> None:
            if not reply.ok:
                self._bound.pop(var, None)
            done(reply)

        self._follow(key, answered)

    def _follow(self, key: str, done: Done) -> None:
        def answered(reply: Reply) -> None:
            if reply.ok and reply.value:
                self.show({key: reply.value[0]}, self._host.now())
            done(reply)

        self._channel.send_request("follow", key, answered)

    def show(self, values: Mapping[str, Any], stamp: float) -> None:
        """Show values of keys that are followed."""
        for var, key in self._bound.items():
            if key in values:
                var.sense(values[key], stamp)

    # ---------------------------------------------------------------- events

    def listen(self, key: str, done: Done) -> None:
        """Listen to an event; ``done`` gets the reply."""
        self._listened[key] = None

        def answered(reply: Reply) -> None:
            if not reply.ok:
                self._listened.pop(key, None)
            done(reply)

        self._channel.send_request("listen", key, answered)

    def event_slot(self, key: str) -> str:
        """The slot of EVENTS that has the Event of a key; it is made at the first time."""
        if key not in self._events:
            slot = f"event{len(self._events)}"
            path = f"{EVENTS}.{slot}"
            self._events[key] = slot, self._host.event(path)
            self._host.event(f"{path}.onSubscribe").listen(lambda: self._listen_again(key))
        return self._events[key][0]

    def _listen_again(self, key: str) -> None:
        if key not in self._listened:
            # While the link is down, ``connect`` asks for it.
            self._listened[key] = None
            self._channel.send_request("listen", key, lambda _: None)

    def emit(self, key: str, value: Any) -> None:
        """An event has come: emit that of urbiscript, and listen no longer if no program follows it."""
        if key not in self._events:
            return
        event = self._events[key][1]
        if event.has_subscribers:
            event.emit(value)
        elif key in self._listened:
            del self._listened[key]
            self._channel.send_request("unlisten", key, lambda _: None)
