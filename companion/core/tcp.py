"""How do bytes travel over TCP? IPv4; listens for any number of clients (``tcpin``) or connects to one (``tcpout``).

A lost connection is silence; ``tcpin`` takes the next client, ``tcpout`` calls again until somebody answers.
"""

import contextlib
import errno
import math
import socket
from collections.abc import Sequence

from companion.core.clock import Clock, SystemClock
from companion.core.transport import Selectable, TransportError
from companion.core.udp import bind_problem

CONNECT_TIMEOUT_S = 3.0
CALL_AGAIN_S = 0.5  # between two attempts to get a lost server back
CHUNK_BYTES = 65536
UNSENT_MAX_BYTES = 1 << 20  # a client that does not read this much is dropped
BACKLOG = 8
UNDER_WAY = (errno.EINPROGRESS, errno.EALREADY, errno.EINTR, errno.EWOULDBLOCK)


class Tcp:
    """A set of stream connections that hear the same; behind a listener, or a single one that is made again."""

    def __init__(
        self,
        name: str,
        listener: socket.socket | None = None,
        streams: list["_Stream"] | None = None,
        caller: "_Caller | None" = None,
    ) -> None:
        self._name = name
        self._listener = listener
        self._streams = streams or []
        self._caller = caller

    @property
    def name(self) -> str:
        """The URL."""
        return self._name

    @property
    def port(self) -> int:
        """The local port of the listener, or 0."""
        return int(self._listener.getsockname()[1]) if self._listener is not None else 0

    @property
    def clients(self) -> int:
        """Open connections."""
        return len(self._streams)

    def send(self, data: bytes) -> None:
        """To every open connection."""
        self._renew()
        for stream in self._streams:
            stream.send(data)
        self._drop_closed()

    def receive(self) -> list[bytes]:
        """What arrived on every connection."""
        self._renew()
        chunks = [chunk for stream in self._streams for chunk in stream.receive()]
        self._drop_closed()
        return chunks

    def files(self) -> Sequence[Selectable]:
        """Listener and open connections."""
        sockets = [stream.socket for stream in self._streams]
        return [self._listener, *sockets] if self._listener is not None else sockets

    def ready(self) -> bool:
        """Never: select sees everything."""
        return False

    def close(self) -> None:
        """Close listener and connections."""
        for stream in self._streams:
            stream.close()
        self._streams = []
        if self._listener is not None:
            self._listener.close()
            self._listener = None
        if self._caller is not None:
            self._caller.close()
            self._caller = None

    def _renew(self) -> None:
        """Take new clients, or get the lost server back."""
        if self._caller is not None and not self._streams:
            connected = self._caller.connected()
            self._streams = [_Stream(connected)] if connected is not None else []
        while self._listener is not None:
            try:
                client, _ = self._listener.accept()
            except OSError:  # nobody waits, or the client is gone already
                return
            self._streams.append(_Stream(client))

    def _drop_closed(self) -> None:
        self._streams = [stream for stream in self._streams if stream.open]


def tcp_in(host: str, port: int) -> Tcp:
    """Listen on ``host:port``. Raises TransportError naming the port."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(BACKLOG)
    except OSError as error:
        listener.close()
        raise TransportError(bind_problem("tcp", host, port, error)) from error
    listener.setblocking(False)
    return Tcp(f"tcpin://{host}:{port}", listener)


def tcp_out(host: str, port: int, clock: Clock | None = None) -> Tcp:
    """Connect to ``host:port``. Raises TransportError when nobody listens there now; later losses are made good."""
    try:
        stream = socket.create_connection((host, port), CONNECT_TIMEOUT_S)
    except OSError as error:
        reason = "nobody listens there" if error.errno == errno.ECONNREFUSED else str(error.strerror or error)
        raise TransportError(f"tcp {host}:{port} cannot be reached: {reason}") from error
    address = stream.getpeername()
    return Tcp(f"tcpout://{host}:{port}", None, [_Stream(stream)], _Caller(address, clock or SystemClock()))


class _Caller:
    """Connects again without ever waiting: one attempt at a time, each given up after a while."""

    def __init__(self, address: tuple[str, int], clock: Clock) -> None:
        self._address = address
        self._clock = clock
        self._attempt: socket.socket | None = None
        self._began_s = -math.inf

    def connected(self) -> socket.socket | None:
        """The connection, once there is one."""
        now_s = self._clock.now_s()
        if self._attempt is None and now_s - self._began_s >= CALL_AGAIN_S:
            self._attempt, self._began_s = socket.socket(socket.AF_INET, socket.SOCK_STREAM), now_s
            self._attempt.setblocking(False)
        if self._attempt is None:
            return None
        result = self._attempt.connect_ex(self._address)
        if result in (0, errno.EISCONN) and not _is_own_echo(self._attempt):
            made, self._attempt = self._attempt, None
            return made
        if result not in UNDER_WAY or now_s - self._began_s > CONNECT_TIMEOUT_S:
            self.close()
        return None

    def close(self) -> None:
        """Give the attempt up."""
        if self._attempt is not None:
            self._attempt.close()
            self._attempt = None


def _is_own_echo(connected: socket.socket) -> bool:
    """Loopback joins a caller to itself when its own port happens to be the one it calls."""
    try:
        return bool(connected.getsockname() == connected.getpeername())
    except OSError:  # gone already
        return True


class _Stream:
    """One connected socket with what it has not sent yet."""

    def __init__(self, connected: socket.socket) -> None:
        self.socket = connected
        self.open = True
        self._unsent = bytearray()
        connected.setblocking(False)
        with contextlib.suppress(OSError):
            connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, data: bytes) -> None:
        self._unsent += data
        try:
            while self._unsent:
                sent = self.socket.send(self._unsent)
                del self._unsent[:sent]
        except BlockingIOError:
            if len(self._unsent) > UNSENT_MAX_BYTES:
                self.close()
        except OSError:
            self.close()

    def receive(self) -> list[bytes]:
        chunks: list[bytes] = []
        while self.open:
            try:
                chunk = self.socket.recv(CHUNK_BYTES)
            except BlockingIOError:
                break
            except OSError:
                self.close()
                break
            if not chunk:  # the other side has closed
                self.close()
                break
            chunks.append(chunk)
        return chunks

    def close(self) -> None:
        self.open = False
        self.socket.close()
