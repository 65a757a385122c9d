"""The variables that move a robot: their guard, and what a device shows of its writes.

Each write is checked by the robot's ``Motion`` and gets an ``Origin``; the device shows what was requested, what is
applied, and what limits it, and warns the writer.
"""

from __future__ import annotations

import math
import weakref
from collections.abc import Hashable, Sequence
from typing import Any, ClassVar, Final

from urbihw.kernel import errors
from urbihw.kernel.runtime.backtrace import calling_frame
from urbihw.kernel.uobject.declarations import event, reading
from urbihw.kernel.uobject.motion import Motion, Origin
from urbihw.kernel.uobject.uobject import UObject
from urbihw.kernel.uobject.uvalue import from_urbi
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uobject.values import finite_number

OFF: Final = "off"
"""Value of ``limitedBy`` for writes to a device that is switched off."""


class Effector:
    """The guard of one variable that moves the robot (see ``EffectorDevice``).

    Attributes:
        origin: origin of the last accepted write.
        device: the device that it moves, by its name in the bus worker.
        limited: the last write as limited by the worker, and the name of the limit.  It is valid until the next report
            of the worker or the next stop.  None while no limit acts.
    """

    def __init__(self, motion: Motion, device: Hashable, var: UVar, face: EffectorDevice) -> None:
        self.origin = motion.own()
        self._motion = motion
        self.device = device
        self._var = var
        self._face = face
        self._statement: object = None
        self._limited: tuple[int, Any, str] | None = None
        var.effector = self

    def admit(self, wanted: Any, value: Any) -> None:
        """Check a write.  ``wanted`` is the assigned value, ``value`` what the range of the slot leaves of it.

        Raises an urbiscript error if the writer may not move the robot (see ``Motion.admit``) or the value is no finite
        number.
        """
        if wanted.__class__ is not float:
            self._check_number(wanted)
        elif not math.isfinite(wanted):
            raise errors.primitive(f"takes a finite number, not {wanted:g}", self._var.name)
        frame, job = calling_frame(), self._motion.running
        # A weak reference is no other job's, as a place in memory may be when the job has ended.
        statement = None if frame is None or job is None else (weakref.ref(job), frame.f_code, frame.f_lasti)
        known = self.origin if statement == self._statement else None
        pace = math.inf if job is None else job.pace_of(self._var)
        self.origin = self._motion.admit(self.device, known, statement, pace)
        self._statement = statement
        self._face.wrote(self, wanted, value)

    def _check_number(self, wanted: Any) -> None:
        """Raise the error for a value that is neither a number nor a truth value; nothing was requested by it."""
        try:
            finite_number(from_urbi(wanted))
        except ValueError as error:
            raise errors.primitive(str(error), self._var.name) from error

    def warn_of_absence(self) -> bool:
        """Warn the writer if the device is absent, and return whether it is."""
        if not self._motion.is_absent(self.device):
            return False
        self._motion.warn_of_absence(self.device, self.origin)
        return True

    def check_end(self) -> None:
        """Raise the error of a trajectory that ends while its device is absent: where that is, is unknown."""
        reason = self._motion.explain_absence(self.device)
        if reason:
            raise errors.primitive(f"{reason}: the movement has ended without it, repeat it", self._var.name)

    @property
    def losses(self) -> int:
        """How often devices were lost or back."""
        return self._motion.absences

    @property
    def limited(self) -> tuple[Any, str] | None:
        """The limited value and the name of the limit; None while no limit acts."""
        return None if self._limited is None or self._limited[0] != self._motion.stops else self._limited[1:]

    def set_limited(self, value: Any, limit: str) -> None:
        """Store the worker's report: the limited value and the name of the limit, "" for none."""
        self._limited = (self._motion.stops, value, limit) if limit else None

    @property
    def since(self) -> int:
        """The lowest ``Job.era`` of a statement that may move this effector."""
        return self._motion.since(self.device)

    @property
    def unit(self) -> str:
        """The unit of the slot."""
        return str(self._var.get_property("unit") or "1")

    def warn_of_limit(self, limit: str) -> None:
        """Warn the client that wrote that a limit of the settings acts."""
        self._motion.warn_of_limit(limit, self.origin)

    def limits(self) -> str:
        """The range of the slot, in words."""
        least, most = (self._var.get_property(name) for name in ("rangemin", "rangemax"))
        return f"range of {self._var.name}: {least:g} to {most:g}"


class EffectorDevice(UObject):
    """A device with effectors: it shows the requested value, the applied value and the writer.

    ``requested`` and ``applied`` are the last written value and the value after the limits, in the unit of the written
    slot; ``limitedBy`` is the name of the limit, "" if there was none; ``why`` describes the writer.  ``limited`` is
    emitted with the name of the limit when a write is limited and the write before was not.

    A write while the device is switched off is limited by ``OFF``: ``applied`` is nan and ``why`` explains how to
    switch the device on.  Each client that writes gets the same explanation once as a warning or, if ``off_is_error``
    is set, as the error of each such write.  Each client that writes while the device or the link is lost gets one
    warning for this loss.
    """

    off_is_error: ClassVar[bool] = False
    slot_words = {
        "requested": ("value last written, in the unit of its slot", "1"),
        "applied": ("value last written after the limits, nan while the device is off", "1"),
        "limitedBy": ("limit that changed the value last written, empty for none", ""),
        "why": ("who wrote last: connection, tag, place in the program, time", ""),
        "limited": ("event: a limit begins to act; with its name", ""),
    }

    requested = reading(math.nan)
    applied = reading(math.nan)
    limitedBy = reading("")
    why = reading("")
    limited = event()

    def guard(self, motion: Motion, device: Hashable, var: UVar) -> Effector:
        """Guard a variable: only a writer that may move ``device`` at that time can write it."""
        self.notify_access(self.why, self._tell_why)
        made = Effector(motion, device, var, self)
        if not self._has_unit:
            self._take_unit(made)
        return made

    def _take_unit(self, effector: Effector) -> None:
        """Give ``requested`` and ``applied`` the unit of the slot that was written, at first that of the first one."""
        self._has_unit = True
        for var in (self.requested, self.applied):
            var.set_property("unit", effector.unit)

    def wrote(self, effector: Effector, wanted: Any, value: Any) -> None:
        """A write was accepted."""
        if effector is not self._last_effector:
            self._last_effector = effector
            self._take_unit(effector)
        self.requested.sense(wanted)
        off = self.explain_off()
        is_error = bool(off) and self.off_is_error
        absent = not is_error and effector.warn_of_absence()
        if off:
            self.show_applied(math.nan, OFF)
            if not is_error and not absent:
                self.warn(effector.origin, off, effector.losses)
            return
        if self._warned:
            self._warned = []
        limited = effector.limited
        if limited is not None:
            self.show_applied(*limited)
        else:
            self.show_applied(value, effector.limits() if value is not wanted and value != wanted else "")

    def limit_applied(self, value: Any, limit: str) -> None:
        """Store the worker's report about the last write: the limited value and the name of the limit, "" when no limit
        acts any more.
        """
        if self._last_effector is not None:
            self._last_effector.set_limited(value, limit)
        if self.limitedBy.sensed != OFF:
            self.show_limited(value, limit)

    def show_limited(self, value: Any, limit: str) -> None:
        """Show what a limit of the settings left of the last write, and warn the writer."""
        if limit and self._last_effector is not None:
            self._last_effector.warn_of_limit(limit)
        self.show_applied(value, limit)

    def show_applied(self, value: Any, limit: str) -> None:
        """Set ``applied`` and ``limitedBy`` after a write."""
        self.applied.sense(value)
        if limit != self.limitedBy.sensed:
            self.limitedBy.sense(limit)
            if limit:
                self.limited.emit(limit)

    def explain_off(self) -> str:
        """The reason why the device ignores writes and how to switch it on, in words; "" while it is on.  Override."""
        return ""

    def explain_hindrance(self) -> str:
        """What keeps the device from what was written, and what to do, in words; "" for nothing.  Override."""
        return ""

    _last_effector: Effector | None = None
    _has_unit = False
    _warned: Sequence[Any] = ()
    """The clients that were warned of the present cause."""
    _cause: tuple[str, int] = "", 0

    def warn(self, origin: Origin, text: str, losses: int = 0) -> None:
        """Warn the writing client once of each cause; a trajectory writes at each of its steps."""
        if self._cause != (text, losses):
            self._cause, self._warned = (text, losses), []
        if origin.lobby is not None and all(lobby is not origin.lobby for lobby in self._warned):
            present = [lobby for lobby in self._warned if getattr(lobby, "connected", True)]
            self._warned = [*present, origin.lobby]
            origin.warn(text)

    def _tell_why(self) -> None:
        if self._last_effector is not None:
            origin = self._last_effector.origin
            off = self.explain_off() if self.limitedBy.sensed == OFF else ""
            more = [text for text in (off, self.explain_hindrance()) if text]
            self.why.sense("; ".join([f"{origin}, {origin.time:.3f} s", *more]))
