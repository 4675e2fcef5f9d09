# SPDX-License-Identifier: Apache-2.0
"""Files with which a client proves its identity and checks the daemon's."""
from __future__ import annotations

import dataclasses
import os
import ssl
import stat

from .errors import ArgumentError

_KEY_BYTES = 32


@dataclasses.dataclass(frozen=True)
class Security:
    """Names of files. Without any, connections are plain."""

    tls_ca: str = ""  # PEM: signs the daemon's certificate
    tls_certificate: str = ""  # PEM, this client's
    tls_key: str = ""  # PEM, not readable by others
    tls_name: str = ""  # name or address in the daemon's certificate; empty: the URL's host
    key_file: str = ""  # host datagrams: the first key of this file authenticates them

    @property
    def tls(self) -> bool:
        return bool(self.tls_certificate)

    def context(self) -> ssl.SSLContext:
        """Returns the TLS context of a client. Raises ArgumentError, which names the file at fault."""
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        _refuse_readable(self.tls_key)
        for name, load in ((self.tls_ca, lambda: context.load_verify_locations(self.tls_ca)),
                           (self.tls_certificate,
                            lambda: context.load_cert_chain(self.tls_certificate, self.tls_key))):
            try:
                load()
            except (OSError, ssl.SSLError) as error:
                raise ArgumentError(f"{name}: {error}") from error
        return context


def read_first_key(file: str) -> bytes:
    """Returns the first key of a key file: 64 hexadecimal digits a line. The text of an error names no key."""
    _refuse_readable(file)
    try:
        with open(file, encoding="ascii") as lines:
            for number, line in enumerate(lines, 1):
                line = line.strip()
                if not line or line.startswith("#"):
                    continue
                try:
                    key = bytes.fromhex(line) if len(line) == 2 * _KEY_BYTES else b""
                except ValueError:
                    key = b""
                if len(key) != _KEY_BYTES:
                    raise ArgumentError(f"{file}: line {number}: a key has 64 hexadecimal digits")
                return key
    except (OSError, UnicodeDecodeError) as error:
        raise ArgumentError(f"{file}: {error}") from None
    raise ArgumentError(f"{file}: no key in it")


def _refuse_readable(file: str) -> None:
    try:
        mode = os.stat(file).st_mode
    except OSError as error:
        raise ArgumentError(f"{file}: {error.strerror}") from error
    if mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise ArgumentError(f"{file}: others may read or write it; chmod 600 {file}")
