"""The object ``ALMotor``: how all joints are written, and the trace of their orders (manual, "Advanced
parameters").
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

from urbihw.buses import messages as m
from urbihw.kernel.uobject import RobotSettings, UObject, event, finite_number, function, reading
from urbihw.platforms.channel import DeviceChannel
from urbihw_nao import words
from urbihw_nao.joint_part import MOTORS
from urbihw_nao.options import NaoOptions

SLOT: Final = "ALMotor"
"""The name of the only instance in Global."""


class NaoMotorControl(UObject):
    """``dcmWrite``: joints are written by the DCM; ``dcmShift``: s from a write to the date of its command;
    ``traceFile``: where the trace is written, "" while there is none.

    ``answered`` has the number of a change, and why it was refused, or "".
    """

    slot_words = words.DCM

    dcmWrite = reading(False)
    dcmShift = reading(0.0)
    traceFile = reading("")
    answered = event()

    def init(self, channel: DeviceChannel, settings: RobotSettings) -> None:
        """Made by the robot; ``settings`` are those at its start."""
        self._channel = channel
        self._count = 0
        self._chosen: dict[str, Any] = {}
        self._control = settings.control
        self._options = options = NaoOptions.of(settings.options)
        self._trace_file = _trace_file(options, self._control)
        self.dcmWrite.sense(options.dcm_write)
        self.dcmShift.sense(options.dcm_shift)

    def configure(self, settings: RobotSettings) -> None:
        """The settings were read again: one that has changed replaces what programs have chosen."""
        old, new = self._options, NaoOptions.of(settings.options)
        self._options, self._trace_file = new, _trace_file(new, self._control)
        if new.dcm_write != old.dcm_write:
            self._chosen.pop("dcm", None)
            self.dcmWrite.sense(new.dcm_write)
        if new.dcm_shift != old.dcm_shift:
            self._chosen.pop("shift", None)
            self.dcmShift.sense(new.dcm_shift)

    def choose_again(self) -> None:
        """The link is back, perhaps with another worker: what programs have chosen counts on."""
        for item, value in self._chosen.items():
            self._channel.write(MOTORS, item, value, lambda reply: None)

    def was_refused(self, message: m.Refused) -> None:
        """The worker could not carry out an earlier order."""
        if message.item == "dcm":
            self.dcmWrite.sense(False)
        elif message.item == "trace":
            self._chosen.pop("trace", None)
            self.traceFile.sense("")

    # ---------------------------------------------------------------- what urbiscript calls

    @function("chooseDCM")
    def choose_dcm(self, on: Any) -> int:
        """Write joints by the DCM (true, 1), or by setAngles (false, 0); ``answered`` has the number."""
        return self._choose("dcm", _switch(on), lambda: self.dcmWrite.sense(_switch(on)))

    @function("chooseShift")
    def choose_shift(self, shift: Any) -> int:
        """Milliseconds from a write to the date of its command; ``answered`` has the number."""
        seconds = finite_number(shift) / 1000
        return self._choose("shift", seconds, lambda: self.dcmShift.sense(seconds))

    @function("chooseTrace")
    def choose_trace(self, on: Any) -> int:
        """Begin (1) or end (0) the trace; ``answered`` has the number."""
        path = self._trace_file if _switch(on) else ""
        if _switch(on) and not path:
            raise ValueError("there is no folder for a trace: set options.trace_file")
        return self._choose("trace", path, lambda: self.traceFile.sense(path))

    def _choose(self, item: str, value: Any, done: Any) -> int:
        self._count += 1
        number = self._count

        def answered(reply: m.Reply) -> None:
            if not reply.error:
                self._chosen[item] = value
                done()
            self.answered.emit(float(number), reply.error)

        self._channel.write(MOTORS, item, value, answered)
        return number


def _switch(on: Any) -> bool:
    if not isinstance(on, bool) and on not in (0, 1):
        raise ValueError("takes true or false, 1 or 0")
    return bool(on)


def _trace_file(options: NaoOptions, control: str) -> str:
    """The file of the settings, or one beside the control socket, in a folder that belongs to urbihw alone."""
    if options.trace_file or not control:
        return options.trace_file
    return str(Path(control).with_suffix(".traj.log"))
