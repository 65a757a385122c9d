"""A recorded robot: whose answer is whose when answers were late, damaged or missing."""

from __future__ import annotations

from urbihw_fakes.device import Answer
from urbihw_fakes.replay import Replay, read_capture


def first(unit: int, *body: int) -> bytes:
    """A packet of protocol 1.0."""
    inner = bytes([unit, len(body) + 1, *body])
    return b"\xff\xff" + inner + bytes([~sum(inner) & 0xFF])


def second(unit: int, *body: int) -> bytes:
    """A packet of protocol 2.0, whose checksum nobody looks at here."""
    return b"\xff\xff\xfd\x00" + bytes([unit, len(body) + 2, 0, *body, 0xC5, 0xCC])


def ping(unit: int) -> bytes:
    """A ping."""
    return first(unit, 0x01)


def pong(unit: int) -> bytes:
    """Its answer."""
    return first(unit, 0x00)


def recorded(*lines: tuple[float, str, bytes]) -> Replay:
    """The robot of a capture: times, directions, bytes."""
    head = '# urbihw trace: {"platform": "bioloid", "devices": [], "guessed": false}'
    return Replay(read_capture([head, *(f"{time:.6f}  {way} {data.hex(' ').upper()}" for time, way, data in lines)]))


def told(answers: list[Answer], since: float = 0.0) -> list[tuple[float, bytes]]:
    """Delays in s, to a microsecond, and bytes."""
    return [(round(answer.at - since, 6), answer.data) for answer in answers]


def test_a_late_answer_is_that_of_its_own_unit() -> None:
    robot = recorded(
        (0.000, ">", ping(5)), (0.010, ">", ping(6)), (0.011, "<", pong(5) + pong(6)),
        (0.020, ">", ping(7)), (0.021, "<", pong(7)[:4]), (0.030, ">", ping(8)), (0.031, "<", pong(7)[4:]),
        (0.032, "<", pong(8)),
    )  # fmt: skip
    assert told(robot.receive(ping(6), 0.0)) == [(0.001, pong(6))]
    assert told(robot.receive(ping(5), 3.0), 3.0) == [(0.011, pong(5))]
    assert told(robot.receive(ping(8), 3.0), 3.0) == [(0.002, pong(8))]
    assert told(robot.receive(ping(7), 3.0), 3.0) == [(0.001, pong(7)[:4]), (0.011, pong(7)[4:])]


def test_a_group_that_answers_late_does_not_answer_a_write_to_all() -> None:
    read, write = second(0xFE, 0x82, 132, 0, 4, 0, 5, 6), second(0xFE, 0x83, 116, 0, 4, 0, 5, 1, 2, 3, 4)
    values = second(5, 0x55, 0, 1, 2, 3, 4) + second(6, 0x55, 0, 5, 6, 7, 8)
    robot = recorded((0.0, ">", read), (0.010, ">", write), (0.012, "<", values))
    assert robot.receive(write, 0.0) == []
    assert told(robot.receive(read, 0.0)) == [(0.012, values)]


def test_who_was_silent_at_the_end_answers_as_before() -> None:
    robot = recorded((0.0, ">", ping(5)), (0.001, "<", pong(5)), (0.010, ">", ping(5)), (0.020, ">", ping(9)))
    assert [bool(robot.receive(ping(5), 0.0)) for _ in range(4)] == [True, False, True, True]
    assert not robot.receive(ping(9), 0.0) and not robot.receive(ping(9), 0.0)


def test_damaged_bytes_and_the_beginning_of_a_packet_stay_where_they_came() -> None:
    noise, begun = b"\x12\x34", pong(5)[:5]
    robot = recorded(
        (0.000, ">", ping(5)), (0.001, "<", noise + begun), (1.0, ">", ping(6)), (1.001, "<", pong(6)),
    )  # fmt: skip
    assert b"".join(answer.data for answer in robot.receive(ping(5), 0.0)) == noise + begun
    assert told(robot.receive(ping(6), 0.0)) == [(0.001, pong(6))]
