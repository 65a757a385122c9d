"""The encrypted form of NAOqi's port: a key and a certificate signed by itself, made at the start."""

from __future__ import annotations

import hashlib
import ssl
import subprocess
import tempfile
from pathlib import Path

from urbihw_fakes.errors import FakeError

OPENSSL_TIMEOUT_S = 30.0
SUBJECT = "/CN=nao"


class Identity:
    """A key and its certificate.  Raises FakeError when ``openssl`` cannot make them.

    Attributes:
        context: of a server with this identity.
        pem: the certificate, for who wants to check it.
        fingerprint: its SHA-256, in hexadecimal digits with colons.
    """

    def __init__(self) -> None:
        with tempfile.TemporaryDirectory(prefix="fake-nao-") as folder:
            key, certificate = Path(folder, "key"), Path(folder, "certificate")
            command = (
                "openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                "-sha256", "-days", "2", "-subj", SUBJECT, "-keyout", str(key), "-out", str(certificate),
            )  # fmt: skip
            try:
                subprocess.run(command, capture_output=True, timeout=OPENSSL_TIMEOUT_S, check=True)
            except (OSError, subprocess.SubprocessError) as error:
                raise FakeError(f"--tls needs the program openssl to make a certificate: {error}") from error
            self.context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            self.context.load_cert_chain(certificate, key)
            self.pem = certificate.read_text("ascii")
        self.fingerprint = hashlib.sha256(ssl.PEM_cert_to_DER_cert(self.pem)).digest().hex(":").upper()
