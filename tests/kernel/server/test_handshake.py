"""The first bytes of a connection: other protocols are refused, however they are cut, and urbiscript is let through."""

from __future__ import annotations

import pytest

from urbihw.kernel.server.handshake import MAX_HELD_BACK, HandshakeRefusal, PlainHandshake

EVIL = b'*/;System.system("touch /tmp/evil");'

OTHERS = {
    "get": b"GET /;shutdown; HTTP/1.1\r\nHost: 127.0.0.1:54000\r\n\r\n",
    "get of http 0.9": b"GET /;shutdown;\r\n",
    "two slashes": b"GET //;shutdown; HTTP/1.1\r\n\r\n",
    "absolute": b"GET http://evil.example/;shutdown; HTTP/1.1\r\n\r\n",
    "rebound name": b"GET / HTTP/1.1\r\nHost: evil.example:54000\r\n\r\n" + EVIL,
    "post of text": b"POST / HTTP/1.1\r\nContent-Type: text/plain\r\nContent-Length: 40\r\n\r\n" + EVIL,
    "form": b"POST / HTTP/1.1\r\nContent-Type: multipart/form-data; boundary=x\r\n\r\n--x\r\n" + EVIL,
    "preflight": b"OPTIONS / HTTP/1.1\r\nAccess-Control-Request-Method: X\r\n\r\n",
    "tunnel": b"CONNECT 127.0.0.1:54000 HTTP/1.1\r\n\r\n" + EVIL,
    "websocket": b"GET /chat HTTP/1.1\r\nUpgrade: websocket\r\nSec-WebSocket-Key: x\r\n\r\n" + EVIL,
    "http 2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "webdav": b"PROPFIND / HTTP/1.1\r\n\r\n" + EVIL,
    "a method of one's own": b"Frobnicate /;shutdown; HTTP/1.1\r\n\r\n",
    "asterisk": b"FROB * HTTP/1.1\r\n\r\n",
    "after line ends": b"\r\n\r\nPOST / HTTP/1.1\r\n\r\n" + EVIL,
    "rtsp": b"OPTIONS rtsp://x RTSP/1.0\r\n\r\n",
    "rtsp of its own method": b"DESCRIBE rtsp://x/y RTSP/1.0\r\n\r\n" + EVIL,
    "lower-case http": b"get / http/1.1\r\nhost: x\r\n\r\n" + EVIL,
    "sip": b"INVITE sip://bob@example SIP/2.0\r\n",
    "smtp": b"EHLO example.org\r\nMAIL FROM:<a@b>\r\n" + EVIL,
    "lower-case smtp": b"helo example.org\r\n" + EVIL,
    "ftp": b"USER anonymous\r\nPASS x@\r\n" + EVIL,
    "irc": b"NICK bob\r\nUSER bob 0 * :Bob\r\n" + EVIL,
    "irc 3": b"CAP LS 302\r\n" + EVIL,
    "redis": b"*1\r\n$4\r\nPING\r\n" + EVIL,
    "redis typed": b"PING\r\n" + EVIL,
    "redis 3": b"HELLO 3 AUTH x y\r\n" + EVIL,
    "irc ping": b"PING irc.example\r\n" + EVIL,
    "imap": b"a1 LOGIN bob secret\r\n" + EVIL,
    "imap of curl": b"A001 CAPABILITY\r\n" + EVIL,
    "imap of a number": b"1 NOOP\n" + EVIL,
    "memcached set": b"set key 0 900 5\r\nhello\r\n" + EVIL,
    "memcached gets": b"gets key\r\n" + EVIL,
    "memcached get of two": b"get a:1 b:2\r\n" + EVIL,
    "xml": b"<?xml version='1.0'?><policy/>" + EVIL,
    "xmpp": b"<stream:stream to='x'>" + EVIL,
    "tls": b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    "ssh": b"SSH-2.0-OpenSSH_9.2\r\n",
    "socks 4": b"\x04\x01\xd2\xf0\x7f\x00\x00\x01\x00",
    "socks 5": b"\x05\x01\x00",
    "stun": b"\x00\x01\x00\x08\x21\x12\xa4\x42",
    "stun of ice": b"\x00\x1c\x00\x01\x00\x08\x21\x12\xa4\x42",
    "turn": b"\x00\x03\x00\x08\x21\x12\xa4\x42",
    "proxy 1": b"PROXY TCP4 1.2.3.4 5.6.7.8 1 2\r\n" + EVIL,
    "proxy 2": b"\r\n\r\n\x00\r\nQUIT\n\x21\x11",
    "mqtt": b"\x10\x0c\x00\x04MQTT",
    "postgres": b"\x00\x00\x00\x08\x04\xd2\x16\x2f",
    "a terminal's key": b"\x1b[A\n",
}


@pytest.mark.parametrize("kind", OTHERS)
@pytest.mark.parametrize("size", [1, 3, 1000], ids=["byte by byte", "by threes", "at once"])
def test_another_protocol_is_refused_before_anything_is_handed_on(kind: str, size: int) -> None:
    handshake, data = PlainHandshake(), OTHERS[kind]
    with pytest.raises(HandshakeRefusal) as caught:
        for start in range(0, len(data), size):
            assert handshake.check_bytes(data[start : start + size]) is None
    answer = caught.value.answer.decode("ascii")
    assert "urbihw" in answer and answer.endswith("\n")
    if "HTTP" in caught.value.reason:
        head, _, body = answer.partition("\r\n\r\n")
        assert head.startswith("HTTP/1.1 400 Bad Request\r\n")
        assert f"Content-Length: {len(body)}" in head and "Connection: close" in head
        assert "Access-Control" not in head and body.count("\n") == 1


ORDINARY = [
    b"1;",
    b"1+1;",
    b"echo(1);",
    b'echo("GET / HTTP/1.1");',
    b"motor6.val = 90deg time:2s;",
    b"GETTER = 3;",
    b"GETTER;",
    b"get;",
    b"X / 2;",
    b"X /2 ;",
    b"X * 2;",
    b"var x = 3;",
    b"var x;",
    b"POST.size;",
    b"GET;",
    b"SSH-x;",
    b"a|b&c;",
    b"x - HTTP/1;",
    b"3 * pi/4;",
    b"x * pi/2;",
    b"width * height/2 + 3;",
    b"x * http2;",
    b"user = 3;",
    b"mail(2);",
    b"cap in list;",
    b"pass and true;",
    b"nick.name;",
    b"PING;",
    b"PING = 3;",
    b"ping\n;",
    b"a1 = 3;",
    b"a1 + b;",
    b"a1;",
    b"stats;",
    b"stats\r\n;",
    b"get x { 3 };",
    b"get x() { 3 };",
    b"get x\r\n{ 3 };",
    b"set x(v) { v };",
    b"add(3);",
    b"< 3;",
    b"*1;",
    b"  \r\n  1;",
    b"// GET / HTTP/1.1\n1;",
    b"/* POST / HTTP/1.1 */ 1;",
    b"*/;",
    b"\xff\xfb\x01\xff\xfd\x03\r\n;",
    b"\xef\xbb\xbf1;",
    b"{ 1 };",
    b"//#push 1 \"GET\"\n",
    b"x" * 500_000 + b";",
    b" " * 500_000 + b"1;",
]


@pytest.mark.parametrize("data", ORDINARY, ids=lambda data: data[:20].decode("latin-1"))
def test_an_ordinary_statement_is_let_through_as_soon_as_it_is_complete(data: bytes) -> None:
    assert PlainHandshake().check_bytes(data) == data
    handshake, heard = PlainHandshake(), b""
    for at in range(min(len(data), 20_000)):
        accepted = handshake.check_bytes(data[at : at + 1])
        if accepted is not None:
            heard = accepted + data[at + 1 :]
            break
    assert heard == data


@pytest.mark.parametrize("data", [b"X /2;", b"POSTER http://x", b"x *"], ids=lambda data: data.decode())
def test_what_may_still_become_a_request_is_let_through_by_a_line_end(data: bytes) -> None:
    handshake = PlainHandshake()
    assert handshake.check_bytes(data) is None
    assert handshake.check_bytes(b"\n") == data + b"\n"


def test_a_first_line_without_end_is_refused() -> None:
    handshake = PlainHandshake()
    assert handshake.check_bytes(b"FROB /") is None
    with pytest.raises(HandshakeRefusal, match="endless first line"):
        handshake.check_bytes(b"x" * MAX_HELD_BACK)
