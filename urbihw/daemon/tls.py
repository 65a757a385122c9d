"""The certificate of the daemon: one of the user's, or a self-signed one, made on first use.

Clients identify it by its fingerprint (``urbihw.client.credentials``), so it has no host name and is valid for a
century: a robot has no name that an authority could certify, and often no correct clock at its start.  The system's
``openssl`` makes it; Python can use certificates, but not make one.
"""

from __future__ import annotations

import hashlib
import re
import ssl
import subprocess
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

from urbihw.daemon.files import read_regular, unreadable
from urbihw.daemon.state import MAX_SECRET_BYTES, lock_folder, read_secret, write_secret
from urbihw.kernel.uobject import BadConfig

FILE: Final = "certificate.pem"
"""Name of the file in the state folder: the key, followed by the certificate."""
CREDENTIAL: Final = "urbihw.certificate.pem"
"""Name of the same file as a credential of the service manager."""
DAYS: Final = 36_500
OPENSSL_TIMEOUT_S: Final = 60.0
"""Maximum seconds to make a key, on a slow board."""

_CERTIFICATE: Final = re.compile(r"-----BEGIN CERTIFICATE-----.*?-----END CERTIFICATE-----", re.DOTALL)


class Files(NamedTuple):
    """The files of the certificate and of its key; the same file may contain both."""

    certificate: Path
    key: Path


def files(certificate: str, key: str, folder: Path) -> Files:
    """The files of the settings ``tls_cert`` and ``tls_key``, else those that ``make`` creates in the state folder."""
    if certificate:
        return Files(Path(certificate), Path(key or certificate))
    return Files(folder / FILE, folder / FILE)


def make(folder: Path) -> None:
    """Make a key and a certificate in a folder, unless they exist.  Raises BadConfig."""
    with lock_folder(folder):
        if read_secret(folder / FILE):
            return
        with tempfile.TemporaryDirectory(dir=folder) as inside:
            key, certificate = Path(inside, "key"), Path(inside, "certificate")
            _openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-sha256",
                     "-days", str(DAYS), "-subj", "/CN=urbihw", "-keyout", str(key), "-out", str(certificate))
            write_secret(folder / FILE, key.read_text("ascii") + certificate.read_text("ascii"))


def _openssl(*arguments: str) -> None:
    try:
        done = subprocess.run(("openssl", *arguments), stdin=subprocess.DEVNULL, capture_output=True, text=True,
                              errors="replace", timeout=OPENSSL_TIMEOUT_S, check=False)
    except OSError as error:
        raise BadConfig("no program openssl to make a certificate with: apt install openssl, or set tls_cert and "
                        "tls_key") from error
    except subprocess.TimeoutExpired:
        raise BadConfig(f"openssl made no certificate in {OPENSSL_TIMEOUT_S:g} s; set tls_cert and tls_key") from None
    if done.returncode:
        words = " ".join(done.stderr.split())[-200:]
        raise BadConfig(f"openssl made no certificate ({words}); set tls_cert and tls_key")


def context(where: Files) -> ssl.SSLContext:
    """The server's context: TLS 1.2 or later, with that certificate.  Raises BadConfig."""
    made = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    made.minimum_version = ssl.TLSVersion.TLSv1_2
    made.options |= ssl.OP_NO_RENEGOTIATION
    for file in dict.fromkeys(where):
        _readable(file)
    try:
        # OpenSSL would ask for a passphrase of the key at a terminal, which a service does not have.
        made.load_cert_chain(where.certificate, where.key, password=lambda: "")
    except (ssl.SSLError, ValueError) as error:
        raise BadConfig(f"tls_cert {where.certificate} and tls_key {where.key} are no certificate and its key in PEM, "
                        f"without a passphrase ({getattr(error, 'reason', None) or error})") from error
    return made


def fingerprint(where: Files) -> str:
    """The SHA-256 fingerprint of the certificate, as clients show it.  Raises BadConfig."""
    found = _CERTIFICATE.search(_readable(where.certificate))
    if found is None:
        raise BadConfig(f"{where.certificate}: there is no certificate in PEM in it")
    try:
        return hashlib.sha256(ssl.PEM_cert_to_DER_cert(found[0])).digest().hex(":").upper()
    except ValueError as error:
        raise BadConfig(f"{where.certificate}: is damaged: {error}") from error


def _readable(file: Path) -> str:
    try:
        return read_regular(file, MAX_SECRET_BYTES).data.decode("ascii", "replace")
    except FileNotFoundError as error:
        raise unreadable(file, error) from error
