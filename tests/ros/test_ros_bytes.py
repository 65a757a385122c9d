"""Bytes of TCPROS and of messages, against the documented vectors (wiki.ros.org) and what ros_comm has sent."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from urbihw.ros.errors import MessageError, PeerError, RosError
from urbihw.ros.framing import decode_header, encode_header, frame, length_of
from urbihw.ros.messages import MessageTypes
from urbihw.ros.names import checked_name

STRING_MD5 = "992ce8a1687cec8c8bd883ec73ca41d1"
HEADER = b"\x32\0\0\0" b"\x0a\0\0\0callerid=a" b"\x0e\0\0\0topic=/chatter" b"\x0e\0\0\0type=a/String_"
SUMS = {
    "std_msgs/String": STRING_MD5,
    "std_msgs/Header": "2176decaecbce78abc3b96ef049fabed",
    "std_msgs/Float64": "fdb28210bfa9d7c91146260178d9a584",
    "std_msgs/Empty": "d41d8cd98f00b204e9800998ecf8427e",
    "geometry_msgs/Twist": "9f195f881246fdfa2798d1d3eebca84a",
    "sensor_msgs/Image": "060021388200f6f0f447d0fcd9c64743",
    "sensor_msgs/CompressedImage": "8f7a12909da2c9d3332d540a0977563f",
    "sensor_msgs/JointState": "3066dcd76a6cfaef579bd0f34173e9fd",
    "sensor_msgs/Range": "c005c34273dc426c67a020a87bc24148",
    "sensor_msgs/Imu": "6a62c6daae103f4ff57a132d6f95cec2",
    "tf2_msgs/TFMessage": "94810edda583a504dfda3829e70d7eec",
}


@pytest.fixture(scope="module")
def types() -> MessageTypes:
    return MessageTypes()


def test_header_bytes() -> None:
    fields = {"callerid": "a", "topic": "/chatter", "type": "a/String_"}
    assert encode_header(fields) == HEADER
    assert decode_header(HEADER[4:]) == fields


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"\x01", "inside a length"),
        (b"\xff\xff\xff\xffa=b", "announces 4294967295 bytes"),
        (b"\x03\0\0\0abc", "without '='"),
        (b"\x03\0\0\0a=\xff", "UTF-8"),
        (b"".join(b"\x03\0\0\0%c=b" % n for n in range(62, 127)), "too many fields"),
    ],
)
def test_wrong_header(data: bytes, why: str) -> None:
    with pytest.raises(PeerError, match=why):
        decode_header(data)


def test_length_is_checked_before_memory_is_taken() -> None:
    with pytest.raises(PeerError, match="more than the 67108864"):
        length_of(struct.pack("<I", (64 << 20) + 1), 64 << 20)


@pytest.mark.parametrize(("name", "md5"), SUMS.items(), ids=SUMS)
def test_sum_and_round_trip(types: MessageTypes, name: str, md5: str) -> None:
    kind = types.find(name)
    assert kind.md5 == md5
    assert kind.decode(kind.encode(kind.template())) == kind.template()


def test_bytes_of_messages(types: MessageTypes) -> None:
    assert frame(types.find("std_msgs/String").encode({"data": "hi"})) == bytes.fromhex("06000000 02000000 6869")
    twist = types.find("geometry_msgs/Twist").template()
    twist["linear"]["x"], twist["angular"]["z"] = 2, -1.8
    assert types.find("geometry_msgs/Twist").encode(twist) == struct.pack("<6d", 2, 0, 0, 0, 0, -1.8)
    stamp = {"data": {"secs": 1, "nsecs": 2}}
    assert types.find("std_msgs/Time").encode(stamp) == bytes.fromhex("01000000 02000000")
    joints = {"header": {"seq": 7, "stamp": {"secs": 1, "nsecs": 2}, "frame_id": "b"}, "name": ["a", "c"],
              "position": [1.5], "velocity": [], "effort": []}
    data = types.find("sensor_msgs/JointState").encode(joints)
    assert data == (
        struct.pack("<IIII", 7, 1, 2, 1) + b"b" + struct.pack("<II", 2, 1) + b"a" + struct.pack("<I", 1) + b"c"
        + struct.pack("<Id", 1, 1.5) + bytes(8)
    )
    assert types.find("sensor_msgs/JointState").decode(data) == joints


def test_bytes_are_bytes(types: MessageTypes) -> None:
    kind = types.find("sensor_msgs/CompressedImage")
    made = {**kind.template(), "format": "jpeg", "data": b"\xff\xd8\x00"}
    assert kind.encode(made).endswith(b"\x03\0\0\0\xff\xd8\0")
    assert kind.decode(kind.encode(made))["data"] == b"\xff\xd8\x00"
    assert kind.encode({**made, "data": [255, 0xD8, 0]}) == kind.encode(made)


WRONG: list[tuple[str, Any, str]] = [
    ("std_msgs/String", {}, "missing field: data"),
    ("std_msgs/String", {"data": "a", "dat": 1}, "no such field: dat; there are: data"),
    ("std_msgs/String", {"data": 3.0}, "data must be a string, not 3.0"),
    ("std_msgs/String", {"data": "\udcff"}, "data is not UTF-8 text"),
    ("std_msgs/String", 3, "a message must be a dictionary, not 3"),
    ("std_msgs/UInt8", {"data": 256}, r"data must be in \[0, 255\] \(uint8\), not 256"),
    ("std_msgs/UInt8", {"data": 1.5}, r"data must be a whole number \(uint8\), not 1.5"),
    ("std_msgs/Int64", {"data": float("inf")}, "data must be a whole number"),
    ("std_msgs/Bool", {"data": "yes"}, "data must be true or false, not 'yes'"),
    ("std_msgs/Float32", {"data": True}, "data must be a number, not True"),
    ("std_msgs/Float32", {"data": 1e300}, r"data must be in \[-3.40282e\+38, 3.40282e\+38\], not 1e\+300"),
    ("std_msgs/Float64", {"data": 10**400}, "data is too large: 1000"),
    ("std_msgs/Float32MultiArray", {"layout": {"dim": [], "data_offset": 0}, "data": [-1e39]}, r"data\[0\] must be in"),
    ("std_msgs/Time", {"data": {"secs": -1, "nsecs": 0}}, r"data.secs must be in \[0, 4294967295\]"),
    ("geometry_msgs/Twist", {"linear": {"x": 1, "y": 2}, "angular": {}}, "missing field: linear.z"),
    ("geometry_msgs/Polygon", {"points": [{"x": 1, "y": 2, "z": "up"}]}, r"points\[0\].z must be a number"),
    ("geometry_msgs/Polygon", {"points": 3}, "points must be a list, not 3"),
    ("std_msgs/Float64MultiArray", {"layout": {"dim": [], "data_offset": 0}, "data": [1, "a"]}, r"data\[1\] must"),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "message", "why"), WRONG, ids=[f"{kind}-{i}" for i, (kind, *_) in enumerate(WRONG)])
def test_wrong_field_is_named(types: MessageTypes, kind: str, message: Any, why: str) -> None:
    with pytest.raises(MessageError, match=why):
        types.find(kind).encode(message)


def test_array_of_fixed_size(types: MessageTypes) -> None:
    kind = types.find("sensor_msgs/Imu")
    with pytest.raises(MessageError, match="orientation_covariance must have 9 elements, not 2"):
        kind.encode({**kind.template(), "orientation_covariance": [1, 2]})


@pytest.mark.parametrize("data", ["", "ffffffff", "ffffff7f61", "02000000ffff", "010000006161"])
def test_wrong_bytes_are_no_message(types: MessageTypes, data: str) -> None:
    with pytest.raises(MessageError, match="bytes that are no std_msgs/String"):
        types.find("std_msgs/String").decode(bytes.fromhex(data))


def test_infinite_float_is_one(types: MessageTypes) -> None:
    assert types.find("std_msgs/Float32").encode({"data": float("inf")}) == struct.pack("<f", float("inf"))


def test_huge_count_takes_no_memory(types: MessageTypes) -> None:
    with pytest.raises(MessageError):
        types.find("geometry_msgs/Polygon").decode(b"\xff\xff\xff\xff" + bytes(24))


def test_types_of_services(types: MessageTypes) -> None:
    assert types.service("roscpp/GetLoggers").md5 == "32e97e85527d4678a8f9279894bb64b0"
    assert types.service("std_srvs/SetBool").md5 == "09fb03525b03e7ea1fd3992bafd87e16"
    assert types.service("std_srvs/Empty").md5 == "d41d8cd98f00b204e9800998ecf8427e"
    with pytest.raises(RosError, match="another version"):
        types.service("std_srvs/Empty", STRING_MD5)


def test_type_is_learnt_from_its_definition(types: MessageTypes) -> None:
    bar = "=" * 80
    definition = f"string who\nmine/Arm[2] arms\n{bar}\nMSG: mine/Arm\nfloat32[] angles\nHeader header\n{bar}\n"
    definition += "MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
    kind = types.find_or_learn("mine/Body", "*", definition)
    assert kind.template()["arms"][1] == {
        "angles": [], "header": {"seq": 0, "stamp": {"secs": 0, "nsecs": 0}, "frame_id": ""},
    }  # fmt: skip
    with pytest.raises(RosError, match="another version"):
        types.find_or_learn("mine/Body", STRING_MD5, "")


@pytest.mark.parametrize(
    ("definition", "why"),
    [
        ("hostile/A[] a\n", "contains itself"),
        ("hostile/B b\n" + "=" * 80 + "\nMSG: hostile/B\nhostile/A a\n", "contains itself"),
        ("hostile/C c\n", "lacks hostile/C"),
        ("string a\n" + "=" * 80 + "\nMSG: ../../etc\nstring b\n", "is no type"),
        ("$$ = what", "cannot be read"),
        ("uint8[150000000] a\n", "more than 20000 values"),
        ("string[100000000] a\n", "more than 20000 values"),
        ("std_msgs/Empty[100000000] a\n", "more than 20000 values"),
        ("hostile/B[200] b\n" + "=" * 80 + "\nMSG: hostile/B\nfloat32[200] a\n", "more than 20000 values"),
        ("std_msgs/Empty[] a\n", "list of messages without bytes"),
        ("\n".join(["hostile/D0 d", *("=" * 80 + f"\nMSG: hostile/D{i}\nhostile/D{i + 1} a\nhostile/D{i + 1} b"
                                     for i in range(31))]) + "\n" + "=" * 80 + "\nMSG: hostile/D31\nbool a\n",
         "nests more than 32 deep|more than 20000 values"),
    ],
)
def test_hostile_definition_is_refused(types: MessageTypes, definition: str, why: str) -> None:
    with pytest.raises(RosError, match=why):
        types.find_or_learn("hostile/A", "*", definition)


def test_names() -> None:
    assert checked_name("chatter") == checked_name("/chatter") == "/chatter"
    for wrong in ("", "a b", "/a-b", "~x", "/é", "a" * 300):
        with pytest.raises(RosError, match="invalid name"):
            checked_name(wrong)
