"""The announcement in the network, and ``urbihw find``: by multicast DNS on the interfaces of this machine."""

from __future__ import annotations

import json
import socket
import sys

import pytest

from urbihw.cli.main import main
from urbihw.daemon import announce
from urbihw.daemon.announce import Announcement, reachable, service_name
from urbihw.daemon.config import Config
from urbihw.daemon.observers import Observers
from urbihw.kernel.uobject import BadConfig

pytestmark = pytest.mark.e2e

Capture = pytest.CaptureFixture[str]


def has_multicast() -> bool:
    """Whether this machine passes on what is sent to the group of multicast DNS."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.sendto(b"", ("224.0.0.251", 5353))
        except OSError:
            return False
    return True


def test_what_this_machine_alone_reaches_is_not_announced(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(announce, "_own_addresses", lambda: ["192.0.2.7"])
    assert reachable(["127.0.0.1", "::1", "127.3.4.5"]) == []
    assert reachable(["192.0.2.9"]) == ["192.0.2.9"]
    assert reachable(["0.0.0.0", "::"]) == ["192.0.2.7"]
    assert reachable(["fe80::1%eth0"]) == ["fe80::1%eth0"]


def test_the_name_of_a_service_fits_into_a_label() -> None:
    assert service_name("bioloid", 54000, "lab.example.org") == "bioloid-54000 on lab"
    assert len(service_name("bioloid", 54000, "ä" * 90).encode()) <= 63


@pytest.mark.skipif(not has_multicast(), reason="no multicast here")
def test_a_robot_is_found_and_found_no_more_when_its_daemon_has_ended(capsys: Capture) -> None:
    made = Announcement("bioloid", 54321, ["192.0.2.7"], tls=True)
    made.start()
    try:
        assert main(("find", "--seconds", "4", "--json")) == 0
        (row,) = [row for row in json.loads(capsys.readouterr().out) if row["port"] == 54321]
        assert (row["addresses"], row["platform"]) == (["192.0.2.7"], "bioloid")
        assert main(("find", "--seconds", "4")) == 0
        assert "192.0.2.7 port 54321: bioloid" in capsys.readouterr().out
    finally:
        made.close()
    main(("find", "--seconds", "2"))
    assert "54321" not in capsys.readouterr().out


def test_without_the_package_one_line_tells_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: Capture
) -> None:
    monkeypatch.setitem(sys.modules, "zeroconf", None)
    assert main(("find",)) == 78
    assert "avahi-browse" in capsys.readouterr().err
    with pytest.raises(BadConfig, match="announce: this needs a package: "):
        Observers(Config(announce=True)).bind(["192.0.2.7"], 54000)
    Observers(Config(announce=True)).bind(["127.0.0.1"], 54000)
