"""The link of a robot, and its way from ``open`` to its slots: it may be there at once, or absent and come later.

::

    OPENING --absent--> SHOWING --its slots are there--> ABSENT --it comes--> HERE
       |                   '------------------it comes----------------------> HERE
       '----------------------------------it is there-----------------------> HERE

An absent robot has the slots that the last run found, or, if nothing is known of it, an object ``robot`` that can be
asked and stopped.  ``open`` is answered at ABSENT, with NotReady, and at HERE.
"""

from __future__ import annotations

from enum import Enum, auto
from typing import Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import BadConfig, DeviceError, DevicePart, NotReady, Opened, UObject, event, reading
from urbihw.platforms.devicelog import DeviceLog
from urbihw.platforms.guarded import MotionGuard
from urbihw.platforms.hooks import RobotHooks
from urbihw.platforms.problems import ProblemReport
from urbihw.platforms.remembered import DeviceMemory
from urbihw.repeats import Later

FIRST_READING_TIMEOUT_S: Final = 2.0
"""Seconds to wait for the first reading of all devices before ``open`` is answered."""
LINK_DOWN: Final = "the link to the robot is down"
"""Explains why a robot does not obey."""

_ABSENT: Final = """\
{{
  if (!Global.hasLocalSlot("robot")) Global.setSlot("robot", Component.new("robot"))
  | robot.shareLink({slot})
  | if (!robot.hasLocalSlot("stop")) robot.setSlot("stop", function () {{ {slot}.stop }})
}};
"""
"""The object ``robot`` of a robot of which nothing is known yet; its tree takes the place of it."""


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


class Arrival(DevicePart):
    """The link of one robot, where the robot is on its way, and who waits for its end.

    Attributes:
        stage: where it is.
        awaited: why it is not there yet, "" when it is.
        tree_begun: whether the tree of the robot exists, or is being built: each is built once.
    """

    url = reading("")
    link = reading(False)
    linkLost = event()
    linkBack = event()

    def __init__(
        self, device: UObject, guard: MotionGuard, report: ProblemReport, memory: DeviceMemory, log: DeviceLog,
        later: Later, hooks: RobotHooks,
    ) -> None:
        """``memory`` has the devices of the last run; ``later`` sets the kernel's timers."""  # fmt: skip
        super().__init__(device)
        self._guard, self._report, self._memory = guard, report, memory
        self._log, self._later, self._hooks = log, later, hooks
        self._opened: Opened = _ignore
        self.stage = Stage.OPENING
        self.awaited = ""
        self.tree_begun = False
        self._had_link_loss = False
        guard.motion.set_absent(None, LINK_DOWN)

    def begin(self, url: str, opened: Opened) -> None:
        """Search for the robot at a url; ``opened`` gets the answers."""
        self.url.sense(url)
        self._opened = opened

    @property
    def opening(self) -> bool:
        """Whether the robot has not been there yet since ``open``."""
        return self.stage is not Stage.HERE

    def is_up(self) -> bool:
        """Return whether the link to the robot is up."""
        return bool(self.link.sensed)

    # ---------------------------------------------------------------- the answer of open

    def answer(self, error: DeviceError | None) -> None:
        """The robot is there with its slots (None), or the slots of an absent robot are, or it is absent (NotReady), or
        cannot be served (another error).

        ``open`` is answered with NotReady once while the robot is absent, and with None once when it is there; an
        arrival after a NotReady emits ``linkBack``.
        """
        if error is not None:
            self._hooks.on_absent()
        if self.stage is Stage.HERE:
            return
        if error is None and self.is_up():
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

    def wait_for_readings(self) -> None:
        """Answer ``open`` when ``is_complete``, or after a time-out: a device may have died since it was found."""
        if self.is_up():
            self._later(FIRST_READING_TIMEOUT_S, lambda: self.answer(None))
        else:
            self.answer(None)

    def _show_absent(self) -> None:
        self.stage = Stage.SHOWING
        if self.tree_begun:
            self._answer_absent()
        elif self._build_remembered() or self._hooks.build_absent():
            self.tree_begun = True
            self._hooks.on_link_down(self.awaited)
        else:
            self.host.run(_ABSENT.format(slot=self.device.unique_name), "absent", self._has_stand_in)

    def _build_remembered(self) -> bool:
        """Begin to build the tree of the absent robot from what the last run found, if that is known."""
        known = self._memory.recall()
        if not known:
            return False
        try:
            self._hooks.on_found(m.Found(known))
        except Exception as error:  # The file may describe devices that do not exist; the robot itself will tell.
            self._log.warning("the devices of the last run cannot be shown: %s: %s", self._memory.file, error)
            return False
        return True

    def _has_stand_in(self, problem: str) -> None:
        if problem:
            self._log.error("the slots of the absent robot are not there: %s", problem)
        self._answer_absent()

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
            self.linkBack.emit()

    # ---------------------------------------------------------------- messages of the worker

    def found(self, message: m.Found) -> None:
        """The worker has found devices: the first time, and after each loss of the link."""
        self._memory.keep(message.devices)
        if not self.opening:
            self._hooks.on_found(message)
            return
        if message.devices:
            # An adapter alone is no robot.
            self._show_link(True)
        self._hooks.on_found(message)
        if message.devices and self.tree_begun:
            # The platform waits for readings only once, when the tree has been built.
            self.wait_for_readings()
        self.tree_begun = self.tree_begun or bool(message.devices)

    def link_changed(self, message: m.LinkState) -> None:
        """The link is up or down, or it cannot be opened."""
        if self.opening and not message.up:
            self.answer((BadConfig if message.mistake else NotReady)(message.reason))
        if self.is_up() == message.up or (self.opening and message.up):
            return
        self._show_link(message.up)
        # Again when it is up: what was ordered meanwhile has not reached the robot.
        self._guard.count_standstill()
        if message.up:
            self._report.tell_again()
            if self._had_link_loss:
                self._log.warning("link to %s is back", self.url.sensed, event="link-back")
                self.linkBack.emit()
            return
        self._had_link_loss = True
        self._guard.link_lost(message.reason)
        self._log.warning("link lost: %s; trying again until it is back", message.reason, event="link-lost")
        self._hooks.on_link_down(message.reason)
        self.linkLost.emit(message.reason)

    def _show_link(self, up: bool) -> None:
        self.link.sense(up)
        motion = self._guard.motion
        if not up:
            # The driver reports the devices that are lost again when the link is up.
            for device in list(motion.absent):
                motion.set_absent(device, "")
        motion.set_absent(None, "" if up else LINK_DOWN)


def _ignore(error: DeviceError | None) -> None:
    """The answer before ``open``."""
