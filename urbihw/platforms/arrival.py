"""The way of a robot from ``open`` to its slots: it may be there at once, or absent at the start and come later.

::

    OPENING --absent--> SHOWING --its slots are there--> ABSENT --it comes--> HERE
       |                   '------------------it comes----------------------> HERE
       '----------------------------------it is there-----------------------> HERE

An absent robot has the slots that the last run found, or, if nothing is known of it, an object ``robot`` that can be
asked and stopped.  ``open`` is answered at ABSENT, with NotReady, and at HERE.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum, auto
from typing import Protocol

from urbihw.kernel.uobject import DeviceError, NotReady, Opened


class Stage(Enum):
    """Where a robot is on its way."""

    OPENING = auto()
    """Nothing is known yet."""
    SHOWING = auto()
    """It is absent; the slots of the absent robot are being made."""
    ABSENT = auto()
    """It is absent, and ``open`` was answered so."""
    HERE = auto()
    """It has been there; it may have been lost since."""


class Arriving(Protocol):
    """What the robot does on its way."""

    def has_link(self) -> bool:
        """Return whether the link to the robot is up."""
        ...

    def build_absent(self) -> bool:
        """Begin to build the tree of the absent robot from what is known of it; return whether anything is known."""
        ...

    def show_stand_in(self, shown: Callable[[], None]) -> None:
        """Make an object ``robot`` of which nothing is known, and call ``shown``."""
        ...

    def on_link_down(self, reason: str) -> None:
        """The measured values are stale."""
        ...

    def on_arrival(self) -> None:
        """It was absent, and has come."""
        ...


class Arrival:
    """Where one robot is on its way, and who waits for its end.

    Attributes:
        stage: where it is.
        awaited: why it is not there yet, "" when it is.
        tree_begun: whether the tree of the robot exists, or is being built: each is built once.
    """

    def __init__(self, robot: Arriving) -> None:
        self._robot = robot
        self._opened: Opened = _ignore
        self.stage = Stage.OPENING
        self.awaited = ""
        self.tree_begun = False

    def begin(self, opened: Opened) -> None:
        """``opened`` gets the answers."""
        self._opened = opened

    def answer(self, error: DeviceError | None) -> None:
        """The robot is there with its slots (None), or the slots of an absent robot are, or it is absent (NotReady), or
        cannot be served (another error)."""
        if self.stage is Stage.HERE:
            return
        if error is None and self._robot.has_link():
            self._arrive()
        elif error is None:
            self._answer_absent()
        elif not isinstance(error, NotReady):
            self.stage = Stage.ABSENT
            self._opened(error)
        else:
            self.awaited = str(error)
            if self.stage is Stage.OPENING:
                self._show_absent()

    def _show_absent(self) -> None:
        self.stage = Stage.SHOWING
        if self.tree_begun:
            self._answer_absent()
        elif self._robot.build_absent():
            self.tree_begun = True
            self._robot.on_link_down(self.awaited)
        else:
            self._robot.show_stand_in(self._answer_absent)

    def _answer_absent(self) -> None:
        if self.stage in (Stage.OPENING, Stage.SHOWING):
            self.stage = Stage.ABSENT
            self._opened(NotReady(self.awaited))

    def _arrive(self) -> None:
        came_later = self.stage is Stage.ABSENT
        self.stage = Stage.HERE
        self.awaited = ""
        self._opened(None)
        if came_later:
            self._robot.on_arrival()


def _ignore(error: DeviceError | None) -> None:
    """The answer before ``open``."""
