"""Decoders of traffic: documented bytes become lines, and whatever else comes raises nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import urbihw_fakes
from urbihw import platforms
from urbihw.buses.capture import capture_line, read_capture
from urbihw.buses.errors import BadFrame
from urbihw.buses.servos import packet
from urbihw.buses.trace import Chunk, Direction, TraceDecoder, TracedPacket
from urbihw_nao.qimessaging.frames import CALL, ERROR, QiMessage

CAPTURES = Path(urbihw_fakes.__file__).parent / "captures"
TRACED = [folder.name for folder in platforms.folders() if platforms.read(folder).trace]


def decoder(platform: str, devices: tuple[dict[str, object], ...] = ()) -> TraceDecoder:
    return platforms.load_trace(platforms.find(platform))(devices)


def lines(made: TraceDecoder, *pieces: tuple[Direction, str]) -> list[str]:
    """Direction, device, instruction, values, problem of what these bytes decode to, at 1 ms a piece."""
    found: list[TracedPacket] = []
    for index, (direction, text) in enumerate(pieces):
        found += made.feed(Chunk(index / 1000, direction, bytes.fromhex(text)))
    return [line(each) for each in found + made.flush()]


def line(each: TracedPacket) -> str:
    return " ".join(filter(None, (each.direction, each.device, each.what, each.detail, each.check, each.problem)))


def exchanges(name: str) -> dict[str, list[Chunk]]:
    """The exchanges of a capture by name."""
    found: dict[str, list[Chunk]] = {}
    with open(CAPTURES / f"{name}.hex", encoding="ascii") as file:
        for item in read_capture(file):
            if isinstance(item, str):
                chunks = found[item] = []
            else:
                chunks.append(item)
    return found


def test_every_platform_says_how_its_traffic_is_decoded() -> None:
    # A simulator has no wire.
    assert [folder.name for folder in platforms.folders() if folder.name != "webots"] == TRACED


# ---------------------------------------------------------------- documented bytes


@pytest.mark.parametrize(
    ("platform", "capture", "exchange", "expected"),
    [
        ("bioloid", "dynamixel", "p1-read-temperature", [
            "> 1 read present_temperature @43:1 (as AX-12) ok",
            "< 1 status present_temperature 32 (32 degC) (as AX-12) ok",
        ]),
        ("bioloid", "dynamixel", "p1-sync-write", [
            "> all sync write 0: goal_position 16 (-2.536 rad), moving_speed 336 (3.906 rad/s) (as AX-12); "
            "1: goal_position 544 (0.1663 rad), moving_speed 864 (10.04 rad/s) (as AX-12) ok",
        ]),
        ("bioloid", "dynamixel", "p1-status-alarms", ["< 1 status ok overheating, overload"]),
        ("bioloid", "dynamixel", "p2-broadcast-ping", [
            "> all ping ok", "< 1 status XM430-W210, firmware 38 ok", "< 2 status XM430-W210, firmware 38 ok",
        ]),
        ("bioloid", "dynamixel", "p2-fast-sync-read", [
            "> all fast sync read 3, 7, 4: present_position @132:4 (as XL430) ok",
            "< all status 3: present_position 166 (-2.887 rad) (as XL430); 7: present_position 2079 (0.04755 rad) "
            "(as XL430); 4: present_position 1023 (-1.572 rad) (as XL430) ok",
        ]),
        ("bioloid", "dynamixel", "p2-status-access", ["< 1 status ok access"]),
        ("so101", "feetech", "sts-position", [
            "> 1 read present_position @56:2 (as STS) ok", "< 1 status present_position 2048 (0 rad) (as STS) ok",
        ]),
        ("nxt", "nxt", "battery", ["> GETBATTERYLEVEL", "< reply GETBATTERYLEVEL battery 7890 (7.89 V)"]),
        ("nxt", "nxt", "bluetooth-battery", ["> GETBATTERYLEVEL", "< reply GETBATTERYLEVEL battery 7890 (7.89 V)"]),
        ("nxt", "nxt", "motor-limit", [
            "> A SETOUTPUTSTATE power 75 %, mode 7, regulation 1, ratio 0, run state 32, limit 360 deg, "
            "no reply wanted",
        ]),
        ("nxt", "nxt", "sonar-missing", [
            "> port 4 LSGETSTATUS", "< reply LSGETSTATUS no sensor answers on the I2C bus",
        ]),
        ("p3dx", "p3dx", "cmd-seta-minus-300", ["> SETA -300 (acceleration (+) or deceleration (-), mm/s2) ok"]),
        ("p3dx", "p3dx", "cmd-sync0-pulse", ["> PULSE (reset the watchdog) ok"]),
    ],
)  # fmt: skip
def test_documented_bytes(platform: str, capture: str, exchange: str, expected: list[str]) -> None:
    made = decoder(platform)
    chunks = exchanges(capture)[exchange]
    found = [line(each) for chunk in chunks for each in made.feed(chunk)]
    assert found + [line(each) for each in made.flush()] == expected


def test_segway_frames_are_the_same_on_both_lines() -> None:
    can, usb = exchanges("segway")["velocity-plus-332-turn-plus-78"]
    assert [line(each) for each in decoder("segway").feed(can)] == ["> command velocity 332, turn 78 ok"]
    assert [line(each) for each in decoder("segway").feed(usb)] == ["> command velocity 332, turn 78 ok"]


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        ("0000 0105", "> NMT start node 5 ok"),
        ("0080", "> sync ok"),
        ("0605 4041600000000000", "> 5 SDO request read status_word 6041:0 ok"),
        ("0585 4B41600037020000", "> 5 SDO answer value status_word 0x0237 (operation enabled) ok"),
        ("0605 2B40600006000000", "> 5 SDO request write control_word 0x0006 ok"),
        ("0585 8040600002000006", "> 5 SDO answer abort control_word 6040:0 ok abort code 0x06000002"),
        ("0185 370203", "> 5 TPDO1 status_word 0x0237 (operation enabled), mode_display 3 (velocity) ok"),
        ("0205 0F0003", "> 5 RPDO1 control_word 0x000F, mode 3 (velocity) ok"),
        ("0285 E8030000F4010000", "> 5 TPDO2 position 1000, velocity 500 ok"),
        ("0305 F4010000", "> 5 RPDO2 target_velocity 500 ok"),
        ("0705 05", "> 5 heartbeat operational ok"),
        ("077F", "> 127 heartbeat ok empty"),
        ("07FF 01", "> 127 0x7FF 01 ok no identifier of CANopen"),
    ],
)
def test_canopen_frames(frame: str, expected: str) -> None:
    assert lines(decoder("cia402"), (">", frame)) == [expected]


def test_spykee_shows_tracks_and_no_password() -> None:
    shown = decoder("spykee").feed(Chunk(0.0, ">", b"PK\x05\x00\x02\x32\xce" + b"PK\x0a\x00\x0d\x05admin\x06secret"))
    assert [line(each) for each in shown] == ["> move left 50 %, right -50 %", "> login 13 bytes, not shown"]
    assert b"secret" not in b"".join(each.data for each in shown)


def test_qi_shows_heads_only() -> None:
    call, error = QiMessage(CALL, 7, 1, 1, 100, b"secret"), QiMessage(ERROR, 7, 1, 1, 100, b"no")
    made = decoder("nao")
    shown = made.feed(Chunk(0.0, ">", bytes(call))) + made.feed(Chunk(0.1, "<", bytes(error)))
    assert [line(each) for each in shown] == [
        "> service directory call id 7, object 1, action 100, 6 bytes",
        "< service directory error id 7, object 1, action 100, 2 bytes the call failed",
    ]
    assert b"secret" not in shown[0].data


# ---------------------------------------------------------------- servos: models, echoes, gaps


READ_POSITION = "FF FF 01 04 02 24 02 D2"
POSITION = "FF FF 01 04 00 00 02 F8"


def test_models_are_known_from_the_daemon_or_learned() -> None:
    known = decoder("bioloid", ({"id": 1, "model": 12, "protocol": 1},))
    assert lines(known, (">", READ_POSITION)) == [
        "> 1 read present_position @36:2 ok", "< 1 no answer no answer",
    ]  # fmt: skip
    learned = decoder("bioloid")
    answer = packet.encode_1(1, 0, bytes((29, 0, 24))).hex()
    request = packet.read_packet(1, 1, 0, 3).hex()
    shown = lines(learned, (">", request), ("<", answer), (">", packet.read_packet(1, 1, 36, 2).hex()))
    assert shown[1].startswith("< 1 status model_number 29") and "as AX-12" not in shown[2]


def test_who_does_not_answer_is_told_with_the_next_request() -> None:
    request = packet.sync_read_packet(132, 4, [1, 2]).hex()
    answer = bytes.fromhex("FF FF FD 00 01 08 00 55 00 A6 00 00 00 8C C0").hex()
    shown = lines(decoder("bioloid"), (">", request), ("<", answer), (">", request))
    assert [text for text in shown if "no answer" in text][0] == "< 2 no answer no answer"


def test_damaged_and_incomplete_answers_are_told_and_the_next_is_read() -> None:
    damaged = POSITION.replace("F8", "F7")
    shown = lines(
        decoder("bioloid"), (">", READ_POSITION), ("<", damaged), (">", READ_POSITION), ("<", POSITION[:14]),
        (">", READ_POSITION), ("<", "12 34 " + POSITION),
    )  # fmt: skip
    assert "< 1 ? bad the checksum is wrong" in shown
    assert "< ? FF FF 01 04 00 5 bytes are no packet" in shown
    assert "< ? 12 34 2 bytes are no packet" in shown
    assert shown[-1] == "< 1 status present_position 512 (0.002559 rad) (as AX-12) ok"


def test_the_echo_of_an_adapter_is_no_answer() -> None:
    shown = lines(decoder("bioloid"), (">", READ_POSITION), ("<", READ_POSITION + POSITION))
    assert shown[1:] == ["< 1 echo ok", "< 1 status present_position 512 (0.002559 rad) (as AX-12) ok"]


def test_who_only_listens_tells_requests_from_answers() -> None:
    pieces = READ_POSITION + READ_POSITION + POSITION + "FF FF 01 04 03 18 01 DE" + "FF FF 01 02 00 FC"
    kinds = [each.split()[2] for each in lines(decoder("bioloid"), ("<", pieces))]
    assert kinds == ["read", "no", "read", "status", "write", "status"]


def test_a_packet_may_come_in_pieces() -> None:
    whole = lines(decoder("bioloid"), (">", READ_POSITION), ("<", POSITION))
    data = bytes.fromhex(POSITION)
    pieces = [("<", bytes((byte,)).hex()) for byte in data]
    assert lines(decoder("bioloid"), (">", READ_POSITION), *pieces) == whole  # type: ignore[arg-type]


# ---------------------------------------------------------------- anything


OTHERS = [
    bytes(QiMessage(CALL, 7, 1, 1, 100, b"abc")), b"PK\x05\x00\x02\x32\xce",
    b"PK\x0b\x00\x09\x01\x01a\x01b\x01c\x01d\x00",
    bytes.fromhex("05854B41600037020000"), bytes.fromhex("0185370203"), bytes.fromhex("0085103101"),
]  # fmt: skip
"""Packets of protocols without a capture."""
CHUNKS = st.lists(
    st.tuples(
        st.sampled_from("<>"),
        st.one_of(
            st.binary(max_size=40),
            st.sampled_from(
                [chunk.data for name in ("dynamixel", "nxt", "p3dx", "segway") for each in exchanges(name).values()
                 for chunk in each] + OTHERS
            ).flatmap(lambda data: st.integers(0, len(data)).map(lambda at: data[:at] + data[at + 1 :])),
        ),
    ),
    max_size=8,
)  # fmt: skip


@pytest.mark.parametrize("platform", TRACED)
@settings(max_examples=60, deadline=None)
@given(chunks=CHUNKS)
def test_no_bytes_raise_anything(platform: str, chunks: list[tuple[Direction, bytes]]) -> None:
    made = decoder(platform)
    for index, (direction, data) in enumerate(chunks):
        for each in made.feed(Chunk(float(index), direction, data)):
            assert line(each)
    made.flush()


# ---------------------------------------------------------------- captures


def test_all_forms_of_a_capture() -> None:
    text = [
        "# a comment", "[name] what it is", "> FF 01", "0.001234  < 0A", "(1436509052.25) can0 413#0102 T",
        "(1436509053.5) can0 12345678#00", "  can0  413   [2]  01 02",
    ]  # fmt: skip
    assert list(read_capture(text)) == [
        "name", Chunk(0.0, ">", b"\xff\x01"), Chunk(0.001234, "<", b"\n"),
        Chunk(1436509052.25, ">", b"\x04\x13\x01\x02"), Chunk(1436509053.5, "<", b"\xff\xff\x00"),
        Chunk(1436509053.5, "<", b"\x04\x13\x01\x02"),
    ]  # fmt: skip
    (extended,) = decoder("cia402").feed(Chunk(0.0, "<", b"\xff\xff\x00"))
    assert extended.problem == "no frame of 11 bits"


def test_a_capture_is_read_as_it_was_written() -> None:
    chunk = Chunk(12.345678, ">", b"\xff\xff\x01")
    assert list(read_capture([capture_line(chunk)])) == [chunk]


def test_a_wrong_line_is_named() -> None:
    with pytest.raises(BadFrame, match=r"^line 2 is no line of a capture: 'hello'$"):
        list(read_capture(["> 01", "hello"]))


def test_a_long_line_is_refused() -> None:
    with pytest.raises(BadFrame, match=r"^line 2 is longer than 1048576 characters"):
        list(read_capture(["> 01", " " * (1 << 20) + "x"]))


def test_a_time_that_is_no_time_is_refused() -> None:
    with pytest.raises(BadFrame, match="^line 1 is no line"):
        list(read_capture([f"{'9' * 400} > 01"]))


def test_an_identifier_may_have_fewer_digits() -> None:
    assert list(read_capture(["(1.5) can0 13#01"])) == [Chunk(1.5, "<", b"\x00\x13\x01")]


def test_a_row_of_headers_costs_no_crc_each(monkeypatch: pytest.MonkeyPatch) -> None:
    summed: list[int] = []

    def crc16(data: bytes) -> int:
        summed.append(len(data))
        return 0

    monkeypatch.setattr("urbihw.buses.servos.trace.crc16", crc16)
    data = b"\xff\xff\xfd\x00" * 20_000
    made = decoder("chain")
    found = [*made.feed(Chunk(0.0, "<", data)), *made.flush()]
    assert sum(summed) <= 2 * len(data)
    assert sum(len(each.data) for each in found) == len(data)


def test_bytes_without_a_packet_are_told_before_the_end() -> None:
    made = decoder("chain")
    assert not made.feed(Chunk(0.0, "<", b"\x00" * 100))
    (late,) = made.feed(Chunk(1.5, "<", b"\x00" * 100))
    assert late.problem == "200 bytes are no packet" and late.time == 0.0
    (many,) = made.feed(Chunk(1.6, "<", b"\x00" * 5000))
    assert many.problem == "5000 bytes are no packet"
