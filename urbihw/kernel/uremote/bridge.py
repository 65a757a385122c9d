"""Devices in a remote process: their actions are sent to a server, and the server's requests are executed here.

A process with remote devices has a kernel of its own, in which the devices are installed as usual; the bridge connects
this kernel to a server.  It uses no socket: ``connected`` and ``lost`` report the state of the link, ``receive`` gets
its bytes, and ``write`` sends bytes.  After a lost connection, the next connection restores the server's objects: same
names, same values.

It uses the messages of the original remotes (remote UObject protocol, section 11).  With a server that supports them,
it uses some extensions: variables with separate target and sensed value, numbers with all digits, functions with
optional arguments.
"""

from __future__ import annotations

import logging
import re
import secrets
from collections.abc import Callable
from typing import Any

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Emission
from urbihw.kernel.uobject.host import Host
from urbihw.kernel.uobject.uobject import UObject
from urbihw.kernel.uremote import announce
from urbihw.kernel.uremote.mirror import DeviceMirror
from urbihw.kernel.uremote.remote import MessageCode, ProtocolError, ServerLine, ServerReader, quoted
from urbihw.kernel.uremote.wire_values import from_wire, to_wire

log = logging.getLogger("urbihw.remote")

_CALL = re.compile(r'\[0, "[^"]*", "(\w+)"')

HELLO, BINARY = "urbihw_hello", "urbihw_binary"


class Bridge(DeviceMirror):
    """Connects the devices of ``host`` to a server.

    ``token`` identifies this process in names; ``write`` accepts lists of byte strings.  ``taken`` are the classes that
    the server already has from another process.
    """

    def __init__(self, host: Host, token: str, write: Callable[[list[bytes | memoryview]], None]) -> None:
        super().__init__(host, write)
        self._secret = secrets.token_hex(16)
        self._failed: dict[str, str] = {}
        self._emissions: dict[str, list[Emission]] = {}
        self.taken: list[str] = []
        host.observer = self
        host.registry.prefix = f"uob_{token}_"
        for face in host.classes():
            self.registered(face)
        host.each_round(self._out.flush)

    # ---------------------------------------------------------------- the link

    def connected(self) -> None:
        """Called when a server is connected: ask for its version, and whether it has our classes from another
        process.
        """
        self._reader = ServerReader()
        self._reader.valued |= {HELLO, BINARY}
        self._out.reset()
        for word, argument in (("rejoin", quoted(self._secret)), ("exactNumbers", "true")):
            self._out.add_statement(f"if (isdef(UObject.{word})) UObject.{word}({argument})")
        asked = ["isdef(binaryMode)", "isdef(UVar.own)", *(f"isdef(uobjects.{name})" for name in self._faces)]
        self._out.add_statement(f'Channel.new("{HELLO}") << [{", ".join(asked)}]')
        self._out.flush()

    @property
    def congested(self) -> Callable[[], bool]:
        """Whether the link is congested; values of variables then wait."""
        return self._out.congested

    @congested.setter
    def congested(self, slow: Callable[[], bool]) -> None:
        self._out.congested = slow

    def drained(self) -> None:
        """Called when the link is not congested any more."""
        self._out.flush()

    @property
    def all_taken(self) -> bool:
        """Whether the server has all our classes from another process."""
        return bool(self._faces) and len(self.taken) == len(self._faces)

    @property
    def empty(self) -> bool:
        """Whether all objects were destroyed."""
        return not self._faces and not self._devices

    def lost(self) -> None:
        """Called when the connection is lost."""
        was, self.ready = self.ready, False
        self._out.close()
        self._close_rtp()
        questions, self._questions = self._questions, {}
        for answer in questions.values():
            answer(None)
        for emissions in self._emissions.values():
            for emission in emissions:
                emission.stop()
        self._emissions.clear()
        if was:
            self._notify_devices(lambda device: device.on_disconnected())

    def _notify_devices(self, action: Callable[[UObject], None]) -> None:
        for device in list(self._devices.values()):
            self._host.guarded(lambda device=device: action(device), "a device")  # type: ignore[misc]

    def receive(self, data: bytes) -> None:
        """Process bytes of the server, in pieces of any size.  Raises ProtocolError."""
        for line in self._reader.feed(data):
            self._receive_message(line)

    def _receive_message(self, line: ServerLine) -> None:
        if line.channel == HELLO:
            self._offset = line.stamp / 1000 - self._host.now()
            self._greeted(line.value)
        elif line.channel == BINARY:
            self._out.binary(line.valid and line.value is True)
            self._join()
        elif line.channel in self._questions:
            self._reader.valued.discard(line.channel)
            self._questions.pop(line.channel)(line.value if line.valid else None)
        elif line.value is not None or line.channel == "__ExternalMessage__":
            self._execute_message(line)
        elif line.channel == "error":
            log.warning("the server says: %s", line.text)

    def _greeted(self, value: Any) -> None:
        if not isinstance(value, list) or len(value) != 2 + len(self._faces):
            raise ProtocolError(f"the server answers {value!r} where it should say what it knows")
        binary, self._extended, *known = value
        self.taken = [name for name, one in zip(self._faces, known, strict=True) if one]
        if binary is True:
            self._out.add_statement(f'binaryMode(1, "{BINARY}")')
            self._out.flush()
        else:
            self._join()

    def _join(self) -> None:
        """Announce all classes and instances."""
        self.ready = True
        for name, face in self._faces.items():
            if name not in self.taken and name not in self._devices:
                self._out.chain(announce.class_lines(name, face.kind, self._extended))
        for name, device in self._devices.items():
            if name not in self.taken:
                self._announce(name, device)
        for var, name in self._foreign_vars.items():
            self._announce_foreign(var, name)
        for heard in self._heard:
            self._announce_listener(heard)
        if self._host.rtp and self._extended:
            self._open_rtp()
        self._notify_devices(lambda device: device.on_connected())
        self._out.flush()

    # ---------------------------------------------------------------- what the server wants

    def _execute_message(self, line: ServerLine) -> None:
        message = line.value
        if not isinstance(message, list) or not message or not isinstance(message[0], float):
            log.warning("message of the server left out: %.200s", line.text or message)
            call = _CALL.match(line.text)
            if call is not None:  # a caller waits for the answer
                self._fail(call[1], "the call was not understood")
            return
        try:
            self._execute_command(message[0], message[1:], line.stamp)
        except (ValueError, TypeError, IndexError, KeyError, errors.ThrownError) as error:
            log.warning("message %r of the server left out: %s", message[:3], error)

    def _execute_command(self, code: float, rest: list[Any], stamp: int) -> None:
        if code == MessageCode.CHANGED and len(rest) == 3:
            self._changed(str(rest[0]), rest[1], float(rest[2]) - self._offset)
        elif code == MessageCode.CALL and len(rest) >= 2:
            name, ticket, *args = rest
            self._world.scheduler.spawn(lambda: self._call(str(name), str(ticket), args), str(name))
        elif code in (MessageCode.EVENT, MessageCode.EVENT_END) and rest:
            payload = [from_wire(self._world, self._devices, value) for value in rest[1:]]
            self._world.call_soon(lambda: self._emission(str(rest[0]), payload, code == MessageCode.EVENT))
        elif code == MessageCode.NEW and len(rest) == 2:
            self._new(str(rest[0]), str(rest[1]))
        elif code == MessageCode.DELETE and len(rest) == 1:
            self._delete(str(rest[0]))
        elif code == MessageCode.RTP and len(rest) == 2:
            self._rtp(str(rest[0]), bool(rest[1]))
        elif code not in (MessageCode.NO_RTP, MessageCode.LOCAL):
            log.warning("message with code %g of the server left out", code)

    def _call(self, name: str, ticket: str, args: list[Any]) -> None:
        """Execute a call in a job of its own and answer it."""
        path, _, function = name.rpartition("__")[0].rpartition(".")
        face: Any = self._devices[path].face if path in self._devices else self._faces.get(path)
        try:
            if path in self._failed:
                raise errors.primitive(self._failed.pop(path))
            if face is None:
                raise errors.primitive(f"there is no object {path}")
            values = [from_wire(self._world, self._devices, value) for value in args]
            answer = to_wire(self._world.send(face, function, *values))
            if ticket:
                self._out.answer(ticket, answer)
        except Exception as error:
            if ticket:
                self._fail(ticket, self._error_text(error))

    def _fail(self, ticket: str, words: str) -> None:
        """Answer a call with an exception."""
        self._out.add_statement(f"Global.UObject.funCall({quoted(ticket)}, Exception.new({quoted(words)}))")

    def _error_text(self, error: Exception) -> str:
        """The message of an error, without its location."""
        raised = self._world.normalized(error) if isinstance(error, errors.ThrownError) else error
        if isinstance(raised, errors.Raised):
            return raised.message
        return self._world.describe(raised)[0] if isinstance(raised, errors.ThrownError) else str(error)

    def _new(self, name: str, kind: str) -> None:
        face = self._faces.get(kind)
        try:
            if face is None:
                raise ValueError(f"there is no class {kind}")
            face.make(name)
        except Exception as error:
            log.error("no instance of %s: %s: %s", kind, type(error).__name__, error)
            self._failed[name] = f"{type(error).__name__}: {error}"
            lines = [f"class {name}{{}}", f"external object {name}", f"external function (0) {name}.init from {name}"]
            self._out.chain([*lines, f'if (isdef(UObject.arity)) UObject.arity("{name}.init", 0, -1)'])

    def _delete(self, name: str) -> None:
        device = self._devices.get(name)
        self._failed.pop(name, None)
        self._faces.pop(name, None)
        if device is not None:
            self._doomed.add(name)
            self._host.guarded(device.destroy, "destroy")
            self._doomed.discard(name)
            self._devices.pop(name, None)

    def _rtp(self, name: str, on: bool) -> None:
        path, _, slot = name.rpartition(".")
        device = self._devices.get(path)
        var = None if device is None else device.variables.get(slot)
        if var is not None:
            var.rtp = on

    def _emission(self, name: str, payload: list[Any], begins: bool) -> None:
        event = self._heard.get(name)
        if event is None:
            return
        running = self._emissions.setdefault(name, [])
        if begins:
            running.append(event.begin(payload))
        elif running:
            running.pop(0).stop()
