"""A backend of pyusb, in place of libusb: the simulated bus of `usb_endpoint`.

    usb.core.find(idVendor=0x0694, idProduct=0x0002, backend=bus("/tmp/usb-bus-4242"))

The numbers in the descriptors are those of the brick (firmware: d_usb.c).  Errors are those that libusb gives on Linux.
"""

from __future__ import annotations

import errno
import os
import select
import socket
from array import array
from collections.abc import Iterator
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, NoReturn

import usb.backend  # type: ignore[import-untyped]
import usb.core  # type: ignore[import-untyped]

from urbihw_fakes.nxt.usb_endpoint import CLAIMED

_GREETING_TIMEOUT_S = 5.0  # s
_FULL_SPEED = 2  # libusb's number for 12 Mbit/s
_LANGUAGES, _SERIAL = 0x0300, 0x0301  # string descriptors
_US_ENGLISH = 0x0409
# libusb's own numbers, beside those of Linux
_IO, _ACCESS, _NO_DEVICE, _NOT_FOUND, _BUSY, _TIMEOUT, _PIPE = -1, -3, -4, -5, -6, -7, -9


def bus(at: str) -> Bus:
    """Return the bus of the folder `at`."""
    return Bus(at)


@dataclass(frozen=True)
class Plugged:
    """A device on the bus: its socket, and its address, which changes with each plugging."""

    path: str
    address: int

    @property
    def serial(self) -> str:
        """The serial number of the brick."""
        return os.path.basename(self.path)


@dataclass
class Handle:
    """An opened device; `link` is None unless its interface is claimed."""

    device: Plugged
    configuration: int = 0
    link: socket.socket | None = None


class Bus(usb.backend.IBackend):  # type: ignore[misc]
    """The methods of a backend that a host needs for a device with two bulk endpoints."""

    def __init__(self, folder: str) -> None:
        super().__init__()
        self._folder = folder

    # ---------------------------------------------------------------- what is there

    def enumerate_devices(self) -> Iterator[Plugged]:
        """Yield the plugged devices."""
        try:
            names = sorted(os.listdir(self._folder))
        except OSError:
            return
        for name in names:
            path = os.path.join(self._folder, name)
            yield Plugged(path, os.stat(path).st_ino % 127 + 1)

    def get_device_descriptor(self, dev: Plugged) -> Any:
        """Return the device descriptor of the brick."""
        return SimpleNamespace(
            bLength=18, bDescriptorType=1, bcdUSB=0x0200, bDeviceClass=0, bDeviceSubClass=0, bDeviceProtocol=0,
            bMaxPacketSize0=8, idVendor=0x0694, idProduct=0x0002, bcdDevice=0, iManufacturer=0, iProduct=0,
            iSerialNumber=1, bNumConfigurations=1,
            address=dev.address, bus=1, port_number=1, port_numbers=(1,), speed=_FULL_SPEED,
        )  # fmt: skip

    def get_configuration_descriptor(self, dev: Plugged, config: int) -> Any:
        """Return the only configuration."""
        _check_index(config, 1)
        return SimpleNamespace(
            bLength=9, bDescriptorType=2, wTotalLength=32, bNumInterfaces=1, bConfigurationValue=1, iConfiguration=0,
            bmAttributes=0xC0, bMaxPower=0, extra_descriptors=b"",
        )  # fmt: skip

    def get_interface_descriptor(self, dev: Plugged, intf: int, alt: int, config: int) -> Any:
        """Return the only interface."""
        _check_index(intf + alt + config, 1)
        return SimpleNamespace(
            bLength=9, bDescriptorType=4, bInterfaceNumber=0, bAlternateSetting=0, bNumEndpoints=2,
            bInterfaceClass=0xFF, bInterfaceSubClass=0xFF, bInterfaceProtocol=0xFF, iInterface=0,
            extra_descriptors=b"",
        )  # fmt: skip

    def get_endpoint_descriptor(self, dev: Plugged, ep: int, intf: int, alt: int, config: int) -> Any:
        """Return one of the two bulk endpoints: 0x01 out, 0x82 in."""
        _check_index(ep, 2)
        return SimpleNamespace(
            bLength=7, bDescriptorType=5, bEndpointAddress=(0x01, 0x82)[ep], bmAttributes=2, wMaxPacketSize=64,
            bInterval=0, bRefresh=0, bSynchAddress=0, extra_descriptors=b"",
        )  # fmt: skip

    # ---------------------------------------------------------------- opening

    def open_device(self, dev: Plugged) -> Handle:
        """Open the device.  Fails as libusb does for one that is gone or not writable."""
        if not os.path.exists(dev.path):
            _fail(_NO_DEVICE, errno.ENODEV, "No such device (it may have been disconnected)")
        if not os.access(dev.path, os.W_OK):
            _fail(_ACCESS, errno.EACCES, "Access denied (insufficient permissions)")
        return Handle(dev)

    def close_device(self, dev_handle: Handle) -> None:
        """Close the device: its interface is free again."""
        self.release_interface(dev_handle, 0)

    def set_configuration(self, dev_handle: Handle, config_value: int) -> None:
        """Select a configuration; the brick has only one."""
        dev_handle.configuration = config_value

    def get_configuration(self, dev_handle: Handle) -> int:
        """Return the selected configuration."""
        return dev_handle.configuration

    def claim_interface(self, dev_handle: Handle, intf: int) -> None:
        """Connect to the socket of the device; fails as busy when another host is connected."""
        if dev_handle.link is not None:
            return
        link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            link.settimeout(_GREETING_TIMEOUT_S)
            link.connect(dev_handle.device.path)
            greeting = link.recv(64)
        except OSError:
            link.close()
            _fail(_NO_DEVICE, errno.ENODEV, "No such device (it may have been disconnected)")
        if greeting != CLAIMED:
            link.close()
            _fail(_BUSY, errno.EBUSY, "Resource busy")
        dev_handle.link = link

    def release_interface(self, dev_handle: Handle, intf: int) -> None:
        """Disconnect from the socket of the device."""
        if dev_handle.link is not None:
            dev_handle.link.close()
            dev_handle.link = None

    def reset_device(self, dev_handle: Handle) -> None:
        """Do nothing: a reset of the port changes nothing on the brick."""

    # ---------------------------------------------------------------- transfers

    def bulk_write(self, dev_handle: Handle, ep: int, intf: int, data: array[int], timeout: int) -> int:
        """Send one transfer; return its length."""
        try:
            _claimed(dev_handle).send(data.tobytes())
        except OSError:
            _fail(_NO_DEVICE, errno.ENODEV, "No such device (it may have been disconnected)")
        return len(data)

    def bulk_read(self, dev_handle: Handle, ep: int, intf: int, buff: array[int], timeout: int) -> int:
        """Receive one transfer into `buff`; return its length. `timeout` in ms, 0 for none."""
        link = _claimed(dev_handle)
        if not select.select((link,), (), (), timeout / 1000 if timeout else None)[0]:
            raise usb.core.USBTimeoutError("Operation timed out", _TIMEOUT, errno.ETIMEDOUT)
        try:
            packet = link.recv(65536)
        except OSError:
            packet = b""
        if not packet:
            _fail(_NO_DEVICE, errno.ENODEV, "No such device (it may have been disconnected)")
        count = min(len(packet), len(buff))
        buff[:count] = array("B", packet[:count])
        return count

    def ctrl_transfer(
        self, dev_handle: Handle, bmRequestType: int, bRequest: int, wValue: int, wIndex: int, data: Any, timeout: int
    ) -> int:
        """Answer GET_DESCRIPTOR for strings; other requests stall."""
        strings = {
            _LANGUAGES: _US_ENGLISH.to_bytes(2, "little"),
            _SERIAL: dev_handle.device.serial.encode("utf-16-le"),
        }
        if (bmRequestType, bRequest) != (0x80, 6) or wValue not in strings:
            _fail(_PIPE, errno.EPIPE, "Pipe error")
        text = strings[wValue]
        answer = bytes([len(text) + 2, 3]) + text
        count = min(len(answer), len(data))
        data[:count] = array("B", answer[:count])
        return count


def _check_index(index: int, count: int) -> None:
    """Raise an error for an index beyond `count`: pyusb counts up until it gets this error."""
    if index >= count:
        raise IndexError(index)


def _claimed(handle: Handle) -> socket.socket:
    if handle.link is None:
        _fail(_NOT_FOUND, errno.ENOENT, "Entity not found")
    return handle.link


def _fail(code: int, number: int, text: str) -> NoReturn:
    raise usb.core.USBError(text, code, number)
