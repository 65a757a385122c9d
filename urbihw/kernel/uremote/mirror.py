"""The actions of devices in a remote process, sent to the server: the half of the bridge that faces the devices."""

from __future__ import annotations

import logging
import secrets
from collections.abc import Callable
from typing import Any
from weakref import WeakSet

from urbihw.kernel import errors
from urbihw.kernel.runtime.event import Event
from urbihw.kernel.runtime.object import Obj
from urbihw.kernel.uobject.binary import UBinary
from urbihw.kernel.uobject.host import Host, Observer
from urbihw.kernel.uobject.uevent import UEvent
from urbihw.kernel.uobject.uobject import UObject, UObjectFace
from urbihw.kernel.uobject.uvar import UVar
from urbihw.kernel.uremote import announce
from urbihw.kernel.uremote.frames import Update
from urbihw.kernel.uremote.outbox import Outbox
from urbihw.kernel.uremote.remote import ServerReader, literal, quoted
from urbihw.kernel.uremote.rtp import SECRET_SIZE
from urbihw.kernel.uremote.rtplink import OpenPort, RtpLink
from urbihw.kernel.uremote.udp import UdpPort, is_same
from urbihw.kernel.uremote.wire_values import from_wire, to_wire

log = logging.getLogger("urbihw.remote")


class DeviceMirror(Observer):
    """The devices of ``host`` as the server knows them; ``ready`` is true when all of them are announced."""

    def __init__(self, host: Host, write: Callable[[list[bytes | memoryview]], None]) -> None:
        self._host = host
        self._world = host.world
        self._out = Outbox(write)
        self._reader = ServerReader()
        self._faces: dict[str, UObjectFace] = {}
        self._devices: dict[str, UObject] = {}
        self._foreign: dict[str, Obj] = {}
        self._foreign_vars: dict[UVar, str] = {}
        self._heard: dict[str, Event] = {}
        self._questions: dict[str, Callable[[Any], None]] = {}
        self._asked = 0
        self._extended = False
        self._offset = 0.0
        self._doomed: set[str] = set()
        self._refreshed: WeakSet[UVar] = WeakSet()
        self._rtp_link: RtpLink | None = None
        self.peer = "127.0.0.1"
        """The address of the server, for RTP."""
        self.local = ""
        """The address of this process as the server sees it, "" if it is unknown."""
        self.open_port: OpenPort = UdpPort
        self.ready = False

    # ---------------------------------------------------------------- classes and instances

    def registered(self, face: UObjectFace) -> None:
        """A class was registered; for a hub class, its instance is announced too."""
        name = self._world.text(face.slots["__uobjectName"])
        self._faces[name] = face
        if face.python is not None:
            self.made(face.python)
        elif self.ready:
            self._out.chain(announce.class_lines(name, face.kind, self._extended))

    def made(self, device: UObject) -> None:
        """An instance was made."""
        name = device.unique_name
        self._devices[name] = device
        for var in device.variables.values():
            var.mirror = self
        for slot, event in device.events.items():
            self.bound_event(device, slot, event)
        if self.ready:
            self._announce(name, device)

    def _announce(self, name: str, device: UObject) -> None:
        """Declare an instance with its values."""
        self._out.chain(announce.instance_lines(name, device, self._extended))
        for var in device.variables.values():
            self._send_value(var)
            for known in self._properties(var):
                self.property_set(var, known)
        kind = self._host.register(type(device)).slots["__uobjectName"].s
        if kind != name:
            self._out.add_statement(f"if (isdef(uobjects.{kind})) {name}.setProtos([uobjects.{kind}])")
        self._out.chain(announce.init_lines(name, type(device), self._extended))

    @staticmethod
    def _properties(var: UVar) -> list[str]:
        return [name for name in var.property_names() if name != "rtp"]

    def bound_var(self, device: UObject, var: UVar) -> None:
        """A variable was bound."""
        name = device.unique_name
        if self._devices.get(name) is not device:
            return
        var.mirror = self
        if self.ready:
            own, protected = self._extended and var.owned, self._extended and not var.writable
            self._out.chain(announce.var_lines(name, var.name, name, own, protected))
            self._send_value(var)

    def bound_event(self, device: UObject, name: str, event: UEvent) -> None:
        """An event was bound."""
        path = device.unique_name
        if self._devices.get(path) is not device:
            return
        event.mirror = lambda payload: self._out.emit(f"{path}.{name}", [to_wire(value) for value in payload])
        if self.ready:
            self._out.chain([announce.event_line(path, name)])

    def bound_function(self, device: UObject, name: str, method: Callable[..., Any]) -> None:
        """A function was bound after construction."""
        if self.ready and device.unique_name in self._devices:
            self._out.chain(announce.function_lines(device.unique_name, name, method, self._extended))

    def notified(self, device: UObject, var: UVar) -> None:
        """No operation: the server sends the changes of all announced variables."""

    def access_notified(self, device: UObject, var: UVar) -> None:
        """Refresh the value periodically: reads happen at the server and cannot be observed here."""
        if var not in self._refreshed:
            self._refreshed.add(var)
            device.set_timer(0, var.refresh)

    def listened(self, device: UObject, event: UEvent, handler: Callable[..., Any] | None) -> None:
        """Subscribe to an event of the server."""
        path = next((f"{device.unique_name}.{slot}" for slot, one in device.events.items() if one is event), event.path)
        if not path or handler is None:
            return
        for number in announce.arities(handler):
            name = f"{path}__{number}"
            if name not in self._heard:
                self._heard[name] = event.face
                self._announce_listener(name)

    def _announce_listener(self, name: str) -> None:
        if self.ready:
            path, _, number = name.rpartition("__")
            self._out.add_statement(f"external event ({number}) {path} from {path.rpartition('.')[0]}")

    def destroyed(self, device: UObject) -> None:
        """An instance was destroyed."""
        name = device.unique_name
        if self._devices.pop(name, None) is not None and self.ready and name not in self._doomed:
            self._out.add_statement(f"{name}.destroy")
        for heard in [one for one in self._heard if one.startswith(f"{name}.")]:
            del self._heard[heard]

    def put(self, holder: UObject | None, name: str, value: Any) -> None:
        """A plain slot was set."""
        path = "Global" if holder is None else holder.unique_name
        if self.ready and (holder is None or path in self._devices):
            text = literal(to_wire(value)).decode("latin-1")
            self._out.add_statement(f"if (!isdef({path}.{name})) var {path}.{name}|{path}.{name} = {text}")

    def send(self, text: str) -> bool:
        """Run urbiscript at the server, in the background and in Global, as for a device in the server's process."""
        self._out.background(f"Global.eval({quoted(text)})")
        return True

    # ---------------------------------------------------------------- variables

    def find(self, path: str) -> Any:
        """A stand-in for an object of another process, with only the variables in use."""
        if path in self._devices:
            return self._devices[path].face
        known = self._foreign.get(path)
        if known is None:
            known = self._foreign[path] = self._world.proto()
            known.slots["__uobjectName"] = self._world.string(path)
        return known

    def looked_up(self, var: UVar) -> None:
        """Subscribe to a variable of an object of another process."""
        if var not in self._foreign_vars and var.mirror is None:
            var.mirror = self
            self._foreign_vars[var] = var.full_name
            if self.ready:
                self._announce_foreign(var, var.full_name)

    def _announce_foreign(self, var: UVar, name: str) -> None:
        path, _, slot = name.rpartition(".")
        source = next(iter(self._devices), next(iter(self._faces), path))
        self._out.chain(announce.var_lines(path, slot, source, False, False))
        known = var.current(False) is not self._world.void

        def answer(value: Any) -> None:
            if value is not None:
                var.learn(from_wire(self._world, self._devices, value), self._host.now(), known)

        self._ask(name, answer)

    def sensed(self, var: UVar) -> None:
        """The owner reported a value."""
        if self.ready and self._known(var):
            self._send_value(var)

    def _known(self, var: UVar) -> bool:
        return var in self._foreign_vars or self._world.text(var.holder.slots["__uobjectName"]) in self._devices

    def _send_value(self, var: UVar) -> None:
        stamp = max(0, int((var.stamp + self._offset) * 1e6))
        other = None if self._rtp_link is None else lambda update: self._by_rtp(var, update)
        self._out.update(var.full_name, lambda: to_wire(var.current(False)), stamp, other)

    def _by_rtp(self, var: UVar, update: Update) -> bool:
        """Send a value by RTP if enabled; binary values are sent by RTP unless ``use_rtp`` forbids it."""
        wanted = var.get_property("rtp")
        if wanted is None:
            wanted = isinstance(update.value, UBinary) if var.rtp is None else var.rtp
        link = self._rtp_link
        return bool(wanted) and update.value is not None and link is not None and link.send(update, self._host.now())

    def assigned(self, var: UVar, value: Any) -> None:
        """Assign the variable at the server."""
        self._out.add_statement(f"{var.full_name} = {literal(to_wire(value)).decode('latin-1')}")

    def property_set(self, var: UVar, name: str) -> None:
        """Set the property at the server."""
        if not self.ready or not self._known(var):
            return
        if name == "rtp":
            text = "true" if var.get_property(name) else "false"
            self._out.add_statement(f'{var.holder.slots["__uobjectName"].s}.getSlot("{var.name}").rtp = {text}')
        else:
            self._out.add_statement(f"{var.full_name}->{name} = {literal(var.get_property(name)).decode('latin-1')}")

    def _ask(self, text: str, answer: Callable[[Any], None]) -> None:
        self._asked += 1
        tag = f"urbihw_get_{self._asked}"
        self._questions[tag] = answer
        self._reader.valued.add(tag)
        self._out.background(f"UObject.syncGet({quoted(text)}, {quoted(tag)})")

    def _changed(self, name: str, value: Any, stamp: float) -> None:
        path, _, slot = name.rpartition(".")
        made = from_wire(self._world, self._devices, value)
        device = self._devices.get(path)
        if device is None:
            holder = self._foreign.get(path)
            var = None if holder is None else holder.slots.get(slot)
            if isinstance(var, UVar):
                var.learn(made, stamp)
            return
        own = device.variables.get(slot)
        if own is not None:
            self._world.call_soon(lambda: self._assign(own, made))

    def _assign(self, var: UVar, value: Any) -> None:
        try:
            var.assign(value)
        except errors.ThrownError as refusal:
            log.warning("%s refused: %s", var.full_name, self._world.describe(refusal)[0])
            if not var.owned:
                self.sensed(var)

    # ---------------------------------------------------------------- RTP

    def _open_rtp(self) -> None:
        """Agree with the server on RTP."""
        secret = secrets.token_bytes(SECRET_SIZE)
        try:
            link = RtpLink(self.peer, secret, self._host.post, self._heard_by_rtp, self.open_port, self.local)
        except OSError as error:
            log.warning("no port for RTP: %s; values stay on the connection", error.strerror)
            return

        def answer(agreed: Any) -> None:
            match agreed:
                case [str(address), float(port), float(source)] if self._rtp_link is link:
                    if is_same(address, link.peer):
                        link.to(int(port), int(source))
                        return
            log.warning("the server does not take RTP; values stay on the connection")
            if self._rtp_link is link:
                self._close_rtp()

        self._rtp_link = link
        self._ask(f'UObject.rtpOpen("{secret.hex()}", {link.port}, {link.source})', answer)

    def _close_rtp(self) -> None:
        link, self._rtp_link = self._rtp_link, None
        if link is not None:
            link.close()

    def _heard_by_rtp(self, update: Update) -> None:
        if self.ready:
            self._changed(update.name, update.value, update.stamp / 1e6 - self._offset)
