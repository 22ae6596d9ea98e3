"""Which transport does a connection URL name? Written as MAVSDK writes them.

``udpin://127.0.0.1:14540``, ``udpout://192.168.1.7:14550``, ``tcpin://0.0.0.0:5760``, ``tcpout://127.0.0.1:5760``,
``serial:///dev/ttyUSB0:57600``. Without a host ``udpin`` and ``tcpin`` listen to this machine only: to listen wider is
a decision, and written down as 0.0.0.0.
"""

from dataclasses import dataclass

from companion.core.clock import Clock
from companion.core.params import nearest
from companion.core.tcp import tcp_in, tcp_out
from companion.core.transport import Transport
from companion.core.udp import LOOPBACK, is_loopback, udp_in, udp_out

SCHEMES = ("udpin", "udpout", "tcpin", "tcpout", "serial")
DEFAULT_BAUD = 57600  # PX4's TELEM1 (SER_TEL1_BAUD)
PORT_MAX = 65535


class UrlError(ValueError):
    """A connection URL is wrong; the text quotes it and shows what was expected."""


@dataclass(frozen=True, slots=True)
class Url:
    """A connection URL taken apart."""

    scheme: str
    host: str  # or the device of a serial port
    port: int  # or its baud rate

    def __str__(self) -> str:
        """As the user would write it."""
        return f"{self.scheme}://{self.host}:{self.port}"


def listens_wide(url: Url) -> bool:
    """Can other machines speak to us here without being asked?"""
    return url.scheme in ("udpin", "tcpin") and not is_loopback(url.host)


def parse_url(text: str) -> Url:
    """Take a URL apart. Raises UrlError with one line that quotes it."""
    scheme, separator, rest = text.strip().partition("://")
    if not separator:
        raise UrlError(f"'{text}' is no connection URL; expected for example udpin://127.0.0.1:14540")
    if scheme in ("udp", "tcp"):
        raise UrlError(f"'{text}' does not say who calls: write {scheme}in://HOST:PORT or {scheme}out://HOST:PORT")
    if scheme not in SCHEMES:
        raise UrlError(f"'{text}': unknown scheme '{scheme}'{nearest(scheme, list(SCHEMES))}")
    if scheme == "serial":
        return _serial(text, rest)
    host, _, port = rest.partition(":")
    if not host and scheme.endswith("out"):
        raise UrlError(f"'{text}': {scheme} needs a host, for example {scheme}://127.0.0.1:14540")
    return Url(scheme, host or LOOPBACK, _number(text, port, "port", PORT_MAX))


def open_url(url: Url | str, clock: Clock | None = None) -> Transport:
    """Open the transport that a URL names. Raises UrlError, or TransportError naming port or device."""
    url = parse_url(url) if isinstance(url, str) else url
    if url.scheme == "udpin":
        return udp_in(url.host, url.port, clock)
    if url.scheme == "udpout":
        return udp_out(url.host, url.port, clock=clock)
    if url.scheme == "tcpin":
        return tcp_in(url.host, url.port)
    if url.scheme == "tcpout":
        return tcp_out(url.host, url.port, clock)
    from companion.core.serial_port import SerialPort  # here: termios is not on every system

    return SerialPort(url.host, url.port, clock)


def _serial(text: str, rest: str) -> Url:
    device, separator, baud = rest.rpartition(":")
    if not separator:
        device, baud = rest, str(DEFAULT_BAUD)
    if not device.startswith("/"):
        raise UrlError(f"'{text}': expected serial:///dev/DEVICE:BAUD, for example serial:///dev/ttyUSB0:57600")
    return Url("serial", device, _number(text, baud, "baud rate", None))


def _number(text: str, digits: str, what: str, high: int | None) -> int:
    if not (digits.isascii() and digits.isdigit()) or not 1 <= int(digits) <= (high or int(digits)):
        expected = f"between 1 and {high}" if high is not None else "above 0"
        raise UrlError(f"'{text}': {what} '{digits}' must be a number {expected}")
    return int(digits)
