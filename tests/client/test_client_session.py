"""Answers of servers, without sockets: those recorded of the original one (version 2.7.5), and strange ones."""

from __future__ import annotations

import pytest

from urbihw.client.credentials import ARGUMENTS
from urbihw.client.errors import BadAnswer, SlotMissing, UrbiError
from urbihw.client.literals import KEYWORDS, checked_name, literal, written_path
from urbihw.client.live_plot import plot_svg
from urbihw.client.login import WANTS_TLS, explain_close
from urbihw.client.media import Blob
from urbihw.client.session import Message, NoPlainValue, Session, message_of
from urbihw.client.streams import Sample, SampleStream
from urbihw.client.where import Where
from urbihw.kernel.syntax import tokens


def answered(data: bytes) -> object:
    """The result of a question when these bytes come on its channel."""
    session = Session(lambda line, at: None)
    question = session.open_question()
    session.feed(data.replace(b"CH", question.channel.encode()))
    assert question.done
    return question.result()


# The lines are those of the sheet of the server protocol, sections 1 and 4 (`[00008801] 8.80177`, the Binaries in a
# list, the string with a byte of UTF-8), in the list that this library asks for.
RECORDED = [
    (b'[00008801:CH] ["", 8.80177]\n', 8.80177),
    (b'[00000012:CH] ["", [nil]]\n', [None]),
    (b'[00000012:CH] ["", "\\xc3\\xa9"]\n', "\u00e9"),
    (b'[00000012:CH] ["", [BIN 3 h\na\nb, 1, BIN 3 h\na\nb]]\n', [Blob("h", b"a\nb"), 1.0, Blob("h", b"a\nb")]),
    (b'[815122800004:CH] ["", nil]\n', None),
    (b'[00000012:CH] ["", Lobby_0x1234]\n', NoPlainValue("object", "Lobby_0x1234")),
    (b'[00000012:CH] ["", function () { 1 }]\n', NoPlainValue("object", '["", function () { 1 }]')),
]


@pytest.mark.parametrize(("data", "value"), RECORDED)
def test_recorded_answers_of_the_original(data: bytes, value: object) -> None:
    assert answered(data) == value


def test_recorded_errors_of_the_original() -> None:
    with pytest.raises(SlotMissing, match="^lookup failed: foo$"):
        answered(b"[00000012:CH] !!! 1.1-3: lookup failed: foo\n")
    with pytest.raises(UrbiError, match="^x$"):
        answered(b"[00000012:CH] !!! x\n")


def test_samples_of_every_have_the_time_of_their_line() -> None:
    session = Session(lambda line, at: None)
    stream = SampleStream(("a", "b"), 10)
    session.add_stream(stream)
    session.offset = 100.0
    session.feed(f"[00001500:{stream.channel}] [1, nil]\n".encode())
    assert [*stream.items] == [(101.5, (1.0, None))]


@pytest.mark.parametrize("text", [
    b"{", b"{}", b'{"v": 1}', b"", b"nil", b"[1", b"[1, 2]", b"\xff", b'{"v": [1], "t": "x", "lost": 0}',
    b'{"v": 5, "t": 1, "lost": 0}', b'{"v": [1, 2], "t": 1, "lost": 0}', b'{"v": [1], "t": 1}', b'{"error": "a"}',
    b'{"v": [1], "t": 1, "lost": "x"}', b'{"v": [1], "t": 1%s, "lost": 0}' % (b"0" * 400), b'{"q": ' + b"[" * 100000,
])  # fmt: skip
def test_a_sample_that_cannot_be_read_is_an_error_in_its_place(text: bytes) -> None:
    session = Session(lambda line, at: None)
    stream = SampleStream(("a",), 10)
    session.add_stream(stream)
    for each in (text, b'{"n": 2, "v": [7], "t": 1, "lost": 0}'):
        session.feed(b"[00001500:%s] %s\n" % (stream.channel.encode(), each))
    with pytest.raises(BadAnswer, match="^the server sent on _client1_sample what cannot be read: [^\n]{0,70}$"):
        stream.next_item()
    assert stream.next_item().values == (7,)


@pytest.mark.parametrize("text", [b'["error"]', b'["error", 1, 2]', b'["object", "x", 5]', b'["function"]'])
def test_an_answer_that_cannot_be_read_is_an_error(text: bytes) -> None:
    with pytest.raises(BadAnswer, match="cannot be read"):
        answered(b"[00000001:CH] %s\n" % text)


def test_a_slow_program_is_at_most_a_second_behind() -> None:
    session = Session(lambda line, at: None)
    stream = SampleStream(("a",), 50)
    session.add_stream(stream)
    for number in range(500):
        line = f'{{"n": {number}, "lost": 0, "t": {number / 50}, "v": [{number}]}}'
        session.feed(f"[00001500:{stream.channel}] {line}\n".encode())
    assert (stream.next_item().values, stream.lost) == ((449,), 449)


def test_seldom_samples_wait_however_old_they_are() -> None:
    session = Session(lambda line, at: None)
    stream = SampleStream(("a",), 0)
    session.add_stream(stream)
    for number in range(12):
        line = f'{{"n": {number}, "lost": 0, "t": {number * 60}, "v": [{number}]}}'
        session.feed(f"[00001500:{stream.channel}] {line}\n".encode())
    assert (stream.next_item().values, stream.lost) == ((2,), 2)


def test_the_words_of_urbiscript_are_known() -> None:
    assert {*tokens.KEYWORDS, *tokens.SYNONYMS, *tokens.RESERVED, *tokens.IGNORED} == KEYWORDS
    assert written_path('this.x.new["if"].y') == """this.x.'new'["if"].y"""
    for word in (*KEYWORDS, "nil"):
        with pytest.raises(ValueError, match="is a word of urbiscript"):
            checked_name(word)


def test_half_of_a_character_is_no_text() -> None:
    with pytest.raises(ValueError, match="^character 2 is half of a surrogate pair"):
        literal("a\ud800")


def test_a_server_that_is_no_urbiscript_server_is_told_in_one_way() -> None:
    where = Where("robot", 80)
    assert str(explain_close(where, b"\r", False)) == "it is no urbiscript server; is this its port?"
    assert str(explain_close(where, b"", False, ARGUMENTS)).endswith("if it speaks TLS: tls=True")
    assert "wants a token: tls=True (" in str(explain_close(where, WANTS_TLS, False, ARGUMENTS))


def test_items_are_bounded_and_the_oldest_are_counted() -> None:
    session = Session(lambda line, at: None)
    stream = SampleStream(("a",), 10, size=2)
    session.add_stream(stream)
    for number in range(5):
        line = f'{{"n": {number}, "lost": 4, "t": 1, "v": [{number}]}}'
        session.feed(f"[00001500:{stream.channel}] {line}\n".encode())
    assert [item.values for item in stream.items] == [(3,), (4,)]
    assert stream.lost == 7


def test_a_late_answer_does_not_reach_the_next_question() -> None:
    session = Session(lambda line, at: None)
    first = session.open_question()
    session.close_question(first)
    second = session.open_question()
    session.feed(f'[00000001:{first.channel}] ["", 1]\n[00000001:{second.channel}] ["", 2]\n'.encode())
    assert second.result() == 2


def test_what_others_say_is_a_message() -> None:
    said: list[Message] = []
    session = Session(lambda line, at: said.append(message_of(line, at)))
    session.greeted = True
    session.feed(b"[00000001] *** hi\n[00000002:error] !!! no\n")
    assert [(message.text, message.is_error) for message in said] == [("*** hi", False), ("!!! no", True)]


@pytest.mark.parametrize("value", [object(), {1: 2}, {"a": {b"b": 1}}, 1j])
def test_values_that_urbiscript_has_not(value: object) -> None:
    with pytest.raises(TypeError):
        literal(value)


def test_a_list_that_contains_itself() -> None:
    value: list[object] = []
    value.append(value)
    with pytest.raises(ValueError, match="deeper"):
        literal(value)


def test_literals_are_one_line_of_ascii() -> None:
    text = literal({'a"\\\n': ["\u00e9\x00\r", b"\xff\"", -0.0, -1]})
    assert text == r'["a\"\\\n" => ["\xc3\xa9\x00\x0d", "\xff\"", (-0.0), (-1.0)]]' or text.isascii()
    assert "\n" not in text


def test_a_plot_has_a_curve_for_each_slot() -> None:
    picture = plot_svg(("a<", "b"), [Sample(1.0, (0.0, None)), Sample(2.0, (4.0, 2.0))], 10)
    assert picture.count("<polyline") == 2
    assert "a&lt;" in picture
    assert picture.count(",") == 3


@pytest.mark.parametrize("answer", [b'"a"', b"nil", b"[]", b"[nil]", b"0x" + b"f" * 400])
def test_an_answer_of_another_form_is_told(answer: bytes) -> None:
    session = Session(lambda line, at: None)
    question = session.open_question()
    session.feed(b"[00000001:" + question.channel.encode() + b"] " + answer + b"\n")
    assert question.done
    if not answer.startswith(b"0x") and answer != b"[nil]":
        with pytest.raises(BadAnswer, match="cannot be read"):
            question.result()


@pytest.mark.parametrize("told", ["a", None, [], True, float("nan"), float("inf")])
def test_a_time_that_is_none_is_told(told: object) -> None:
    with pytest.raises(BadAnswer, match="as its time$"):
        Session(lambda line, at: None).set_offset(told, 1.0, 2.0)
