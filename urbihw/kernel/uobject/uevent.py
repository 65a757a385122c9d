"""An event of a device: the device emits it, or listens to it (manual, section 3.8)."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from urbihw.kernel.runtime.event import Emission, Event
from urbihw.kernel.uobject.registry import registry_of
from urbihw.kernel.uobject.uvalue import from_urbi, to_urbi

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

Handler = Callable[..., Any]


class UEvent:
    """An urbiscript event as device code sees it; ``path`` is its name if it was looked up by name."""

    def __init__(self, world: World, face: Event, path: str = "") -> None:
        self._world = world
        self.face = face
        self.path = path
        self.mirror: Callable[[list[Any]], None] | None = None

    @property
    def has_subscribers(self) -> bool:
        """Whether anybody would notice an emission."""
        return bool(self.face.subscriptions)

    def emit(self, *payload: Any) -> None:
        """Emit the event with a payload of Python values and devices, from any thread; handlers run as jobs.

        In a remote process (``mirror``) the server emits the event and notifies the listeners of this process.
        """
        registry = registry_of(self._world)
        if registry.foreign:
            registry.call(lambda: self.emit(*payload))
            return
        values = [to_urbi(self._world, value) for value in payload]
        if self.mirror is not None:
            self.mirror(values)
            return

        def emit() -> None:
            self.face.emit(values)

        self._world.call_soon(emit)

    def listen(self, begun: Handler | None, ended: Handler | None = None) -> UEventListener:
        """Call ``begun(*payload)`` when an emission begins, and ``ended(*payload)`` when it ends."""
        listener = UEventListener(self._world, begun, ended)
        self.face.subscribe(listener)
        return listener

    def remove_listener(self, listener: UEventListener) -> None:
        """Remove a listener; a second call has no effect."""
        self.face.subscriptions.pop(listener, None)


class UEventListener:
    """Device code that is called at emissions; it must return at once."""

    def __init__(self, world: World, begun: Handler | None, ended: Handler | None) -> None:
        self._world = world
        self._begun = begun
        self._ended = ended

    def offer(self, emission: Emission) -> None:
        """Called when an emission begins."""
        emission.matches.append((self, True))
        self._call(self._begun, emission)

    def ended(self, emission: Emission, match: Any) -> None:
        """Called when an emission ends."""
        self._call(self._ended, emission)

    def _call(self, handler: Handler | None, emission: Emission) -> None:
        if handler is not None:
            payload = [from_urbi(value) for value in emission.payload]
            registry_of(self._world).guarded(lambda: handler(*payload), "handler of an event")
