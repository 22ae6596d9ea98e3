"""Do bytes arrive, over real sockets too, and does trouble stay quiet? Loopback only."""

import os
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing

import pytest

from companion.core.clock import ManualClock, SystemClock
from companion.core.lossy import Loss, LossyTransport
from companion.core.tcp import tcp_in, tcp_out
from companion.core.transport import Transport, TransportError, pair, wait_readable
from companion.core.udp import FORGET_S, PARTNERS_MAX, udp_in, udp_out
from companion.core.url import Url, UrlError, listens_wide, open_url, parse_url


@pytest.fixture
def opened() -> Iterator[Callable[[Transport], Transport]]:
    with ExitStack() as stack:
        yield lambda transport: stack.enter_context(closing(transport))


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def received(transport: Transport, timeout_s: float = 2.0) -> bytes:
    wait_readable([transport], timeout_s)
    return b"".join(transport.receive())


def test_udpin_answers_everyone_it_has_heard(opened) -> None:
    port = free_port()
    server = opened(udp_in("127.0.0.1", port))
    clients = [opened(udp_out("127.0.0.1", port)) for _ in range(2)]
    server.send(b"nobody is here yet")
    for client in clients:
        client.send(b"hello")
    for _ in clients:
        assert received(server).startswith(b"hello")
        if len(server.partners()) == 2:
            break
    server.send(b"answer")
    assert [received(client) for client in clients] == [b"answer", b"answer"]


def test_udpin_forgets_a_partner_after_ten_silent_seconds(opened) -> None:
    clock = ManualClock()
    port = free_port()
    server = opened(udp_in("127.0.0.1", port, clock))
    opened(udp_out("127.0.0.1", port)).send(b"hello")
    assert received(server) == b"hello"
    clock.sleep_s(FORGET_S)
    assert len(server.partners()) == 1
    clock.sleep_s(0.1)
    assert server.partners() == []


def test_udpout_keeps_its_partner_and_its_local_port(opened) -> None:
    ours, theirs = free_port(), free_port()
    client = opened(udp_out("127.0.0.1", theirs, local_port=ours))
    client.send(b"into the void")  # nobody listens: no error, now or at the next receive
    assert client.receive() == []
    server = opened(udp_in("127.0.0.1", theirs))
    client.send(b"hello")
    assert received(server) == b"hello"
    assert server.partners() == [("127.0.0.1", ours)]
    assert client.partners() == [("127.0.0.1", theirs)]


@pytest.mark.parametrize(("opener", "kind"), [(udp_in, socket.SOCK_DGRAM), (tcp_in, socket.SOCK_STREAM)])
def test_a_port_in_use_is_one_line_that_names_it(opener, kind: socket.SocketKind) -> None:
    with socket.socket(socket.AF_INET, kind) as squatter:
        squatter.bind(("127.0.0.1", 0))
        if kind == socket.SOCK_STREAM:
            squatter.listen()
        port = squatter.getsockname()[1]
        with pytest.raises(TransportError, match=rf"^(udp|tcp) port {port} is in use[^\n]*$"):
            opener("127.0.0.1", port)


def test_an_address_of_another_machine_is_one_line() -> None:
    with pytest.raises(TransportError, match=r"^udp port 14540 cannot be opened: 192\.0\.2\.1 is no address of this"):
        udp_in("192.0.2.1", 14540)


def test_tcp_serves_several_clients_and_survives_their_going(opened) -> None:
    port = free_port(socket.SOCK_STREAM)
    server = opened(tcp_in("127.0.0.1", port))
    first, second = opened(tcp_out("127.0.0.1", port)), opened(tcp_out("127.0.0.1", port))
    first.send(b"one")
    second.send(b"two")
    deadline = time.monotonic() + 2.0
    heard = b""
    while len(heard) < 6 and time.monotonic() < deadline:
        heard += received(server, 0.2)
    assert sorted([heard[:3], heard[3:]]) == [b"one", b"two"]
    first.close()
    received(server)
    server.send(b"still here")
    assert received(second) == b"still here"
    server.close()
    assert received(second) == b""
    second.send(b"gone")
    second.send(b"gone")
    assert second.receive() == []


def test_tcpout_without_a_listener_is_one_line() -> None:
    port = free_port(socket.SOCK_STREAM)
    with pytest.raises(TransportError, match=rf"^tcp 127\.0\.0\.1:{port} cannot be reached: nobody listens there$"):
        tcp_out("127.0.0.1", port)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX terminals")
def test_a_serial_line_carries_every_byte_unchanged(opened) -> None:
    master, slave = os.openpty()
    try:
        port = opened(open_url(f"serial://{os.ttyname(slave)}:57600"))
        every = bytes(range(256))
        port.send(every)
        assert os.read(master, 1024) == every
        os.write(master, every)
        assert received(port) == every
    finally:
        os.close(slave)
        os.close(master)


def test_a_missing_serial_device_is_one_line() -> None:
    with pytest.raises(TransportError, match=r"^serial /dev/no-such-port cannot be opened: [^\n]+$"):
        open_url("serial:///dev/no-such-port:57600")
    with pytest.raises(TransportError, match="no baud rate 12345"):
        open_url("serial:///dev/no-such-port:12345")


def test_waiting_for_several_returns_when_one_of_them_has_data(opened) -> None:
    sockets = [opened(udp_in("127.0.0.1", free_port())) for _ in range(2)]
    left, right = pair()
    started = time.monotonic()
    assert not wait_readable([*sockets, right], 0.05)
    assert time.monotonic() - started < 1.0
    left.send(b"x")
    assert wait_readable([*sockets, right], 1.0)
    assert right.receive() == [b"x"]
    opened(udp_out("127.0.0.1", sockets[1].port)).send(b"y")
    assert wait_readable([*sockets, right], 1.0)
    assert sockets[1].receive() == [b"y"]


def lossy_run(loss: Loss, seed: int, count: int = 400) -> list[bytes]:
    clock = ManualClock()
    near, far = pair()
    link = LossyTransport(near, loss, seed, clock)
    arrived: list[bytes] = []
    for i in range(count):
        link.send(i.to_bytes(2, "big"))
        clock.sleep_s(0.01)
        link.receive()
        arrived += far.receive()
    clock.sleep_s(10.0)
    link.receive()
    return arrived + far.receive()


def test_a_lossy_link_repeats_itself_for_the_same_seed() -> None:
    loss = Loss(loss=0.2, duplicate=0.1, delay_s=0.05, jitter_s=0.05)
    assert lossy_run(loss, 7) == lossy_run(loss, 7)
    assert lossy_run(loss, 7) != lossy_run(loss, 8)


def test_a_lossy_link_loses_doubles_and_reorders_as_told() -> None:
    assert lossy_run(Loss(), 1) == [i.to_bytes(2, "big") for i in range(400)]
    assert 280 < len(lossy_run(Loss(loss=0.2), 1)) < 360
    assert 420 < len(lossy_run(Loss(duplicate=0.1), 1)) < 470
    jittered = lossy_run(Loss(jitter_s=0.05), 1)
    assert jittered != sorted(jittered)
    assert len(jittered) == 400


def test_a_lossy_link_delays_what_comes_in_as_well() -> None:
    clock = ManualClock()
    near, far = pair()
    link = LossyTransport(near, Loss(delay_s=0.5), 1, clock)
    far.send(b"late")
    assert link.receive() == []
    assert not wait_readable([link], 0.4, clock)
    assert wait_readable([link], 0.2, clock)
    assert link.receive() == [b"late"]


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udpin://0.0.0.0:14540", Url("udpin", "0.0.0.0", 14540)),
        ("udpin://:14540", Url("udpin", "127.0.0.1", 14540)),
        ("udpout://127.0.0.1:1", Url("udpout", "127.0.0.1", 1)),
        ("tcpout://vehicle.local:5760", Url("tcpout", "vehicle.local", 5760)),
        ("serial:///dev/ttyUSB0:921600", Url("serial", "/dev/ttyUSB0", 921600)),
        ("serial:///dev/ttyACM0", Url("serial", "/dev/ttyACM0", 57600)),
    ],
)
def test_urls_read_as_mavsdk_writes_them(text: str, url: Url) -> None:
    assert parse_url(text) == url
    assert parse_url(str(url)) == url


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("14540", "no connection URL"),
        ("", "no connection URL"),
        ("udp://:14540", "udpin://HOST:PORT or udpout://HOST:PORT"),
        ("udpim://0.0.0.0:14540", "did you mean 'udpin'"),
        ("udpin://0.0.0.0", "port '' must be a number between 1 and 65535"),
        ("udpin://0.0.0.0:70000", "port '70000' must be a number between 1 and 65535"),
        ("udpin://0.0.0.0:0", "port '0' must be"),
        ("udpout://:14540", "needs a host"),
        ("serial://COM3:57600", "serial:///dev/"),
        ("serial:///dev/ttyUSB0:fast", "baud rate 'fast' must be a number above 0"),
    ],
)
def test_a_wrong_url_is_one_line_that_quotes_it(text: str, says: str) -> None:
    with pytest.raises(UrlError) as caught:
        parse_url(text)
    assert says in str(caught.value)
    assert f"'{text}'" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_host_is_one_line() -> None:
    with pytest.raises(TransportError, match=r"no-such-host\.invalid"):
        open_url("udpout://no-such-host.invalid:14540")
    with pytest.raises(TransportError, match=r"no-such-host\.invalid"):
        open_url("tcpout://no-such-host.invalid:14540")


def test_the_system_clock_moves_on() -> None:
    clock = SystemClock()
    before_s, before_us = clock.now_s(), clock.wall_us()
    clock.sleep_s(0.01)
    assert clock.now_s() - before_s >= 0.009
    assert clock.wall_us() - before_us >= 9000


def test_a_crowd_of_strangers_does_not_multiply_what_is_sent() -> None:
    with closing(udp_in("127.0.0.1", 0)) as server:
        crowd = [udp_out("127.0.0.1", server.port) for _ in range(PARTNERS_MAX + 20)]
        for stranger in crowd:
            stranger.send(b"hello")
        wait_readable([server], 1.0)
        assert len(server.receive()) == len(crowd)
        assert len(server.partners()) == PARTNERS_MAX
        for stranger in crowd:
            stranger.close()


def test_who_was_vouched_for_is_answered_even_after_a_crowd_and_strangers_are_forgotten() -> None:
    with closing(udp_in("127.0.0.1", 0)) as server:
        crowd = [udp_out("127.0.0.1", server.port) for _ in range(PARTNERS_MAX + 1)]
        for stranger in crowd:
            stranger.send(bytes([crowd.index(stranger)]))
        wait_readable([server], 1.0)
        chunks = server.receive()
        server.vouch(next(chunk for chunk in chunks if chunk == bytes([PARTNERS_MAX])))
        assert server.partners() == [("127.0.0.1", crowd[-1].port)]
        crowd[0].send(b"me too")
        wait_readable([server], 1.0)
        server.receive()
        assert server.partners() == [("127.0.0.1", crowd[-1].port)]
        for stranger in crowd:
            stranger.close()


def test_only_a_written_address_listens_beyond_this_machine() -> None:
    assert not listens_wide(parse_url("udpin://:14540"))
    assert not listens_wide(parse_url("tcpin://127.0.0.1:14540"))
    assert listens_wide(parse_url("udpin://0.0.0.0:14540"))
    assert not listens_wide(parse_url("udpout://192.168.1.7:14540"))
    with closing(udp_out("127.0.0.1", 9)) as here:
        assert here._socket.getsockname()[0] == "127.0.0.1"
