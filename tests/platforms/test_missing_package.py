"""A package that is missing on this machine: waiting for the robot is no use."""

from __future__ import annotations

import importlib

import pytest
from nxt_lab import Lab

from urbihw.kernel.uobject import BadConfig


class UsbLab(Lab):
    """An NXT on the USB of this machine."""

    url = "usb://0694:0002"


def test_a_missing_libusb_is_a_mistake_not_an_absent_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("libusb1", "libusb0", "openusb"):
        monkeypatch.setattr(importlib.import_module(f"usb.backend.{name}"), "get_backend", lambda *_, **__: None)
    lab = UsbLab()
    lab.until(lambda: bool(lab.opened))
    (error,) = lab.opened
    assert isinstance(error, BadConfig)
    assert "sudo apt install libusb-1.0-0" in str(error)
