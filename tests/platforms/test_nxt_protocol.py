"""The driver's half of the captures: what is sent, and what replies mean."""

from __future__ import annotations

import pytest

from urbihw.buses.errors import BadFrame, BadValue
from urbihw.platforms.nxt import protocol as p
from urbihw_fakes import captures

EXCHANGES = captures.read("nxt")


def reply(name: str) -> bytes:
    (telegram,) = EXCHANGES[name].received
    return telegram


@pytest.mark.parametrize(
    ("name", "telegram"),
    [
        ("battery", p.battery()),
        ("firmware", p.firmware_version()),
        ("device-info", p.device_info()),
        ("tone", p.tone(440, 500)),
        ("tone-replied", p.replied(p.tone(14000, 200))),
        ("tone-of-the-manual", p.raw(bytes((3, 10, 10, 0, 0)), reply=False)),
        ("motor-limit", p.run(0, 75, 360)),
        ("motors-hold", p.run(p.ALL_OUTPUTS, 0)),
        ("motors-coast", p.coast(p.ALL_OUTPUTS)),
        ("touch-mode", p.input_mode(0, p.SWITCH, p.BOOLEAN)),
        ("light-values", p.input_values(2)),
        ("output-state", p.output_state(1)),
        ("reset-rotation", p.reset_rotation(1)),
        ("keep-alive", p.keep_alive(reply=True)),
        ("sonar-ask", p.ls_write(3, b"\x02\x42", 1)),
        ("sonar-ready", p.ls_status(3)),
        ("sonar-read", p.ls_read(3)),
        ("unknown", p.raw(b"\x77", reply=True)),
    ],
)
def test_requests_are_those_captured(name: str, telegram: bytes) -> None:
    assert [telegram] == EXCHANGES[name].sent


def test_replies_mean_what_the_captures_say() -> None:
    assert p.parse_battery(reply("battery")) == 7890
    assert p.parse_version(reply("firmware")) == p.BrickVersion((1, 124), (1, 29))
    assert p.parse_device_info(reply("device-info")) == p.BrickInfo("NXT", "00:16:53:01:02:03", 65536)
    assert p.parse_sleep_limit(reply("keep-alive")) == 600_000
    assert p.parse_output_state(reply("output-state")) == p.OutputState(1, 75, 7, 1, 0, 0x20, 0, -1234, -10, 720)
    assert p.parse_input_values(reply("light-values")) == p.InputValues(
        2, True, False, p.LIGHT_ACTIVE, p.PERCENT, 400, 729, 71, 729
    )
    assert p.parse_ls_status(reply("sonar-ready")) == 1
    assert p.parse_ls_read(reply("sonar-read")) == b"\x25"
    for name in ("touch-mode", "reset-rotation", "tone-replied", "rename", "start-program", "message", "sonar-ask"):
        assert p.body(reply(name), 0) == b""


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("motor-bad-port", "a value is out of range (status 0xc0)"),
        ("output-state-bad-port", "a value is out of range"),
        ("stop-program", "no program is running"),
        ("program-name", "no program is running"),
        ("sonar-pending", "still busy"),
        ("sonar-missing", "no sensor answers on the I2C bus"),
        ("open-missing", "no such file"),
        ("unknown", "unknown command"),
    ],
)
def test_refusals_are_said_in_words(name: str, words: str) -> None:
    with pytest.raises(p.BrickRefused) as caught:
        p.body(reply(name), 0)
    assert words in str(caught.value)


@pytest.mark.parametrize("text", ["", "02", "02 0b", "03 0b 00 d2 1e", "02 0b 00", "02 0b 00 d2"])
def test_a_reply_cut_short_or_not_one_is_a_bad_frame(text: str) -> None:
    with pytest.raises(BadFrame):
        p.parse_battery(bytes.fromhex(text))


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (b"", "1 to 63 bytes"),
        (bytes(64), "1 to 63 bytes"),
        (b"\x97", "erases the firmware"),
        (b"\xff", "no system command"),
    ],
)
def test_commands_that_are_never_sent(body: bytes, words: str) -> None:
    with pytest.raises(BadValue, match=words):
        p.raw(body, reply=True)


def test_the_i2c_bus_takes_sixteen_bytes() -> None:
    for data, count in ((b"", 1), (bytes(17), 0), (b"\x02", 17)):
        with pytest.raises(BadValue, match="16"):
            p.ls_write(0, data, count)
