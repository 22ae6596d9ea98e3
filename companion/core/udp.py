"""How do bytes travel over UDP? IPv4; listens for partners (``udpin``) or sends to a known one (``udpout``).

Every source that was heard is a partner and gets what is sent, until it has been silent for ten seconds (as MAVSDK
does); the address given to ``udpout`` is one always. There are not many: a crowd of strangers must not make each
message a hundred. Where partners sign, strangers are forgotten as soon as one has been vouched for.
"""

import errno
import socket
from collections.abc import Sequence

from companion.core.clock import Clock, SystemClock
from companion.core.transport import Selectable, TransportError

Address = tuple[str, int]

FORGET_S = 10.0  # MAVSDK's REMOTE_TIMEOUT of a udpin connection
RECEIVE_BUFFER_BYTES = 1 << 20
DATAGRAM_MAX_BYTES = 65535
DATAGRAMS_PER_CALL = 512  # a flood must not keep the caller from its work
PARTNERS_MAX = 16

LOOPBACK = "127.0.0.1"


class Datagram(bytes):
    """A chunk that remembers who sent it."""

    source: Address | None = None


class Udp:
    """One UDP socket, its fixed partner if any, and the partners it has heard."""

    def __init__(self, name: str, bind: Address, remote: Address | None = None, clock: Clock | None = None) -> None:
        """Bind ``bind`` (port 0: any). Raises TransportError naming the port."""
        self._name = name
        self._clock = clock or SystemClock()
        self._fixed = _resolve(remote) if remote is not None else None
        self._heard_s: dict[Address, float] = {}
        self._vouched: set[Address] = set()
        self._socket = _bound_socket(bind)
        self._open = True

    @property
    def name(self) -> str:
        """The URL."""
        return self._name

    @property
    def port(self) -> int:
        """The local port."""
        return int(self._socket.getsockname()[1])

    def partners(self) -> list[Address]:
        """Who gets what is sent now."""
        now_s = self._clock.now_s()
        for address, heard_s in list(self._heard_s.items()):
            if now_s - heard_s > FORGET_S:
                del self._heard_s[address]
                self._vouched.discard(address)
        return [self._fixed, *self._heard_s] if self._fixed is not None else list(self._heard_s)

    def send(self, data: bytes) -> None:
        """One datagram to every partner; an unreachable one is skipped."""
        if not self._open:
            return
        for address in self.partners():
            try:
                self._socket.sendto(data, address)
            except OSError:  # unreachable, refused, buffer full: a datagram lost, as UDP does
                continue

    def receive(self) -> list[bytes]:
        """The datagrams that are waiting."""
        datagrams: list[bytes] = []
        while self._open and len(datagrams) < DATAGRAMS_PER_CALL:
            try:
                data, address = self._socket.recvfrom(DATAGRAM_MAX_BYTES)
            except ConnectionError:  # an earlier datagram was refused; the next call has the next one
                continue
            except BlockingIOError:
                break
            if address != self._fixed:
                self._hear(address)
            datagram = Datagram(data)
            datagram.source = address
            datagrams.append(datagram)
        return datagrams

    def vouch(self, chunk: bytes) -> None:
        """The sender of this datagram can be trusted; strangers are no partners any more."""
        source = chunk.source if isinstance(chunk, Datagram) else None
        if source is None:
            return
        self._vouched.add(source)
        if source != self._fixed:
            self._heard_s[source] = self._clock.now_s()
        self._heard_s = {address: heard_s for address, heard_s in self._heard_s.items() if address in self._vouched}

    def _hear(self, address: Address) -> None:
        known = address in self._heard_s
        if known or (not self._vouched and len(self.partners()) < PARTNERS_MAX):
            self._heard_s[address] = self._clock.now_s()

    def files(self) -> Sequence[Selectable]:
        """The socket."""
        return (self._socket,) if self._open else ()

    def ready(self) -> bool:
        """Never: select sees everything."""
        return False

    def close(self) -> None:
        """Free the port."""
        self._open = False
        self._socket.close()


def udp_in(host: str, port: int, clock: Clock | None = None) -> Udp:
    """Listen on ``host:port`` and answer whoever speaks."""
    return Udp(f"udpin://{host}:{port}", (host, port), clock=clock)


def udp_out(host: str, port: int, local_port: int = 0, clock: Clock | None = None) -> Udp:
    """Send to ``host:port`` from ``local_port`` (0: any); others who speak to that port are answered as well.

    A partner on this machine is spoken to from an address that only this machine reaches.
    """
    here = is_loopback(_resolve((host, port))[0])
    return Udp(f"udpout://{host}:{port}", (LOOPBACK if here else "0.0.0.0", local_port), (host, port), clock)


def is_loopback(host: str) -> bool:
    """Is this an address that no other machine reaches?"""
    return host == "localhost" or host.startswith("127.")


def _resolve(address: Address) -> Address:
    """Host names to IPv4 once, so that ``recvfrom`` addresses compare equal."""
    try:
        return (socket.gethostbyname(address[0]), address[1])
    except OSError as error:
        raise TransportError(f"host '{address[0]}' is not known ({error.strerror or error})") from error


def _bound_socket(bind: Address) -> socket.socket:
    host, port = _resolve(bind)
    udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    udp.setblocking(False)
    try:
        udp.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)
        udp.bind((host, port))
    except OSError as error:
        udp.close()
        raise TransportError(bind_problem("udp", host, port, error)) from error
    return udp


def bind_problem(protocol: str, host: str, port: int, error: OSError) -> str:
    """One line on why a port could not be opened."""
    if error.errno == errno.EADDRINUSE:
        return f"{protocol} port {port} is in use: another program listens there (another vehicle, companion or GCS?)"
    if error.errno == errno.EACCES:
        return f"{protocol} port {port} may not be opened by this user"
    if error.errno == errno.EADDRNOTAVAIL:
        return f"{protocol} port {port} cannot be opened: {host} is no address of this machine"
    return f"{protocol} port {port} on {host} cannot be opened: {error.strerror or error}"
