"""Devices with two bulk endpoints on USB: `usb://0694:0002`, vendor and product in hex.

Options of the url, behind `?` and joined by `&`:

    serial=001653010203      the one with this serial number, where several are plugged in
    backend=module:function  what pyusb uses in place of libusb; called with the value of `at`
    at=TEXT                  for the backend

A write is one transfer and so is a read, so packets stay what they are (`packets` is true).  pyusb does the work; it
needs libusb 1.0, unless a backend is named.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import math
import re
from collections.abc import Mapping
from typing import Any, Final

import usb.core  # type: ignore[import-untyped]
import usb.util  # type: ignore[import-untyped]

from urbihw.buses.errors import BadUrl, LinkGone, Unavailable
from urbihw.buses.link import Context, Link, Url
from urbihw.settings import TEXT, SettingRule

FULL_SPEED: Final = 12_000_000
_WRITE_TIMEOUT_MS = 1000  # ms
_INTERFACE = 0
_IDS = re.compile(r"([0-9a-fA-F]{4}):([0-9a-fA-F]{4})")


class UsbLink(Link):
    """The bulk endpoints of interface 0, claimed for us alone."""

    packets = True

    def __init__(self, url: Url, context: Context) -> None:
        super().__init__(url, context)
        ids = _IDS.fullmatch(url.target)
        if ids is None:
            raise BadUrl(f"bus url {url.text!r}: write usb://VENDOR:PRODUCT in hex, for instance usb://0694:0002")
        self.baud = FULL_SPEED
        self._ids = int(ids[1], 16), int(ids[2], 16)
        self._device: Any = None
        self._out: Any = None
        self._in: Any = None
        self._rest = b""

    @classmethod
    def parameters(cls, url: Url) -> Mapping[str, SettingRule]:
        """Return the rules of the parameters that the head of this file lists."""
        return {"serial": TEXT, "backend": TEXT, "at": TEXT}

    def _open(self) -> None:
        device = self._find()
        try:
            try:
                configuration = device.get_active_configuration()
            except usb.core.USBError as error:
                if error.errno is not None:
                    raise
                # Without an error number pyusb means that the device has no active configuration yet.
                device.set_configuration()
                configuration = device.get_active_configuration()
            usb.util.claim_interface(device, _INTERFACE)
            self._out, self._in = _bulk_endpoints(configuration)
        except usb.core.USBError as error:
            _release_device(device)
            raise self._explain(error) from error
        except LookupError as error:
            _release_device(device)
            raise Unavailable(errno.ENODEV, f"{self.url.text}: this device has no pair of bulk endpoints") from error
        self._device = device
        self._rest = b""

    def _close(self) -> None:
        device, self._device = self._device, None
        if device is not None:
            _release_device(device)

    def _read(self, size: int, deadline: float) -> bytes:
        if not self._rest:
            # A time-out of 0 would wait for ever. 1 ms after the deadline still collects what has arrived.
            pause = max(1, math.ceil((deadline - self.clock.now()) * 1000))
            try:
                self._rest = self._in.read(self._in.wMaxPacketSize, pause).tobytes()
            except usb.core.USBTimeoutError:
                return b""
            except usb.core.USBError as error:
                raise self._gone("reading", error) from error
        data, self._rest = self._rest[:size], self._rest[size:]
        return data

    def _write(self, data: bytes) -> None:
        try:
            sent = self._out.write(data, _WRITE_TIMEOUT_MS)
        except usb.core.USBError as error:
            raise self._gone("writing", error) from error
        if sent != len(data):
            raise LinkGone(f"{self.url.text}: took {sent} of {len(data)} bytes; is it stuck?")

    def _gone(self, what: str, error: OSError) -> LinkGone:
        return LinkGone(f"{self.url.text}: {what} failed ({error.strerror or error}); was it unplugged?")

    # ---------------------------------------------------------------- finding

    def _find(self) -> Any:
        vendor, product = self._ids
        backend = self._backend()
        try:
            devices = list(usb.core.find(find_all=True, idVendor=vendor, idProduct=product, backend=backend))
        except usb.core.NoBackendError as error:
            raise Unavailable(
                errno.ENOPKG, "libusb is missing, without which USB cannot be used: sudo apt install libusb-1.0-0"
            ) from error
        except usb.core.USBError as error:
            raise self._explain(error) from error
        serial = self.options.get("serial", "")
        if serial:
            named = [device for device in devices if _serial(device).upper() == serial.upper()]
            for device in devices:
                # Reading the serial number has opened the device.
                if device not in named:
                    _release_device(device)
            devices = named
        if not devices:
            which = f" and serial number {serial}" if serial else ""
            raise Unavailable(
                errno.ENODEV,
                f"no USB device {vendor:04x}:{product:04x}{which}; is it plugged in and switched on?",
            )
        if len(devices) > 1:
            numbers = ", ".join(sorted(_serial(device) or "unknown" for device in devices))
            for device in devices:
                _release_device(device)
            raise Unavailable(
                errno.EBUSY,
                f"{len(devices)} USB devices are {vendor:04x}:{product:04x}; name one with ?serial= "
                f"(there are: {numbers})",
            )
        return devices[0]

    def _backend(self) -> Any:
        """Return the backend object for pyusb; None lets pyusb choose."""
        entry = self.options.get("backend", "")
        if not entry:
            return None
        module_name, _, name = entry.partition(":")
        try:
            return getattr(importlib.import_module(module_name), name)(self.options.get("at", ""))
        except (ImportError, AttributeError, ValueError) as error:
            raise BadUrl(f"bus url {self.url.text!r}: cannot make the backend {entry!r}: {error}") from error

    def _explain(self, error: OSError) -> Unavailable:
        vendor, product = self._ids
        name = f"USB device {vendor:04x}:{product:04x}"
        if error.errno in (errno.EACCES, errno.EPERM):
            return Unavailable(
                errno.EACCES,
                f"no permission to open {name}: install urbihw/share/99-urbihw.rules and add yourself to the group "
                "dialout (sudo usermod -aG dialout $USER), then log in again",
            )
        if error.errno == errno.EBUSY:
            return Unavailable(errno.EBUSY, f"{name} is in use by another program; close that one first")
        return Unavailable(error.errno or errno.EIO, f"cannot open {name}: {error.strerror or error}")


def _bulk_endpoints(configuration: Any) -> tuple[Any, Any]:
    """Out and in.  Raises LookupError."""
    found: dict[int, Any] = {}
    for endpoint in configuration[(_INTERFACE, 0)]:
        if usb.util.endpoint_type(endpoint.bmAttributes) == usb.util.ENDPOINT_TYPE_BULK:
            found.setdefault(usb.util.endpoint_direction(endpoint.bEndpointAddress), endpoint)
    return found[usb.util.ENDPOINT_OUT], found[usb.util.ENDPOINT_IN]


def _serial(device: Any) -> str:
    """Its serial number; "" when it has none, or when we may not ask (pyusb then says that it has no languages)."""
    try:
        return str(usb.util.get_string(device, device.iSerialNumber) or "")
    except (usb.core.USBError, ValueError, NotImplementedError):
        return ""


def _release_device(device: Any) -> None:
    # An unplugged device cannot be released any more; it is let go all the same.
    with contextlib.suppress(usb.core.USBError):
        usb.util.dispose_resources(device)
