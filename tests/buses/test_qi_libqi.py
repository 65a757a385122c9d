"""What needs no libqi of its back end: urls, the missing package, and values that it would spoil."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from urbihw import buses
from urbihw.buses.errors import BadUrl, BadValue, Unavailable
from urbihw.buses.link import Context, byte_link
from urbihw.extras import install_command
from urbihw_nao.qimessaging.libqi import LibqiPort
from urbihw_nao.qimessaging.libqi_values import from_libqi, to_libqi
from urbihw_nao.qimessaging.opening import open_session
from urbihw_nao.qimessaging.signatures import parse


@pytest.mark.parametrize("scheme", ["libqi", "libqis"])
def test_a_missing_package_is_named_with_its_extra(scheme: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "qi", None)
    with pytest.raises(Unavailable) as error:
        buses.open(f"{scheme}://127.0.0.1")
    assert str(error.value) == (
        f"{scheme}:// needs the Python package qi (for x86-64 Linux and Python up to 3.12 only): "
        f"{install_command('libqi', wheel='urbihw-nao')}; qi:// needs no package"
    )


@pytest.mark.parametrize(
    ("url", "text"),
    [
        ("libqi://nao:0", "write libqi://host or libqi://host:port"),
        ("libqis://:9503", "write libqis://host or libqis://host:port"),
        ("qis://nao:port", "write qis://host or qis://host:port"),
        ("libqi://nao?baud=9600", "baud"),
    ],
)
def test_urls_that_are_none(url: str, text: str) -> None:
    with pytest.raises(BadUrl, match=text):
        buses.port_for(url, Context())


@pytest.mark.parametrize(("url", "address"), [("libqi://nao", ("nao", 9559)), ("libqis://nao", ("nao", 9503)),
                                              ("libqi://nao:4", ("nao", 4))])  # fmt: skip
def test_ports_of_urls(url: str, address: tuple[str, int]) -> None:
    port = buses.port_for(url, Context())
    assert isinstance(port, LibqiPort) and port.address == address
    with pytest.raises(BadUrl, match="moves no bytes"):
        byte_link(port)


def test_a_port_that_can_have_no_session() -> None:
    with pytest.raises((BadUrl, Unavailable)):
        open_session(buses.port_for("can://virtual/x", Context()))


@pytest.mark.parametrize(
    ("signature", "value", "sent"),
    [
        ("i", 5.0, 5),
        ("f", 5, 5.0),
        ("b", 1.0, True),
        ("r", b"\xff", b"\xff"),
        ("m", (1, (2.5, "a")), [1, [2.5, "a"]]),
        ("[m]", ({"a": (1,)},), [{"a": [1]}]),
        ("(ir)", [5.0, b"\xff"], (5, b"\xff")),
        ("{si}", {"a": 5.0}, {"a": 5}),
    ],
)
def test_arguments_as_libqi_sends_them(signature: str, value: Any, sent: Any) -> None:
    found = to_libqi(parse(signature), value, 0)
    assert found == sent and type(found) is type(sent)


@pytest.mark.parametrize("value", [b"\xff", [b"\xff"], {"a": bytearray(b"x")}])
def test_bytes_in_a_dynamic_value_are_refused_instead_of_spoilt(value: Any) -> None:
    with pytest.raises(BadValue, match=r"libqi makes text of bytes in a dynamic value \(m\); qi:// sends them"):
        to_libqi(parse("m"), value, 0)


def test_values_without_end_are_refused() -> None:
    loop: list[Any] = []
    loop.append(loop)
    with pytest.raises(BadValue, match="too deep"):
        to_libqi(parse("m"), loop, 0)


@pytest.mark.parametrize(
    ("signature", "value", "found"),
    [
        ("(ir)<P,z,a>", {"z": 1, "a": bytearray(b"\xff")}, (1, b"\xff")),
        ("[(ir)<P,z,a>]", [{"z": 1, "a": bytearray(b"x")}], [(1, b"x")]),
        ("m", [bytearray(b"x"), {"a": (1, bytearray(b"y"))}], [b"x", {"a": (1, b"y")}]),
        ("{sm}", {"a": [bytearray(b"x")]}, {"a": [b"x"]}),
        ("m", None, None),
    ],
)
def test_results_as_our_own_session_gives_them(signature: str, value: Any, found: Any) -> None:
    assert from_libqi(parse(signature), value) == found
