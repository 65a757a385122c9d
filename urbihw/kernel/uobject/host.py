"""What a platform holds of the kernel: register classes, make objects, run urbiscript, come back from other threads."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from urbihw.kernel import errors
from urbihw.kernel.uobject.uobject import UObject, UObjectFace, install_functions

if TYPE_CHECKING:
    from urbihw.kernel.runtime.world import World

log = logging.getLogger("urbihw.uobject")

U = TypeVar("U", bound=UObject)


class Programs(Protocol):
    """What runs urbiscript text (see ``lobby.shell.Programs``)."""

    def evaluate(self, text: str, this: Any, file: str | None = None) -> Any:
        """Run a program in the running job."""
        ...


class Host:
    """One kernel as seen by device code."""

    def __init__(self, world: World, programs: Programs) -> None:
        self.world = world
        self._programs = programs
        self._classes: dict[type[UObject], UObjectFace] = {}

    def now(self) -> float:
        """Seconds of the kernel's clock."""
        return self.world.scheduler.clock.now()

    def register(self, kind: type[UObject]) -> UObjectFace:
        """Make a device class known to urbiscript, as a slot of Global (UStart); once is enough."""
        known = self._classes.get(kind)
        if known is not None:
            return known
        name = kind.uname or kind.__name__
        face = UObjectFace(self.world, [self.world.uobject_proto], self, kind)
        face.slots["type"] = self.world.string(name)
        install_functions(self.world, kind, face)
        self.world.ops.put(self.world.global_, name, face)
        self._classes[kind] = face
        return face

    def create(self, kind: type[U], name: str | None = None, *args: Any) -> U:
        """A new instance, as ``Class.new(args)`` would make it; ``name`` makes it a slot of Global."""
        face = self.register(kind).clone()
        made = face.python
        assert isinstance(made, kind)
        made.init(*args)
        if name is not None:
            self.world.ops.put(self.world.global_, name, face)
        return made

    def put(self, name: str, value: Any) -> None:
        """Set a slot of Global to a Python value, a device (its face), or an urbiscript value."""
        face = value.face if isinstance(value, UObject) else self.world.from_python(value)
        self.world.ops.put(self.world.global_, name, face)

    def run(self, text: str, file: str, done: Callable[[str], None] = lambda problem: None) -> None:
        """Run urbiscript in Global, in a job of its own, as if loaded from ``file``.

        ``done(problem)`` is called at the end, with "" or one line that says what went wrong and where
        (``file:line.column: message``).
        """

        def body() -> None:
            try:
                self._programs.evaluate(text, self.world.global_, file)
            except Exception as error:
                done(self.world.describe(error)[0])
            else:
                done("")

        self.world.scheduler.spawn(body, file)

    def each_round(self, action: Callable[[], None]) -> None:
        """Call ``action`` (outside any job; it must be quick) at the end of each round of the scheduler: the time to
        send in one message what all jobs wanted in that round."""
        self.world.scheduler.add_round_hook(action)

    def post(self, action: Callable[[], None]) -> None:
        """From any thread: run ``action`` in the kernel's thread, soon."""
        self.world.scheduler.post(lambda: self.guarded(action, "posted action"))

    def guarded(self, action: Callable[[], Any], what: str) -> None:
        """Run device code so that its errors are logged in one line and go no further."""
        try:
            action()
        except errors.UrbiError as error:
            log.error("%s failed: %s", what, "; ".join(self.world.describe(error)))
        except Exception as error:
            log.error("%s failed: %s: %s", what, type(error).__name__, error)
            log.debug("its traceback", exc_info=error)
