"""``urbihw install-service``: what it writes below a root of its own, and what it leaves alone."""

from __future__ import annotations

import stat
import sys
from pathlib import Path

import pytest

from urbihw.cli.install_service import _is_hidden
from urbihw.cli.main import main
from urbihw.daemon.config import configure

UNITS = "etc/systemd/system"


def install(root: Path, *words: str) -> int:
    return main(["install-service", "--root", str(root), "--program", "/opt/urbihw/bin/urbihw", *words])


def files(root: Path) -> set[str]:
    return {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}


SHARED = {
    f"{UNITS}/urbihw@.service", f"{UNITS}/urbihw@.socket", "etc/udev/rules.d/99-urbihw.rules",
    "etc/sysusers.d/urbihw.conf", "etc/tmpfiles.d/urbihw.conf",
}  # fmt: skip


def of_robot(name: str) -> set[str]:
    return {f"{UNITS}/urbihw@{name}.service.d/50-platform.conf", f"{UNITS}/urbihw@{name}.socket.d/50-port.conf"}


def test_two_robots_share_the_unit_and_have_ports_of_their_own(tmp_path: Path) -> None:
    assert install(tmp_path, "bio", "--platform", "bioloid") == 0
    assert install(tmp_path, "brick", "--platform", "nxt", "--fake") == 0
    settings = {"etc/urbihw/bio.toml", "etc/urbihw/brick.toml"}
    assert files(tmp_path) == SHARED | of_robot("bio") | of_robot("brick") | settings
    bio, brick = (configure(tmp_path / "etc" / "urbihw" / name) for name in ("bio.toml", "brick.toml"))
    assert (bio.platform, bio.url, bio.fake, bio.port) == ("bioloid", "/dev/urbihw-bioloid", False, 54000)
    assert (brick.platform, brick.url, brick.fake, brick.port) == ("nxt", "", True, 54001)
    assert stat.S_IMODE((tmp_path / "etc" / "urbihw" / "bio.toml").stat().st_mode) == 0o640


def test_the_unit_runs_the_program_named(tmp_path: Path) -> None:
    install(tmp_path, "bio", "--platform", "bioloid")
    unit = (tmp_path / UNITS / "urbihw@.service").read_text()
    assert "ExecStart=/opt/urbihw/bin/urbihw serve --config /etc/urbihw/%i.toml\n" in unit
    assert "ExecStopPost=-/opt/urbihw/bin/urbihw stop --direct --config /etc/urbihw/%i.toml\n" in unit
    assert "/usr/bin/urbihw" not in unit


def test_the_drop_ins_have_the_needs_of_the_platform_and_the_address(tmp_path: Path) -> None:
    install(tmp_path, "brick", "--platform", "nxt", "--port", "6000")
    rows = (tmp_path / UNITS / "urbihw@brick.service.d" / "50-platform.conf").read_text().splitlines()
    assert rows[2:] == [
        "[Service]", "DeviceAllow=char-usb_device rw", "DeviceAllow=char-rfcomm rw",
        "RestrictAddressFamilies=AF_NETLINK", "SupplementaryGroups=dialout",
    ]  # fmt: skip
    port = (tmp_path / UNITS / "urbihw@brick.socket.d" / "50-port.conf").read_text()
    assert port.endswith("[Socket]\nListenStream=127.0.0.1:6000\n")


def test_settings_are_never_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    install(tmp_path, "bio", "--platform", "bioloid", "--fake")
    settings = tmp_path / "etc" / "urbihw" / "bio.toml"
    settings.write_text('platform = "segway"\nhost = "::1"\nport = 6001\n')
    capsys.readouterr()
    assert install(tmp_path, "bio", "--platform", "bioloid") == 78
    assert capsys.readouterr().err.count("\n") == 1
    assert install(tmp_path, "bio", "--port", "6002") == 78
    assert install(tmp_path, "bio") == 0  # the other files, for what the settings now say
    assert settings.read_text() == 'platform = "segway"\nhost = "::1"\nport = 6001\n'
    assert "AF_CAN" in (tmp_path / UNITS / "urbihw@bio.service.d" / "50-platform.conf").read_text()
    assert "ListenStream=[::1]:6001\n" in (tmp_path / UNITS / "urbihw@bio.socket.d" / "50-port.conf").read_text()


def test_a_port_of_another_robot_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    own = tmp_path / "robot.toml"
    own.write_text('platform = "p3dx"\nurl = "/dev/ttyS0"\nport = 6000\n')
    root = tmp_path / "root"
    install(root, "bio", "--platform", "bioloid", "--port", "6000")
    capsys.readouterr()
    before = files(root)
    for words in (("--platform", "chain", "--url", "/dev/ttyS0", "--port", "6000"), ("--config", str(own))):
        assert install(root, "pp", *words) == 78
        assert "port 6000 is that of" in capsys.readouterr().err
    assert files(root) == before
    assert install(root, "bio") == 0
    assert install(root, "pp", "--platform", "bioloid", "--port", "6001") == 0


def test_a_settings_file_of_the_user_is_installed_as_it_is(tmp_path: Path) -> None:
    own, root = tmp_path / "robot.toml", tmp_path / "root"
    own.write_text('# mine\nplatform = "p3dx"\nurl = "/dev/ttyS0"\nport = 6000\n')
    assert install(root, "base", "--config", str(own), "--port", "6001") == 78
    assert install(root, "base", "--config", str(own)) == 0
    assert (root / "etc" / "urbihw" / "base.toml").read_text() == own.read_text()
    assert "127.0.0.1:6000" in (root / UNITS / "urbihw@base.socket.d" / "50-port.conf").read_text()
    assert install(root, "base", "--config", str(own)) == 78


def test_where_a_package_has_brought_the_unit_only_the_robot_is_added(tmp_path: Path) -> None:
    packaged = tmp_path / "lib" / "systemd" / "system" / "urbihw@.service"
    packaged.parent.mkdir(parents=True)
    packaged.touch()
    assert install(tmp_path, "base", "--platform", "p3dx", "--url", "/dev/ttyS0") == 0
    assert files(tmp_path) - {"lib/systemd/system/urbihw@.service"} == of_robot("base") | {"etc/urbihw/base.toml"}


def test_a_dry_run_prints_and_writes_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert install(tmp_path, "bio", "--platform", "bioloid", "--dry-run") == 0
    shown = capsys.readouterr().out
    assert "# /etc/urbihw/bio.toml\n" in shown and "# /etc/systemd/system/urbihw@.service\n" in shown
    assert files(tmp_path) == set()


def test_the_last_robot_takes_the_unit_with_it_and_the_settings_stay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("one", "two"):
        install(tmp_path, name, "--platform", "bioloid", "--fake")
    own = tmp_path / UNITS / "urbihw@one.service.d" / "90-mine.conf"
    own.write_text("[Service]\nNice=0\n")
    settings = {"etc/urbihw/one.toml", "etc/urbihw/two.toml"}
    assert install(tmp_path, "two", "--uninstall") == 0
    assert "the settings stay: " in capsys.readouterr().out
    assert files(tmp_path) == SHARED | of_robot("one") | settings | {str(own.relative_to(tmp_path))}
    assert install(tmp_path, "one", "--uninstall") == 0
    assert files(tmp_path) == settings | {str(own.relative_to(tmp_path))}
    assert install(tmp_path, "one", "--uninstall") == 78


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("../x", "--platform", "bioloid"), "cannot be a name"),
        (("bio",), "which robot? Give --platform"),
        (("bio", "--config", "/none.toml"), "/none.toml: cannot be read"),
        (("bio", "--platform", "roomba"), "no platform 'roomba'"),
        (("bio", "--platform", "bioloid", "--url", "/dev/ttyUSB0?boud=9600"), "did you mean baud?"),
        (("bio", "--platform", "bioloid", "--url", '/dev/x"\nfoo=%i'), "contains unprintable characters"),
        (("bio", "--platform", "bioloid", "--url", "/dev/\x1b[2J"), "contains unprintable characters"),
        (("bio", "--platform", "bioloid", "--program", "/opt/x\nUser=root"), "write a full path of letters"),
        (("bio", "--platform", "bioloid", "--program", "/opt/%h/urbihw"), "write a full path of letters"),
        (("bio", "--platform", "bioloid", "--program", "urbihw"), "write a full path of letters"),
    ],
)
def test_a_mistake_is_one_line_and_nothing_is_written(
    words: tuple[str, ...], told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert install(tmp_path, *words) == 78
    line = capsys.readouterr().err
    assert told in line and line.startswith("urbihw install-service: ") and line.count("\n") == 1
    assert files(tmp_path) == set()


def test_a_url_is_in_the_settings_as_it_was_given(tmp_path: Path) -> None:
    url = '/dev/serial/by-id/a"b\\c é'
    assert install(tmp_path, "bio", "--platform", "bioloid", "--url", url) == 0
    assert configure(tmp_path / "etc/urbihw/bio.toml").url == url


def test_a_program_that_the_user_of_the_service_cannot_reach_is_noticed(tmp_path: Path) -> None:
    assert _is_hidden(Path("/home/alice/.local/bin/urbihw"))
    assert not _is_hidden(Path("/usr/bin/env"))
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o700)
    (closed / "urbihw").touch(0o755)
    assert _is_hidden(closed / "urbihw")


def test_without_a_program_beside_python_it_has_to_be_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    assert main(["install-service", "bio", "--platform", "bioloid", "--root", str(tmp_path)]) == 78
    assert "--program PATH" in capsys.readouterr().err


def test_a_settings_file_without_a_port_gets_the_first_free_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    install(tmp_path, "bio", "--platform", "bioloid")
    file = tmp_path / "humanoid.toml"
    file.write_text('# ours\nplatform = "bioloid"\nfake = true\n[limits.motor1]\nspeed = 1\n')
    assert install(tmp_path, "hum", "--config", str(file)) == 0
    made = configure(tmp_path / "etc" / "urbihw" / "hum.toml")
    assert (made.port, made.platform, made.limits) == (54001, "bioloid", {"motor1": {"speed": 1}})
    assert "54001" in (tmp_path / UNITS / "urbihw@hum.socket.d" / "50-port.conf").read_text()
    assert install(tmp_path, "hub", "--config", str(file), "--port", "6001") == 0
    assert configure(tmp_path / "etc" / "urbihw" / "hub.toml").port == 6001
    file.write_text('platform = "bioloid"\nfake = true\nport = 54000\n')
    capsys.readouterr()
    assert install(tmp_path, "huc", "--config", str(file), "--port", "6002") == 78
    assert f"the port is that of {file}: change it there" in capsys.readouterr().err
    assert install(tmp_path, "huc", "--config", str(file)) == 78
    assert "port 54000 is that of" in capsys.readouterr().err
    assert install(tmp_path, "hum") == 0
