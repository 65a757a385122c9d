"""The simulated Pioneer: its wire against the documented packets, its body against what a robot does."""

from __future__ import annotations

import math

import pytest

from urbihw_fakes import captures
from urbihw_fakes.device import Device
from urbihw_fakes.errors import UnknownRequest
from urbihw_fakes.p3dx import sips
from urbihw_fakes.p3dx.codec import ArcosReader, SickReader, arcos_packet, parse_command, sick_telegram
from urbihw_fakes.p3dx.kit import P3dx
from urbihw_fakes.p3dx.sips import Settings, SipFields
from urbihw_fakes.p3dx.world import World

EXCHANGES = captures.read("p3dx")


def sent(name: str) -> bytes:
    return EXCHANGES[name].sent[0]


def received(name: str) -> bytes:
    return EXCHANGES[name].received[0]


class Talk:
    """A host that says packets in spaced hex bodies and hears bodies; time moves by `wait`."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self.now = 0.0

    def say(self, body: str) -> list[str]:
        return self._heard([a.data for a in self.device.feed(arcos_packet(bytes.fromhex(body)), self.now)])

    def raw(self, data: bytes) -> list[bytes]:
        return [answer.data for answer in self.device.feed(data, self.now)]

    def wait(self, seconds: float, *, pulse: bool = True) -> list[str]:
        """What it says unasked meanwhile; `pulse` keeps the watchdog quiet."""
        heard: list[str] = []
        end = self.now + seconds
        while self.now < end - 1e-9:
            self.now = round(self.now + 0.01, 6)
            heard += self._heard([answer.data for answer in self.device.tick(self.now)])
            if pulse and round(self.now * 100) % 50 == 0:
                self.say("00")
        return heard

    def open(self) -> None:
        for body in ("00", "01", "02", "01"):
            self.say(body)

    def _heard(self, answers: list[bytes]) -> list[str]:
        return [body.hex(" ") for data in answers for body in ArcosReader().feed(data)]


def ready(kit: P3dx) -> Talk:
    talk = Talk(kit.robot)
    talk.open()
    talk.say("04 3B 01 00")
    return talk


# --- the documented packets -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name in EXCHANGES if name.startswith("cmd-")])
def test_commands_are_understood(name: str) -> None:
    (body,) = ArcosReader().feed(sent(name))
    heard = parse_command(body)
    assert heard is not None and heard.number == body[0]
    sign = -1 if "minus" in name and "vel2" not in name else 1
    if len(body) == 4:
        assert heard.value == sign * int.from_bytes(body[2:], "little")
    assert arcos_packet(body) == sent(name)


def test_synchronization() -> None:
    kit = P3dx(settings=Settings(name="MyRobot"))
    talk = Talk(kit.robot)
    for name in ("cmd-sync0-pulse", "cmd-sync1-open-no-argument"):
        assert talk.raw(sent(name)) == [sent(name)]
    assert talk.raw(sent("cmd-sync2-close-no-argument")) == [received("reply-sync2")]
    assert talk.raw(sent("cmd-open-int-1")) == []
    assert kit.robot.due() == pytest.approx(0.1)


def test_out_of_order_starts_again() -> None:
    talk = Talk(P3dx().robot)
    assert talk.say("00") == ["00"]
    assert talk.say("02") == ["ff"]
    assert talk.say("01") == ["ff"]
    assert [talk.say("00"), talk.say("00"), talk.say("01")] == [["00"], ["00"], ["01"]]


def test_sips_as_documented() -> None:
    zeros = {"battery_x10": 125, "charge_state": 0, "rotation": 0, "faults": 0}
    a = SipFields(battery=125, flags=0x1F, sonars=[(0, 5000), (8, 1234)], tail=zeros)
    assert arcos_packet(a.body()) == received("reply-sip-a")
    b = SipFields(
        moving=True, x=0x7FFE, y=100, theta=-1024, left=150, right=250, battery=121, stall=0x0509, flags=0x21,
        compass=90, tail={"battery_x10": 121, "charge_state": 0, "rotation": 160, "faults": 0},
    )  # fmt: skip
    assert arcos_packet(b.body()) == received("reply-sip-b")
    assert arcos_packet(SipFields(x=1000, theta=1024, battery=120, flags=1).body()) == received("reply-sip-c")


def test_other_packets_as_documented() -> None:
    assert arcos_packet(sips.encoders(123456, -2)) == received("reply-encoder")
    assert arcos_packet(sips.inputs([255] * 3, [0], [0] * 8 + [512])) == received("reply-io")
    talk = Talk(P3dx(settings=Settings()).robot)
    talk.open()
    assert talk.raw(sent("cmd-config-int-1")) == [received("reply-config")]


@pytest.mark.parametrize("name", [name for name in EXCHANGES if name.startswith("sick-")])
def test_telegrams_are_understood(name: str) -> None:
    data = (EXCHANGES[name].sent + EXCHANGES[name].received)[0]
    payload = data[4:-2]
    assert sick_telegram(payload, data[1]) == data
    if EXCHANGES[name].sent:
        assert SickReader().feed(b"\x00\x02" + data) == [(payload, True)]


def test_the_laser_answers_as_documented() -> None:
    kit = P3dx()
    talk = Talk(kit.laser)
    answer = b"\x06" + received("sick-reply-bb-ok-180-1-0-status-0x10")
    assert talk.raw(sent("sick-variant-180-deg-1-0-deg")) == [answer]
    for name in ("sick-installation-mode", "sick-start-continuous"):
        assert talk.raw(sent(name)) == [b"\x06" + received("sick-reply-a0-ok-status-0x10")]
    damaged = bytearray(sent("sick-stop"))
    damaged[-1] ^= 1
    assert talk.raw(bytes(damaged)) == [b"\x15"]


def test_a_scan_has_the_documented_shape_and_the_walls() -> None:
    kit = P3dx()
    talk = Talk(kit.laser)
    talk.raw(sent("sick-start-continuous"))
    (scan,) = [answer.data for answer in kit.laser.tick(1.0)]
    assert len(scan) == 372 and scan[:7] == received("sick-scan")[:7] and scan[-3] == 0x10
    ranges = [int.from_bytes(scan[7 + 2 * i : 9 + 2 * i], "little") for i in range(181)]
    assert ranges[0] == ranges[180] == 3000
    assert ranges[90] == 3000 - 21
    talk.raw(sent("sick-stop"))
    assert kit.laser.due() is None


def test_the_laser_changes_its_speed_and_hears_no_other() -> None:
    kit = P3dx()
    kit.laser.baud = 9600
    talk = Talk(kit.laser)
    assert talk.raw(sent("sick-baud-38400"))[0][5:] == received("sick-reply-a0-ok-status-0x10")[4:]
    assert talk.raw(sent("sick-stop")) == []
    kit.laser.baud = 38400
    assert talk.raw(sent("sick-stop")) != []


def test_the_laser_refuses_what_it_cannot() -> None:
    talk = Talk(P3dx().laser)
    bad_variant, bad_password, unknown = b"\x3b\xb4\x00\x19\x00", b"\x20\x00SICK_LMX", b"\x77"
    answers = [talk.raw(sick_telegram(payload, 0))[0][5:7] for payload in (bad_variant, bad_password, unknown)]
    assert answers == [b"\xbb\x00", b"\xa0\x01", b"\x92\x10"]


# --- the controller ---------------------------------------------------------------------------------------------------


def test_sips_come_ten_times_a_second_until_close() -> None:
    talk = ready(P3dx())
    assert len(talk.wait(1.0)) == 10
    talk.say("02")
    assert talk.wait(1.0) == []


def test_driving_moves_body_and_odometry() -> None:
    kit = P3dx(World(), slip=0.1)
    talk = ready(kit)
    talk.say("0B 3B C8 00")
    talk.wait(5.0)
    assert list(kit.body.wheels) == pytest.approx([0.2, 0.2])
    assert kit.body.odometry[0] == pytest.approx(0.93, abs=0.05)
    assert kit.body.pose[0] == pytest.approx(0.9 * kit.body.odometry[0])
    talk.say("1D")
    talk.wait(2.0)
    assert not kit.body.moving


@pytest.mark.parametrize("order, way, angle", [
    ("08 3B E8 03", 1.0, 0.0), ("08 1B F4 01", -0.5, 0.0), ("0D 1B 2D 00", 0.0, -45.0), ("0C 3B 5A 00", 0.0, 90.0),
])  # fmt: skip
def test_moves_and_turns_end_where_they_should(order: str, way: float, angle: float) -> None:
    kit = P3dx(World(), slip=0)
    talk = ready(kit)
    talk.say(order)
    talk.wait(8.0)
    x, _, heading = kit.body.odometry
    assert x == pytest.approx(way, abs=0.005)
    assert math.degrees(heading) == pytest.approx(angle, abs=0.5)
    assert not kit.body.moving


def test_wheels_one_by_one() -> None:
    kit = P3dx(World())
    talk = ready(kit)
    talk.say("20 3B 05 FB")
    talk.wait(2.0)
    assert list(kit.body.wheels) == pytest.approx([-0.1, 0.1])


def test_no_motor_no_motion() -> None:
    kit = P3dx()
    talk = Talk(kit.robot)
    talk.open()
    talk.say("0B 3B C8 00")
    talk.wait(1.0)
    assert not kit.body.moving


def test_the_watchdog_holds_it_and_any_packet_lets_it_go_on() -> None:
    kit = P3dx(World())
    talk = ready(kit)
    talk.say("0B 3B C8 00")
    talk.wait(1.9, pulse=False)
    assert kit.body.moving
    talk.wait(1.5, pulse=False)
    assert kit.body.halted and not kit.body.moving
    talk.say("00")
    talk.wait(1.0)
    assert kit.body.moving


def test_a_wall_stalls_it_and_presses_a_bumper() -> None:
    kit = P3dx()
    talk = ready(kit)
    talk.say("06 3B E8 03")
    talk.say("0B 3B E8 03")
    heard = talk.wait(12.0)
    assert kit.body.pose[0] == pytest.approx(2.75, abs=0.02)
    assert kit.body.front == {2} and not kit.body.rear
    stall = bytes.fromhex(heard[-1])[12:14]
    assert stall == bytes((0x01, 0x01 | 1 << 3))
    talk.say("0B 1B C8 00")
    talk.wait(2.0)
    assert kit.body.pose[0] < 2.6 and not kit.body.front and kit.body.stalled == (False, False)


def test_sonars_take_turns_and_see_the_walls() -> None:
    kit = P3dx()
    talk = ready(kit)
    heard = {}
    for body in talk.wait(0.5):
        data = bytes.fromhex(body)
        for place in range(data[19]):
            heard[data[20 + 3 * place]] = int.from_bytes(data[21 + 3 * place : 23 + 3 * place], "little")
    assert heard.keys() == set(range(16))
    assert heard[0] == pytest.approx(3000 - 136, abs=1)
    assert heard[12] == heard[11] == pytest.approx(1745, abs=2)
    talk.say("1C 3B 00 00")
    assert all(bytes.fromhex(body)[19] == 0 for body in talk.wait(0.5))


def test_the_stop_button_switches_the_motors_off() -> None:
    kit = P3dx()
    talk = ready(kit)
    kit.robot.press_stop_button(True)
    talk.say("04 3B 01 00")
    assert bytes.fromhex(talk.wait(0.2)[-1])[16] == 0b111110
    kit.robot.press_stop_button(False)
    talk.say("04 3B 01 00")
    assert bytes.fromhex(talk.wait(0.2)[-1])[16] == 0b11111


def test_packets_on_request() -> None:
    kit = P3dx()
    talk = ready(kit)
    talk.say("13 3B 01 00")
    talk.say("28 3B 02 00")
    kinds = [body[:2] for body in talk.wait(0.35)]
    assert kinds == ["32", "90", "f0", "32", "f0", "32", "f0"]
    talk.say("28 3B 00 00")
    talk.say("3A 3B 01 00")
    talk.say("11 3B 01 00")
    talk.say("3E 3B 01 00")
    assert [body[:2] for body in talk.wait(0.2)] == ["32", "98", "f8", "fa", "32", "98"]


def test_the_camera_on_aux1() -> None:
    kit = P3dx()
    talk = ready(kit)
    talk.say("2A 2B 09 81 01 04 47 00 01 00 00 FF")
    talk.say("2A 2B 0F 81 01 06 02 18 14 0F 0F 00 00 00 00 06 04 FF")
    camera = kit.robot.extras.camera
    assert (camera.zoom, camera.pan, camera.tilt) == (256, -256, 100)
    talk.say("2B 3B 06 00")
    assert "b0 90 41 ff 90 51 ff" in talk.wait(0.1)
    talk.say("2A 2B 03 81 09 FF")
    talk.say("2B 3B 00 00")
    assert camera.said == b""


def test_the_laser_of_the_simulator() -> None:
    talk = ready(P3dx())
    talk.say("E6 3B 01 00")
    packets = [bytes.fromhex(body) for body in talk.wait(0.1) if body.startswith("60")]
    assert [packet[11] for packet in packets] == [32] * 5 + [21]
    assert int.from_bytes(packets[0][12:14], "little") == 3000


def test_reset_and_power() -> None:
    kit = P3dx()
    talk = ready(kit)
    assert talk.say("FD") == ["ff"]
    assert talk.wait(0.5) == []
    talk.open()
    assert talk.wait(0.1) != []
    kit.robot.power_off(talk.now)
    assert talk.say("00") == [] and talk.wait(0.5) == []
    kit.robot.power_on(talk.now)
    assert talk.say("00") == ["00"]


def test_the_line_changes_its_speed() -> None:
    kit = P3dx()
    kit.robot.baud = 9600
    talk = ready(kit)
    talk.say("32 3B 02 00")
    assert talk.say("12") == []
    kit.robot.baud = 38400
    assert talk.say("12") != []


def test_units_of_an_older_robot() -> None:
    kit = P3dx(World(), slip=0, settings=Settings(subclass="p3dx"))
    talk = ready(kit)
    talk.say("08 3B E8 03")
    last = bytes.fromhex(talk.wait(8.0)[-1])
    assert int.from_bytes(last[1:3], "little") == pytest.approx(1000 / 0.485, abs=5)


# --- the world --------------------------------------------------------------------------------------------------------


def test_rays_and_crates() -> None:
    world = World.room()
    assert world.ray(0, 0, 0, 10) == pytest.approx(3.0)
    assert world.ray(0, 1.5, 0, 10) == pytest.approx(6.0)
    world.add_crate(1.0, 0.0)
    assert world.ray(0, 0, 0, 10) == pytest.approx(0.8)
    assert world.nearest(0, 0)[0] == pytest.approx(0.8)


def test_a_world_is_a_map_and_back(tmp_path: object) -> None:
    path = f"{tmp_path}/room.map"
    world = World.room()
    with open(path, "w") as file:
        file.write(world.as_map())
    again = World.read(path)
    assert again.home == world.home and sorted(again.walls) == sorted(world.walls)
    with pytest.raises(UnknownRequest, match="No such file"):
        World.read(f"{tmp_path}/none.map")
    with open(path, "w") as file:
        file.write("2D-Map\nLINES\n1 2 x 4\n")
    with pytest.raises(UnknownRequest, match="is no line"):
        World.read(path)
