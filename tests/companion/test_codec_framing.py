"""Does the parser find every good packet between garbage, and never raise? And do logs keep what was said?"""

import random
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink import mavutil
from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.mavlink import Connection, PacketParser
from companion.core.tlog import TlogError, TlogWriter, read_tlog
from companion.core.transport import pair
from companion.core.types import LandedState


def packets(count: int, v1: bool = False) -> list[bytes]:
    sender = mav.MAVLink(None, srcSystem=1, srcComponent=1)
    made: list[bytes] = []
    for i in range(count):
        message = codec.encode_companion_heartbeat() if i % 3 else codec.encode_extended_state(LandedState.IN_AIR)
        made.append(message.pack(sender, force_mavlink1=v1))
        sender.seq = (sender.seq + 1) % 256
    return made


def signed_packet() -> bytes:
    sender = mav.MAVLink(None, srcSystem=1, srcComponent=1)
    sender.signing.secret_key = bytes(32)
    sender.signing.sign_outgoing = True
    return codec.encode_companion_heartbeat().pack(sender)


def unknown_packet() -> bytes:
    body = bytes([4, 0, 0, 9, 1, 1, 0x9A, 0x01, 0x00]) + b"\x01\x02\x03\x04"  # EVENT (410): not in the dialect
    return b"\xfd" + body + b"\x12\x34"


@pytest.mark.parametrize("v1", [False, True])
@pytest.mark.parametrize("size", [1, 3, 7, 64, 10000])
def test_every_packet_is_found_however_the_stream_is_cut(v1: bool, size: int) -> None:
    stream = b"".join(packets(30, v1))
    parser = PacketParser()
    found = [m for at in range(0, len(stream), size) for m in parser.feed(stream[at : at + size])]
    assert len(found) == 30
    assert parser.counts.bad_bytes == 0


@given(garbage=st.lists(st.binary(max_size=40), min_size=9, max_size=9), markers=st.booleans())
@settings(max_examples=150)
def test_garbage_datagrams_between_packets_cost_no_packet(garbage: list[bytes], markers: bool) -> None:
    parser = PacketParser()
    found = 0
    for noise, packet in zip(garbage, packets(9), strict=True):
        parser.feed(noise + (b"\xfd\xff\x00" if markers else b""))  # a start byte that promises 255 more
        found += len(parser.feed(packet))
    assert found == 9


def test_a_broken_packet_costs_no_good_one_inside_a_stream() -> None:
    rng = random.Random(1)
    good = packets(200)
    stream = b""
    for packet in good:
        broken = bytearray(packet)
        broken[rng.randrange(len(broken))] ^= 1 + rng.randrange(255)
        stream += packet + bytes(broken)
    found = PacketParser().feed(stream + bytes(300))
    assert len(found) >= 200


@given(data=st.binary(max_size=600), cut=st.integers(1, 50))
@settings(max_examples=150)
def test_any_bytes_are_survived(data: bytes, cut: int) -> None:
    parser = PacketParser()
    for at in range(0, len(data), cut):
        for message in parser.feed(data[at : at + cut]):
            message.to_dict()


@given(seed=st.integers(0, 2**32), flips=st.integers(1, 8))
@settings(max_examples=100)
def test_flipped_bits_never_make_a_message_that_was_not_sent(seed: int, flips: int) -> None:
    rng = random.Random(seed)
    sent = packets(6)
    stream = bytearray(b"".join(sent))
    for _ in range(flips):
        stream[rng.randrange(len(stream))] ^= 1 << rng.randrange(8)
    originals = set(sent)
    wrong = [m for m in PacketParser().feed(bytes(stream)) if bytes(m.get_msgbuf()) not in originals]
    assert len(wrong) <= 1  # CRC-16 lets one in 65536 pass


def test_unknown_ids_are_counted_and_skipped() -> None:
    parser = PacketParser()
    before, after = packets(2)
    found = parser.feed(before + unknown_packet() + after)
    assert len(found) == 2
    assert (parser.counts.unknown, parser.counts.bad_bytes, parser.counts.received) == (1, 0, 2)


def test_a_signed_packet_is_read_like_any_other() -> None:
    assert len(PacketParser().feed(signed_packet() + packets(1)[0])) == 2


def test_a_stream_of_nothing_but_start_bytes_is_bounded_and_forgotten() -> None:
    parser = PacketParser()
    for _ in range(40):
        parser.feed(b"\xfe\xff" * 1024)
    assert parser.counts.bad_bytes > 60000
    assert len(parser.feed(packets(1)[0])) == 1


def test_connections_number_their_packets_and_count_what_got_lost() -> None:
    left, right = pair()
    sender, receiver = Connection(left, 1, 191), Connection(right, 1, 1)
    for _ in range(300):
        sender.send(codec.encode_companion_heartbeat())
    chunks = right.receive()
    for chunk in (*chunks[:10], *chunks[15:], chunks[-1]):
        left._outgoing.append(chunk)
    messages = receiver.receive()
    assert len(messages) == 296
    assert (messages[0].get_srcSystem(), messages[0].get_srcComponent()) == (1, 191)
    assert (sender.counts.sent, receiver.counts.lost) == (300, 5)


def test_several_messages_leave_as_one_datagram() -> None:
    left, right = pair()
    Connection(left, 1, 1).send(codec.encode_companion_heartbeat(), codec.encode_extended_state(LandedState.IN_AIR))
    (chunk,) = right.receive()
    assert [m.get_type() for m in PacketParser().feed(chunk)] == ["HEARTBEAT", "EXTENDED_SYS_STATE"]


def test_a_log_keeps_both_directions_in_order_and_pymavlink_reads_it(tmp_path: Path) -> None:
    path = tmp_path / "link.tlog"
    log = TlogWriter(path)
    left, right = pair()
    near, far = Connection(left, 1, 1, log), Connection(right, 1, 191)
    near.send(codec.encode_extended_state(LandedState.IN_AIR))
    far.send(codec.encode_companion_heartbeat())
    assert len(near.receive()) == 1
    log.flush()
    log.close()
    records = list(read_tlog(path))
    assert [PacketParser().feed(packet)[0].get_type() for _, packet in records] == ["EXTENDED_SYS_STATE", "HEARTBEAT"]
    assert 0 <= records[1][0] - records[0][0] < 10_000_000
    reader = mavutil.mavlink_connection(str(path), dialect="common")
    assert [reader.recv_msg().get_type() for _ in range(2)] == ["EXTENDED_SYS_STATE", "HEARTBEAT"]
    assert reader._timestamp == pytest.approx(records[1][0] / 1e6)
    reader.close()


def test_a_log_cut_off_in_a_packet_ends_there(tmp_path: Path) -> None:
    path = tmp_path / "cut.tlog"
    log = TlogWriter(path)
    for packet in packets(3):
        log.write(123, packet)
    log.close()
    whole = path.read_bytes()
    for cut in range(1, 30):
        path.write_bytes(whole[:-cut])
        assert 1 <= len(list(read_tlog(path))) <= 2


def test_a_file_that_is_no_log_is_named(tmp_path: Path) -> None:
    path = tmp_path / "holiday.tlog"
    path.write_bytes(b"not a log at all, only words")
    with pytest.raises(TlogError, match=r"holiday\.tlog is no telemetry log"):
        list(read_tlog(path))


def test_nothing_but_start_bytes_keeps_nobody_from_work() -> None:
    """60 kB that would be 6000 beginnings of a HEARTBEAT."""
    parser = PacketParser()
    began_s = time.perf_counter()
    for _ in range(10):
        assert parser.feed((b"\xfd" + bytes(9)) * 6_000) == []
    assert time.perf_counter() - began_s < 1.0
    assert parser.counts.bad_bytes == 600_000
