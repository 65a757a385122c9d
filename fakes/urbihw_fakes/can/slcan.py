"""An adapter that speaks the Lawicel text ("slcan"): commands and frames as lines that end with a carriage return.

    S6            500 kbit/s            O, C      open, close the channel
    t4138014C004E00000000               a frame: identifier (3 digits), length (1), data
    (empty line)                        nothing; python-can sends one when it opens

The answer is a carriage return, or a bell (7) for what the adapter does not understand or cannot do now. Frames of the
bus come through while the channel is open, in the same form.

Source: Lawicel CAN232 manual, version 3; what python-can 4.6 sends was looked at on a pseudo terminal.
Not covered: extended (T, R) and remote (r) frames, CAN FD, time stamps (Z), status (F), acceptance filters, speeds.
"""

from __future__ import annotations

from urbihw_fakes.can.node import CanFrame

OK, BELL, END = b"\r", b"\a", b"\r"
_LONGEST = 30  # of a line; what is longer is no command of this adapter


class Slcan:
    """The codec of such an adapter. `open` is what the channel is."""

    def __init__(self) -> None:
        self.open = False
        self._rest = b""

    def decode(self, data: bytes) -> tuple[list[CanFrame], bytes]:
        """Decode text of the host."""
        *lines, rest = (self._rest + data).split(END)
        self._rest = rest if len(rest) <= _LONGEST else b""
        frames: list[CanFrame] = []
        reply = b""
        for line in lines:
            reply += self._execute_line(line, frames)
        return frames, reply

    def encode(self, frame: CanFrame) -> bytes:
        """A frame as a line; none while the channel is closed."""
        if not self.open:
            return b""
        return b"t%03X%d%s\r" % (frame.id, len(frame.data), frame.data.hex().upper().encode("ascii"))

    def _execute_line(self, line: bytes, frames: list[CanFrame]) -> bytes:
        word = line[:1]
        if word in (b"", b"S", b"s"):
            return OK
        if word == b"V":
            return b"V1013" + OK
        if word == b"O":
            self.open = True
            return OK
        if word == b"C":
            self.open = False
            return OK
        if word == b"t" and self.open:
            return self._frame(line, frames)
        return BELL

    def _frame(self, line: bytes, frames: list[CanFrame]) -> bytes:
        try:
            identifier, length, data = int(line[1:4], 16), int(line[4:5]), bytes.fromhex(line[5:].decode("ascii"))
        except ValueError:
            return BELL
        if identifier > 0x7FF or length > 8 or len(data) != length:
            return BELL
        frames.append(CanFrame(identifier, data))
        return OK
