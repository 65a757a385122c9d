"""The genuine libusb under pyusb: a brick whose kernel side is replayed by umockdev (Debian: umockdev, libusb-1.0-0).

Everything else about USB is tested on a simulated bus (`urbihw_fakes.nxt.usb_backend`); this shows that
descriptors, claim and transfers pass through libusb as they do there.  Skipped where one of the two is not installed.
"""

from __future__ import annotations

import ctypes.util
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from urbihw_fakes import captures

pytestmark = [
    pytest.mark.e2e,
    pytest.mark.skipif(
        shutil.which("umockdev-run") is None or ctypes.util.find_library("usb-1.0") is None,
        reason="umockdev and libusb-1.0-0 are not both installed",
    ),
]

TIMEOUT_S = 60.0
HUB = "12010002090001406b1d020010050302010109021900010100e0000904000001090000000705810304000c"
BRICK = "12010002000000089406020000000000010109022000010100c0000904000002ffffff000705010240000007058202400000"

PROGRAM = """
from urbihw import buses
from urbihw.platforms.nxt import protocol
for _ in range(2):
    with buses.open_link("usb://0694:0002") as link:
        assert link.packets
        link.write(protocol.battery())
        print(protocol.parse_battery(link.read(64, link.clock.now() + 5)))
"""


def device(path: str, number: int, descriptors: str) -> str:
    """A device in the words of umockdev."""
    text = descriptors.upper()
    return f"""\
P: {path}
N: bus/usb/001/{number:03}={text}
E: BUSNUM=001
E: DEVNAME=/dev/bus/usb/001/{number:03}
E: DEVNUM={number:03}
E: DEVTYPE=usb_device
E: SUBSYSTEM=usb
A: bConfigurationValue=1\\n
A: busnum=1\\n
A: devnum={number}\\n
A: speed=12\\n
H: descriptors={text}

"""


def transfer(endpoint: int, data: bytes, room: int) -> str:
    """A bulk transfer that the kernel has done: a record of USBDEVFS_REAPURBNDELAY."""
    whole = data.ljust(room, bytes(1)).hex().upper()
    return f"USBDEVFS_REAPURBNDELAY 0 3 {endpoint} 0 0 {room} {len(data)} 0 {whole}\n"


def test_the_brick_is_asked_through_libusb(tmp_path: Path) -> None:
    exchange = captures.read("nxt")["battery"]
    (tmp_path / "devices").write_text(device("/devices/usb1", 1, HUB) + device("/devices/usb1/1-1", 5, BRICK))
    records = "@DEV /dev/bus/usb/001/005\nUSBDEVFS_GET_CAPABILITIES 0 FD010000\n"
    records += transfer(0x01, exchange.sent[0], 2) + transfer(0x82, exchange.received[0], 64)
    (tmp_path / "records").write_text(records)
    replay = ("umockdev-run", "-d", str(tmp_path / "devices"), "-i", f"/dev/bus/usb/001/005={tmp_path / 'records'}")
    done = subprocess.run(
        (*replay, "--", sys.executable, "-c", PROGRAM), capture_output=True, text=True, timeout=TIMEOUT_S, check=False
    )
    assert done.stdout.split() == ["7890", "7890"], done.stderr
