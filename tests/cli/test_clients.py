"""The programs that connect to a server, which is a kernel in memory."""

from __future__ import annotations

import re
import socket
import sys
import wave
from collections.abc import Callable
from pathlib import Path

import pytest
from kernel_socket import HERE, NOBODY, serve
from PIL import Image

from urbihw.cli import image, launch, ping, send, sound, urbi
from urbihw.cli.lobby_client import LobbyClient
from urbihw.cli.options import CliRefused, GetoptParser
from urbihw.cli.pictures import PictureFile
from urbihw.cli.reach import resolve_server
from urbihw.cli.sounds import SoundFile, wave_file
from urbihw.client.lines import Binary
from urbihw.client.where import Where
from urbihw.extras import install_command

Capture = pytest.CaptureFixture[str]
Patch = pytest.MonkeyPatch

PROGRAMS = {"urbi-send": send.main, "urbi-image": image.main, "urbi-sound": sound.main, "urbi-ping": ping.main}

CAMERA = """
class Global.Camera { var val = Binary.new("rgb 2 1", "abcdef"); var format = 0; var quality = 0 };
var Global.camera = Camera.new;
var Global.answer = 42;
"""
MICRO = """
class Global.Micro { var val = Binary.new("", "") };
var Global.micro = Micro.new;
disown({ every (100ms) { micro.val = Binary.new("raw 1 1000 16 1", "ab" * 100) } });
"""


def unstamped(text: str) -> list[str]:
    return [line.partition("] ")[2] for line in text.splitlines()]


# ---------------------------------------------------------------- all of them


@pytest.mark.parametrize("program", PROGRAMS)
def test_bad_options_in_the_words_of_the_manual(program: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as caught:
        PROGRAMS[program](["--no-such-option"])
    assert caught.value.code == 64
    assert capsys.readouterr().err.splitlines() == [
        f"{program}: invalid option: --no-such-option",
        f"Try `{program} --help' for more information.",
    ]


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize("option", ["--version", "--help"])
def test_version_and_help(program: str, option: str, capsys: Capture) -> None:
    with pytest.raises(SystemExit) as caught:
        PROGRAMS[program]([option])
    assert caught.value.code == 0
    assert program in capsys.readouterr().out


@pytest.mark.parametrize("program", PROGRAMS)
def test_no_server_is_one_line(program: str, monkeypatch: Patch, capsys: Capture, tmp_path: Path) -> None:
    def refuse(address: tuple[str, int], timeout: float) -> None:
        assert address == ("robot", 1234)
        raise ConnectionRefusedError(111, "Connection refused")

    monkeypatch.setattr(socket, "create_connection", refuse)
    monkeypatch.setattr(sound, "find_player", lambda: ("true",))
    port_file = tmp_path / "port"
    port_file.write_text("1234\n")
    assert PROGRAMS[program](["-H", "robot", "--port-file", str(port_file)]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"{program}: cannot connect to robot:1234: Connection refused; ")


def test_a_name_that_no_host_can_have(capsys: Capture) -> None:
    assert send.main(["-H", "x" * 70, "-e", ";"]) == 1
    assert "this is no name of a host" in capsys.readouterr().err


def test_a_port_file_without_a_port(capsys: Capture, tmp_path: Path) -> None:
    assert send.main(["--port-file", str(tmp_path / "none")]) == 66
    (tmp_path / "port").write_text("-1\n")
    assert send.main(["--port-file", str(tmp_path / "port")]) == 78
    first, second = capsys.readouterr().err.splitlines()
    assert "cannot read the port file" in first
    assert "has no port in it" in second


def test_without_a_host_the_socket_of_the_daemon_with_that_port_is_used(tmp_path: Path, monkeypatch: Patch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    monkeypatch.delenv("RUNTIME_DIRECTORY", raising=False)
    tcp = Where("127.0.0.1", 1234)
    assert resolve_server(None, 1234, None) == tcp
    path = tmp_path / "urbihw" / "urbi-1234.socket"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as daemon:
        daemon.bind(str(path))
        assert resolve_server(None, 1234, None) == tcp, "nobody listens there"
        daemon.listen()
        assert resolve_server(None, 1234, None) == Where(str(path), 1234)
        assert resolve_server(None, 1235, None) == Where("127.0.0.1", 1235)
        assert resolve_server("127.0.0.1", 1234, None) == tcp
        assert resolve_server(None, 1234, True) == Where("127.0.0.1", 1234, True)
    assert resolve_server(None, 1234, None) == tcp, "left there by a daemon that was killed"


@pytest.mark.parametrize("program", [["urbi-send", "-e", "1;"], ["urbi-ping", "-c", "1"]], ids=lambda row: row[0])
def test_a_server_that_turns_us_away_is_quoted(program: list[str], monkeypatch: Patch, capsys: Capture) -> None:
    words = iter([b"*** urbihw: too many connections (256); close one\n", b""])
    monkeypatch.setattr(serve(monkeypatch), "recv", lambda size: next(words))
    assert PROGRAMS[program[0]](program[1:]) == 69
    assert capsys.readouterr().err == f"{program[0]}: 127.0.0.1:54000: too many connections (256); close one\n"


# ---------------------------------------------------------------- urbi-send


def test_send_the_example_of_the_manual(monkeypatch: Patch, capsys: Capture) -> None:
    serve(monkeypatch, quiet=False)
    assert send.main(["-P", "54000", "-e", "1+2*3;", "-Q"]) == 0
    said = capsys.readouterr()
    assert unstamped(said.out) == ["7"]
    assert said.err == "[00000000:client_error] End of file\n"


def test_send_keeps_the_order_of_its_sources(monkeypatch: Patch, capsys: Capture, tmp_path: Path) -> None:
    (tmp_path / "a.u").write_text("2")
    (tmp_path / "b.u").write_text("echo(4);")
    serve(monkeypatch)
    sources = ["-e", "-1;", "-f", str(tmp_path / "a.u"), "-e", "; 3;", str(tmp_path / "b.u"), "--quit"]
    assert send.main(sources) == 0
    assert unstamped(capsys.readouterr().out) == ["-1", "2", "3", "*** 4"]


def test_send_shows_errors_with_the_positions_of_what_was_sent(monkeypatch: Patch, capsys: Capture) -> None:
    serve(monkeypatch)
    assert send.main(["-e", "foo;", "-Q"]) == 0
    said = capsys.readouterr()
    assert said.out == ""
    assert unstamped(said.err)[0] == "!!! 1.1-3: lookup failed: foo"


def test_send_shows_the_banner_when_asked(monkeypatch: Patch, capsys: Capture) -> None:
    serve(monkeypatch, quiet=False)
    assert send.main(["-b", "-e", "1;", "-Q"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 11


def test_send_stays_until_ctrl_c(monkeypatch: Patch, capsys: Capture) -> None:
    serve(monkeypatch, interrupt=True)
    assert send.main(["-e", "sleep(2s) | echo(1),"]) == 130
    assert unstamped(capsys.readouterr().out) == ["*** 1"]


def test_send_ends_with_the_server(monkeypatch: Patch, capsys: Capture) -> None:
    serve(monkeypatch)
    assert send.main(["-e", "shutdown;"]) == 0
    assert capsys.readouterr().err == "[00000000:client_error] End of file\n"


def test_send_of_a_file_that_is_not_there(capsys: Capture) -> None:
    assert send.main(["-f", "/none.u"]) == 66
    assert capsys.readouterr().err == "urbi-send: failed to process file /none.u: No such file or directory\n"


# ---------------------------------------------------------------- urbi-ping


def test_ping(monkeypatch: Patch, capsys: Capture) -> None:
    serve(monkeypatch)
    assert ping.main(["-c", "2", "-i", "0.001"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("2 asked, 2 answered; min / mean / max: ")


def test_ping_of_a_server_that_does_not_answer(monkeypatch: Patch, capsys: Capture) -> None:
    silent = serve(monkeypatch)
    monkeypatch.setattr(silent, "sendall", lambda data: None)
    assert ping.main(["-c", "2"]) == 69
    assert "did not answer within 5 s" in capsys.readouterr().err


# ---------------------------------------------------------------- urbi-image


def test_image_is_saved_as_the_ending_says(monkeypatch: Patch, capsys: Capture, tmp_path: Path) -> None:
    serve(monkeypatch, CAMERA)
    assert image.main(["-o", str(tmp_path / "a.ppm")]) == 0
    assert (tmp_path / "a.ppm").read_bytes() == b"P6\n2 1\n255\nabcdef"
    assert image.main(["-o", str(tmp_path / "a.png")]) == 0
    with Image.open(tmp_path / "a.png") as saved:
        assert (saved.format, saved.tobytes()) == ("PNG", b"abcdef")
    assert "rgb, 2 x 1, 6 bytes" in capsys.readouterr().out


def test_image_sets_what_it_is_told_to_and_no_more(monkeypatch: Patch, capsys: Capture, tmp_path: Path) -> None:
    server = serve(monkeypatch, CAMERA)
    assert image.main(["-o", str(tmp_path / "a.ppm"), "-F", "jpeg"]) == 0
    lobby = server.kernel.open_lobby()
    assert unstamped(server.kernel.run_text(lobby, "[camera.format, camera.quality];", until=0)) == ["[3, 0]"]
    assert image.main(["-o", str(tmp_path / "a.ppm"), "-R", "1"]) == 69
    assert "camera has no slot resolution" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["-d", "answer"], "lookup failed: val"),
        (["-d", "none"], "lookup failed: none"),
        (["-o", "/none/a.ppm"], "cannot write /none/a.ppm"),
        (["-o", "/none/a.xyz"], "no kind of image has that ending"),
    ],
)
def test_image_says_what_is_wrong(monkeypatch: Patch, capsys: Capture, options: list[str], words: str) -> None:
    serve(monkeypatch, CAMERA)
    assert image.main(["-o", "/none/a.png", *options]) in (69, 78)
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_the_first_image_of_a_camera_that_sends_only_while_it_is_read(
    monkeypatch: Patch, capsys: Capture, tmp_path: Path
) -> None:
    late = 'var camera.first = camera.val | camera.val = Binary.new("jpeg 0 0", "") |'
    serve(monkeypatch, CAMERA + late + " disown({ sleep(1s) | camera.val = camera.first });")
    assert image.main(["-o", str(tmp_path / "a.ppm")]) == 0
    assert (tmp_path / "a.ppm").read_bytes() == b"P6\n2 1\n255\nabcdef"


def test_an_old_image_of_a_camera_that_is_off_is_not_saved(
    monkeypatch: Patch, capsys: Capture, tmp_path: Path
) -> None:
    off = "var camera.on = false| var camera.next = camera.val| camera.val = Binary.new(\"rgb 2 1\", \"ghijkl\")|"
    serve(monkeypatch, CAMERA + off + " disown({ sleep(1s) | camera.val = camera.next });")
    assert image.main(["-o", str(tmp_path / "a.ppm")]) == 0
    assert (tmp_path / "a.ppm").read_bytes() == b"P6\n2 1\n255\nabcdef"


def test_images_without_end(monkeypatch: Patch) -> None:
    server = serve(monkeypatch, CAMERA + "disown({ every (1s) { camera.quality += 1 } });")
    with LobbyClient(HERE, NOBODY) as link:
        stream = image.pictures(link, "camera", 500)
        assert [next(stream) for _ in range(3)] == [PictureFile("rgb", 2, 1, b"abcdef")] * 3
        assert server.kernel.clock.now() >= 1.0


@pytest.mark.parametrize(
    ("keywords", "data", "words"),
    [
        ("mp3", b"x", "no image that is known"),
        ("", b"x", "no image that is known"),
        ("jpeg 1 1", b"", "is the camera switched on"),
        ("rgb 2 2", b"x", "cannot have 1 bytes"),
        ("rgb", b"x", "0 x 0"),
    ],
)
def test_what_is_no_image(keywords: str, data: bytes, words: str) -> None:
    with pytest.raises(CliRefused, match=words):
        PictureFile.of(Binary(keywords, data))


def test_broken_images_are_not_trusted() -> None:
    with pytest.raises(CliRefused, match="the image is broken"):
        PictureFile.of(Binary("jpeg 1 1", b"\xff\xd8 nonsense")).decoded()
    with pytest.raises(CliRefused, match="too large|broken"):
        PictureFile.of(Binary("ppm 1 1", b"P6\n30000 30000\n255\n")).decoded()


def test_without_pillow_the_extra_is_named(monkeypatch: Patch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "PIL", None)
    picture = PictureFile.of(Binary("jpeg 1 1", b"data"))
    picture.save(tmp_path / "a.jpg")
    assert (tmp_path / "a.jpg").read_bytes() == b"data"
    with pytest.raises(CliRefused, match=re.escape(install_command("images"))):
        picture.save(tmp_path / "a.png")


def test_images_without_a_screen(monkeypatch: Patch, capsys: Capture) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    serve(monkeypatch, CAMERA)
    assert image.main([]) == 78
    assert re.fullmatch(r"urbi-image: there is no screen .*save one: --output FILE\n", capsys.readouterr().err)


# ---------------------------------------------------------------- urbi-sound


def test_sound_is_recorded_piece_by_piece(monkeypatch: Patch, capsys: Capture, tmp_path: Path) -> None:
    serve(monkeypatch, MICRO)
    assert sound.main(["-t", "0.3", "-o", str(tmp_path / "a.wav")]) == 0
    with wave.open(str(tmp_path / "a.wav")) as file:
        assert (file.getnchannels(), file.getframerate(), file.getsampwidth(), file.getnframes()) == (1, 1000, 2, 300)
        assert file.readframes(2) == b"abab"


def test_sound_of_a_device_that_is_silent(monkeypatch: Patch, capsys: Capture, tmp_path: Path) -> None:
    serve(monkeypatch, CAMERA)
    assert sound.main(["-d", "camera", "-o", str(tmp_path / "a.wav")]) == 69
    assert "sent nothing for 10 s; is the device switched on" in capsys.readouterr().err


def test_sound_without_a_player(monkeypatch: Patch, capsys: Capture) -> None:
    monkeypatch.setenv("PATH", "")
    assert sound.main([]) == 78
    assert "no program to play sound with" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("keywords", "data", "samples"),
    [
        ("raw 1 8000 8 2", b"\x00\x80\xff", b"\x00\x80\xff"),
        ("raw 1 8000 8 1", b"\x80\x00\x7f", b"\x00\x80\xff"),
        ("raw 1 8000 16 1", b"\x01\x02", b"\x01\x02"),
        ("raw 1 8000 16 2", b"\x01\x82", b"\x01\x02"),
    ],
)
def test_samples_as_a_wave_file_has_them(keywords: str, data: bytes, samples: bytes) -> None:
    assert SoundFile.of(Binary(keywords, data)).samples == samples


def test_a_wave_file_within_a_binary() -> None:
    inner = wave_file([SoundFile.of(Binary("raw 2 16000 16 1", b"abcd"))])
    taken = SoundFile.of(Binary("wav 2 16000 16 1", inner))
    assert (taken.format.channels, taken.format.rate, taken.samples) == (2, 16000, b"abcd")
    with pytest.raises(CliRefused, match="broken"):
        SoundFile.of(Binary("wav", b"RIFFnonsense"))


@pytest.mark.parametrize(
    "keywords", ["", "rgb 1 1", "raw", "raw 1 8000 16", "raw 9 8000 16 1", "raw 1 1 16 1", "raw a b c d"]
)
def test_what_is_no_sound(keywords: str) -> None:
    with pytest.raises(CliRefused, match="sound"):
        SoundFile.of(Binary(keywords, b"xx"))


def test_sounds_of_two_kinds_and_none() -> None:
    one, two = (SoundFile.of(Binary(f"raw 1 {rate} 16 1", b"ab")) for rate in (8000, 16000))
    with pytest.raises(CliRefused, match="changed the kind"):
        wave_file([one, two])
    with pytest.raises(CliRefused, match="gave no sound"):
        wave_file([])


# ---------------------------------------------------------------- their page

PAGE = Path(__file__).resolve().parents[2] / "docs" / "programs.md"


@pytest.mark.parametrize("parser", [urbi.parser, launch.parser, send.parser, image.parser, sound.parser, ping.parser])
def test_every_option_is_in_its_page(parser: Callable[[], GetoptParser]) -> None:
    words = set(re.findall(r"-{1,2}[A-Za-z][\w-]*", PAGE.read_text()))
    assert {name for action in parser()._actions for name in action.option_strings} - words == set()
