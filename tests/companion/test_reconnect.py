"""Does a link come back by itself: a serial plug pulled, a server restarted? Pseudo terminals and loopback."""

import os
import socket
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest

from companion.core import codec
from companion.core.clock import ManualClock
from companion.core.mavlink import Connection
from companion.core.serial_port import OPEN_AGAIN_S, SerialPort
from companion.core.tcp import CALL_AGAIN_S, Tcp, tcp_in, tcp_out
from companion.core.transport import wait_readable
from companion.core.url import open_url


class Plug:
    """A serial device under a name of its own, which can be pulled and put back."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.put_in()

    def put_in(self) -> None:
        self.master, slave = os.openpty()
        self.path.unlink(missing_ok=True)
        self.path.symlink_to(os.ttyname(slave))
        self._slave = slave  # held, so that the terminal stays until it is pulled

    def pull(self) -> None:
        self.path.unlink()
        os.close(self._slave)
        os.close(self.master)


@pytest.fixture
def plug(tmp_path: Path) -> Iterator[Plug]:
    plug = Plug(tmp_path / "ttyTEST")
    yield plug
    if plug.path.exists():
        plug.pull()


def test_a_pulled_serial_plug_is_silence_and_works_again_when_it_is_back(plug: Plug) -> None:
    clock = ManualClock(100.0)
    with closing(SerialPort(str(plug.path), 57600, clock)) as port:
        os.write(plug.master, b"before")
        assert b"".join(port.receive()) == b"before"
        plug.pull()
        assert port.receive() == []
        assert port.files() == ()
        port.send(b"into the void")
        clock.sleep_s(OPEN_AGAIN_S)
        assert port.receive() == []  # looked for, not there
        plug.put_in()
        assert port.receive() == []  # not looked for again at once
        clock.sleep_s(OPEN_AGAIN_S)
        port.send(b"hello again")
        assert os.read(plug.master, 64) == b"hello again"
        os.write(plug.master, b"after")
        assert b"".join(port.receive()) == b"after"
        assert len(port.files()) == 1


def test_a_closed_serial_port_stays_closed(plug: Plug) -> None:
    clock = ManualClock(100.0)
    port = SerialPort(str(plug.path), 57600, clock)
    port.close()
    port.close()
    clock.sleep_s(10.0)
    port.send(b"x")
    assert port.receive() == []
    assert port.files() == ()


def test_waiting_on_a_pulled_plug_lasts_as_long_as_asked(plug: Plug) -> None:
    with closing(SerialPort(str(plug.path), 57600)) as port:
        plug.pull()
        port.receive()
        assert not wait_readable([port], 0.02)


def test_mavlink_over_a_serial_line_goes_on_after_a_packet_cut_in_two(plug: Plug) -> None:
    clock = ManualClock(100.0)
    with closing(open_url(f"serial://{plug.path}:57600", clock)) as port:
        link = Connection(port, 1, 191, clock=clock)
        heartbeat = bytes(codec.encode_companion_heartbeat().pack(codec.mav.MAVLink(None, 1, 1)))
        os.write(plug.master, heartbeat[:9])
        assert link.receive() == []
        plug.pull()
        link.receive()
        plug.put_in()
        clock.sleep_s(OPEN_AGAIN_S)
        link.receive()
        os.write(plug.master, heartbeat * 2)
        assert [message.get_msgId() for message in link.receive()] == [0, 0]


def told(server: Tcp, client: Tcp, text: bytes) -> bytes:
    client.send(text)
    wait_readable([server], 2.0)
    return b"".join(server.receive())


def test_tcpout_calls_again_until_the_server_is_back() -> None:
    clock = ManualClock(100.0)
    server = tcp_in("127.0.0.1", 0)
    port = server.port
    with closing(tcp_out("127.0.0.1", port, clock)) as client:
        assert told(server, client, b"before") == b"before"
        server.close()
        for _ in range(20):  # refused each time, and never waited for
            clock.sleep_s(CALL_AGAIN_S)
            client.send(b"into the void")
            assert client.receive() == []
        with closing(tcp_in("127.0.0.1", port)) as server:
            clock.sleep_s(CALL_AGAIN_S)
            client.receive()
            client.receive()
            assert told(server, client, b"after") == b"after"
            server.send(b"answer")
            wait_readable([client], 2.0)
            assert client.receive() == [b"answer"]


def test_tcpout_does_not_call_again_after_close() -> None:
    clock = ManualClock(100.0)
    with closing(tcp_in("127.0.0.1", 0)) as server:
        client = tcp_out("127.0.0.1", server.port, clock)
        client.close()
        clock.sleep_s(10.0)
        client.send(b"x")
        assert client.receive() == []


def test_a_server_that_does_not_answer_the_call_is_given_up_and_called_anew() -> None:
    clock = ManualClock(100.0)
    with socket.socket() as deaf:
        deaf.bind(("127.0.0.1", 0))
        deaf.listen(0)
        client = tcp_out("127.0.0.1", deaf.getsockname()[1], clock)
        accepted, _ = deaf.accept()
        accepted.close()
        with closing(client):
            for _ in range(30):
                clock.sleep_s(0.3)
                client.send(b"x")
                client.receive()
