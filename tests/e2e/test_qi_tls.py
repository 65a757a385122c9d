"""``qis://``: TLS to a simulated Nao, by both back ends; who does not speak it, and certificates."""

from __future__ import annotations

import contextlib
import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from urbihw import buses
from urbihw.buses.errors import BadUrl, LinkGone, Unavailable
from urbihw.buses.messages import Configure, Refused
from urbihw_nao.driver import NaoDriver
from urbihw_nao.qimessaging.login import Login
from urbihw_nao.qimessaging.opening import open_session
from urbihw_nao.qimessaging.session import QiSession
from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint
from urbihw_nao_fakes.services import Service, method
from urbihw_nao_fakes.tls import Identity

pytestmark = pytest.mark.e2e
LIBQI = importlib.util.find_spec("qi") is not None
PICTURE = bytes(range(256)) * 3600
"""As large as one of 640 x 480 in three bytes."""


class Camera(Service):
    """Answers that need many records of TLS."""

    name = "Camera"

    @method("picture", "()", "r")
    def picture(self) -> bytes:
        """A large one."""
        return PICTURE

    @method("store", "(r)", "i")
    def store(self, data: bytes) -> int:
        """How large it is."""
        return len(data)


@pytest.fixture(scope="module")
def identity() -> Identity:
    """Made once: it takes some 100 ms."""
    return Identity()


@pytest.fixture
def robot(identity: Identity) -> Iterator[NaoEndpoint]:
    """An encrypted Nao that wants a password."""
    device = Nao("nao", "secret")
    device.server.add_service(Camera())
    with NaoEndpoint(device, identity=identity) as end:
        end.start()
        yield end


@contextlib.contextmanager
def logged_in(url: str) -> Iterator[QiSession]:
    """A session of the user."""
    with buses.open(url) as port:
        session = open_session(port)
        session.authenticate(Login("nao", "secret"))
        yield session
        session.close("the test ends")


def charge(session: QiSession) -> object:
    """Something to ask for."""
    return session.wait(session.call(session.look_up("ALBattery"), "getBatteryCharge"))


def test_without_a_pin_it_is_encrypted_and_says_how_to_pin(robot: NaoEndpoint, identity: Identity) -> None:
    with buses.open(robot.url) as port:
        assert port.warning == (
            "encrypted, but the certificate of the robot is not verified: pin it by ?fingerprint="
            f"{identity.fingerprint} behind the url"
        )
    with logged_in(robot.url) as session:
        assert charge(session) == 80


def test_the_pinned_certificate_is_accepted_and_no_other(robot: NaoEndpoint, identity: Identity) -> None:
    for pin in (identity.fingerprint, identity.fingerprint.replace(":", "").lower()):
        with logged_in(f"{robot.url}?fingerprint={pin}") as session:
            assert charge(session) == 80
    with buses.open(f"{robot.url}?fingerprint={identity.fingerprint}") as port:
        assert port.warning == ""
    with pytest.raises(Unavailable, match=f"another than the pinned one: its fingerprint is {identity.fingerprint}"):
        buses.open(f"{robot.url}?fingerprint={'0' * 64}")
    with pytest.raises(BadUrl, match="64 hexadecimal digits"):
        buses.open(f"{robot.url}?fingerprint=12:34")


def test_a_file_of_certificates(robot: NaoEndpoint, identity: Identity, tmp_path: Path) -> None:
    own, other = tmp_path / "own.pem", tmp_path / "other.pem"
    own.write_text(identity.pem)
    other.write_text(Identity().pem)
    with logged_in(f"{robot.url}?ca={own}") as session:
        assert charge(session) == 80
    with pytest.raises(Unavailable, match="its certificate is not signed by one of"):
        buses.open(f"{robot.url}?ca={other}")
    with pytest.raises(Unavailable, match=f"ca: {tmp_path}/none.pem"):
        buses.open(f"{robot.url}?ca={tmp_path}/none.pem")


def test_a_wrong_password(robot: NaoEndpoint) -> None:
    text = r"refuses user or password: options\.user, options\.password"
    with buses.open(robot.url) as port, pytest.raises(Unavailable, match=text):
        open_session(port).authenticate(Login("nao", "wrong"))


def test_large_values_both_ways(robot: NaoEndpoint) -> None:
    with logged_in(robot.url) as session:
        camera = session.look_up("Camera")
        assert session.wait(session.call(camera, "picture")) == PICTURE
        assert session.wait(session.call(camera, "store", PICTURE)) == len(PICTURE)


def test_who_speaks_tls_and_who_does_not_is_told(robot: NaoEndpoint) -> None:
    text = "speaks TLS: write qis:// instead of qi://|hangs up at the login"
    with buses.open(robot.url.replace("qis:", "qi:")) as port, pytest.raises(Unavailable, match=text):
        open_session(port).authenticate()
    with NaoEndpoint(Nao()) as plain:
        plain.start()
        with pytest.raises(Unavailable, match=r"TLS handshake|no TLS with it"):
            buses.open(plain.url.replace("qi:", "qis:"))


def test_a_robot_that_is_gone(robot: NaoEndpoint) -> None:
    with logged_in(robot.url) as session:
        robot.unplug()
        with pytest.raises(LinkGone):
            charge(session)


def test_the_driver_tells_that_nobody_vouches_for_the_robot(robot: NaoEndpoint) -> None:
    for url, warnings in ((robot.url, 1), (f"{robot.url}?fingerprint={robot.identity.fingerprint}", 0)):  # type: ignore[union-attr]
        with buses.open(url) as port:
            driver = NaoDriver()
            driver.configure(Configure(options={"user": "nao", "password": "secret"}))
            told = [row for row in driver.attach(port) if isinstance(row, Refused)]
            driver.detach()
        assert len(told) == warnings


def test_the_command_line_of_the_fake() -> None:
    command = [sys.executable, "-m", "urbihw_fakes", "nao", "--tcp", "0", "--until-eof"]
    with subprocess.Popen([*command, "--tls"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None and process.stdout is not None
        with logged_in(process.stdout.readline().strip()) as session:
            assert charge(session) == 80
        process.stdin.close()
        assert process.wait(20.0) == 0
    both = subprocess.run([*command, "--tls", "--libqi"], stdin=subprocess.DEVNULL, capture_output=True, check=False)
    assert b"not allowed with" in both.stderr
    refused = subprocess.run(
        [*command, "--libqi", "--user", "nao"], stdin=subprocess.DEVNULL, capture_output=True, check=False
    )
    assert (refused.returncode, refused.stdout) == (78, b"")


@pytest.mark.skipif(not LIBQI, reason="libqi is not there")
def test_libqi_logs_in_by_tls_too(robot: NaoEndpoint) -> None:
    with logged_in(robot.url.replace("qis:", "libqis:")) as session:
        assert charge(session) == 80
        assert session.wait(session.call(session.look_up("Camera"), "picture")) == PICTURE
    with buses.open(robot.url.replace("qis:", "libqis:")) as port:
        assert "does not verify the certificate" in port.warning
        with pytest.raises(Unavailable, match="refuses user or password"):
            open_session(port).authenticate(Login("nao", "wrong"))
