"""Signatures of MAVLink 2: one worked by hand, and everything that an attacker may send instead."""

import os
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from companion.core.clock import ManualClock
from companion.core.keyring import KeyFileError, Keyring, read_key
from companion.core.mavlink import Connection
from companion.core.signing import COMPANION_UNSIGNED, PX4_UNSIGNED, Book, Verdict, judge, signature, ticks
from companion.core.transport import pair

KEY = bytes(range(32))
# A HEARTBEAT of 1/191, sequence 5, link 3, timestamp 0x010203040506: `sha256sum` of key and packet is be0323462d44
HAND_MADE = bytes.fromhex("fd0901000501bf0000000000000012080004033b9803060504030201be0323462d44")
HAND_STAMP = 0x010203040506
START_S = 1_800_000_000.0  # some day in 2027
STREAM = (0, 255, 190)


def forge(link: int, system: int, component: int, timestamp: int, key: bytes = KEY, **sabotage: Any) -> bytes:
    """A COMMAND_LONG that disarms, as pymavlink signs it."""
    sender = mav.MAVLink(None, srcSystem=system, srcComponent=component)
    sender.signing.secret_key, sender.signing.link_id = key, link
    sender.signing.timestamp, sender.signing.sign_outgoing = timestamp, True
    packet: bytes = mav.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0).pack(sender)
    return packet[:-1] + bytes([packet[-1] ^ 1]) if sabotage.get("broken") else packet


def test_a_signature_worked_by_hand_is_found_and_believed() -> None:
    assert signature(KEY, HAND_MADE[:-6]) == HAND_MADE[-6:]
    book = Book()
    assert judge(HAND_MADE, KEY, book, now=0) is Verdict.GOOD
    assert book == Book(HAND_STAMP, {(3, 1, 191): HAND_STAMP}, {(0, 1, 191): 3})
    assert judge(HAND_MADE, KEY, book, now=0) is Verdict.OLD
    assert judge(HAND_MADE, KEY[::-1], Book(), now=0) is Verdict.FORGED


@pytest.mark.parametrize("place", range(len(HAND_MADE)))
def test_not_one_byte_of_a_signed_packet_may_change(place: int) -> None:
    book = Book()
    changed = bytearray(HAND_MADE)
    changed[place] ^= 0x40
    assert judge(bytes(changed), KEY, book, now=0) in (Verdict.FORGED, Verdict.UNSIGNED)
    assert book == Book()


def test_what_the_vehicle_tells_its_ground_station_cannot_be_played_to_the_companion() -> None:
    second, book = 100_000, Book()
    assert judge(forge(0, 1, 1, 100 * second), KEY, book, 0) is Verdict.GOOD
    assert judge(forge(2, 1, 1, 101 * second), KEY, book, 0) is Verdict.OLD
    assert judge(forge(0, 1, 1, 102 * second), KEY, book, 0) is Verdict.GOOD, "and does not disturb"
    assert judge(forge(2, 1, 1, 103 * second), KEY, book, 0, ours=1) is Verdict.GOOD, "on a link of its own it counts"
    assert judge(forge(2, 1, 1, 112 * second), KEY, book, 0) is Verdict.OLD
    assert judge(forge(2, 1, 1, 113 * second), KEY, book, 0) is Verdict.GOOD, "the first was silent for ten seconds"
    assert judge(forge(0, 1, 1, 114 * second), KEY, book, 0) is Verdict.OLD


def test_a_forged_packet_from_the_far_future_does_not_make_the_receiver_deaf() -> None:
    book, now = Book(), ticks(round(START_S * 1e6))
    assert judge(forge(*STREAM, timestamp=now), KEY, book, now) is Verdict.GOOD
    before = Book(book.timestamp, dict(book.streams), dict(book.heard_as))
    for timestamp in (now + 1, (1 << 48) - 1):
        assert judge(forge(*STREAM, timestamp=timestamp, broken=True), KEY, book, now) is Verdict.FORGED
        assert judge(forge(*STREAM, timestamp=timestamp, key=bytes(32)), KEY, book, now) is Verdict.FORGED
    assert book == before
    assert judge(forge(*STREAM, timestamp=now + 1), KEY, book, now) is Verdict.GOOD


@settings(max_examples=200)
@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 1 << 40), st.booleans()), max_size=40))
def test_whatever_arrives_in_whatever_order_each_stream_only_goes_forward(
    arrivals: list[tuple[int, int, bool]],
) -> None:
    book, heard = Book(), dict[int, int]()
    for link, timestamp, broken in arrivals:
        last, newest = heard.get(link), book.timestamp
        verdict = judge(forge(link, 255, 190, timestamp, broken=broken), KEY, book, now=0, ours=link)
        assert (verdict is Verdict.FORGED) == broken
        if verdict is Verdict.GOOD:
            assert last is None or timestamp > last
            heard[link] = timestamp
        elif verdict is Verdict.OLD:
            assert timestamp <= last if last is not None else timestamp < newest
    assert {stream[0]: timestamp for stream, timestamp in book.streams.items()} == heard


def test_a_stream_never_heard_may_be_a_minute_behind_and_no_more() -> None:
    now = ticks(round(START_S * 1e6))
    minute = 60 * 100_000
    assert judge(forge(0, 9, 1, now - minute), KEY, Book(), now) is Verdict.GOOD
    assert judge(forge(0, 9, 1, now - minute - 1), KEY, Book(), now) is Verdict.OLD
    assert judge(forge(0, 9, 1, now - minute - 1), KEY, Book(now), 0) is Verdict.OLD


def test_timestamps_count_ten_microseconds_since_2015() -> None:
    assert ticks(1_420_070_400 * 1_000_000) == 0
    assert ticks(1_420_070_401 * 1_000_000) == 100_000
    assert ticks(0) == 0, "a clock that was never set"


# --- key files and what is kept ---------------------------------------------------------------------------


def key_file(folder: Path, text: str = KEY.hex(), mode: int = 0o600) -> Path:
    path = folder / "key"
    path.write_text(text)
    path.chmod(mode)
    return path


def test_a_key_is_64_digits_or_the_hash_of_a_passphrase(tmp_path: Path) -> None:
    assert read_key(key_file(tmp_path, f"  {KEY.hex().upper()}\n")) == KEY
    hashed = read_key(key_file(tmp_path, "correct horse battery staple\n"))
    assert hashed.hex() == "c4bbcb1fbec99d65bf59d85c8cb62ee2db963f0fe106f483d9afa73bd4e39a8a"


@pytest.mark.parametrize(
    ("text", "mode", "says"),
    [
        (KEY.hex()[:-2], 0o600, "has 62 hexadecimal digits, a key has 64"),
        (KEY.hex() + "00", 0o600, "has 66 hexadecimal digits"),
        ("short", 0o600, "at least 8 wanted"),
        ("", 0o600, "at least 8 wanted"),
        pytest.param(
            KEY.hex(),
            0o644,
            "can be read by everybody: chmod 600",
            marks=pytest.mark.skipif(os.name != "posix", reason="POSIX"),
        ),
    ],
)
def test_a_key_file_that_must_not_be_used_is_refused_with_one_line(
    text: str, mode: int, says: str, tmp_path: Path
) -> None:
    with pytest.raises(KeyFileError, match=says) as refused:
        read_key(key_file(tmp_path, text, mode))
    assert "\n" not in str(refused.value)
    assert KEY.hex()[:10] not in str(refused.value), "a key must not end up in a log"


def test_a_key_file_that_is_not_there_or_no_text_is_refused(tmp_path: Path) -> None:
    with pytest.raises(KeyFileError, match="No such file"):
        read_key(tmp_path / "none")
    (tmp_path / "key").write_bytes(b"\xff\xfe\x00")
    (tmp_path / "key").chmod(0o600)
    with pytest.raises(KeyFileError, match="no text"):
        read_key(tmp_path / "key")
    (tmp_path / "key.a").write_text("{")
    with pytest.raises(KeyFileError, match="damaged"):
        Keyring(key_file(tmp_path), "a")


@pytest.mark.parametrize("clean", [True, False])
@pytest.mark.parametrize("clock_s", [START_S + 1.5, START_S - 86_400.0])
def test_after_a_restart_time_goes_on_above_everything_that_was_used(
    clean: bool, clock_s: float, tmp_path: Path
) -> None:
    """Also when the program was killed, and when the computer has no clock that survives."""
    clock = ManualClock(START_S)
    ring = Keyring(key_file(tmp_path), "vehicle", clock)
    sent, heard = [], []
    for _ in range(300):
        sent.append(ring.book.stamp((0, 1, 1), ticks(clock.wall_us())))
        heard.append(forge(0, 1, 191, ticks(clock.wall_us())))
        assert judge(heard[-1], KEY, ring.book, ticks(clock.wall_us())) is Verdict.GOOD
        ring.tend()
        clock.sleep_s(0.005)
    if clean:
        ring.close()
    again = Keyring(tmp_path / "key", "vehicle", ManualClock(clock_s))
    assert again.book.stamp((0, 1, 1), ticks(again.clock.wall_us())) > max(sent)
    assert {judge(packet, KEY, again.book, ticks(again.clock.wall_us())) for packet in heard} == {Verdict.OLD}
    later = forge(0, 1, 191, ticks(round((START_S + 4.0) * 1e6)))
    assert judge(later, KEY, again.book, ticks(again.clock.wall_us())) is Verdict.GOOD
    assert sorted(path.name for path in tmp_path.iterdir()) == ["key", "key.vehicle"], "nothing half-written is left"


# --- a link -----------------------------------------------------------------------------------------------


class SignedPair:
    """A vehicle and a companion that share a key, and a third who listens and speaks in between."""

    def __init__(self, folder: Path) -> None:
        clock = ManualClock(START_S)
        self.clock = clock
        key_file(folder)
        rings = [Keyring(folder / "key", name, clock) for name in ("vehicle", "companion")]
        self.vehicle_end, self.companion_end = pair()
        self.vehicle = Connection(self.vehicle_end, 1, 1, clock=clock, signing=rings[0].link(0, PX4_UNSIGNED))
        self.companion = Connection(
            self.companion_end, 1, 191, clock=clock, signing=rings[1].link(0, COMPANION_UNSIGNED)
        )

    def at_vehicle(self, *packets: bytes) -> list[str]:
        for packet in packets:
            self.companion_end.send(packet)
        return [message.get_type() for message in self.vehicle.receive()]


@pytest.fixture
def signed(tmp_path: Path) -> SignedPair:
    return SignedPair(tmp_path)


def test_partners_with_one_key_understand_each_other_both_ways(signed: SignedPair) -> None:
    for _ in range(3):
        signed.vehicle.send(mav.MAVLink_heartbeat_message(2, 12, 29, 0, 3, 3), mav.MAVLink_ping_message(1, 2, 0, 0))
        assert [m.get_type() for m in signed.companion.receive()] == ["HEARTBEAT", "PING"]
        signed.companion.send(mav.MAVLink_ping_message(1, 2, 0, 0))
        assert [m.get_type() for m in signed.vehicle.receive()] == ["PING"]
    counts = signed.companion.counts
    assert (counts.received, counts.unsigned, counts.forged, counts.old, counts.bad_bytes) == (6, 0, 0, 0, 0)


def test_replayed_and_reflected_packets_are_dropped_and_counted(signed: SignedPair) -> None:
    signed.companion.send(mav.MAVLink_ping_message(1, 2, 0, 0))
    (packet,) = signed.vehicle_end.receive()
    assert signed.at_vehicle(packet) == ["PING"]
    assert signed.at_vehicle(packet, packet) == []
    signed.vehicle.send(mav.MAVLink_ping_message(1, 2, 0, 0))
    (own,) = signed.companion_end.receive()
    assert signed.at_vehicle(own) == [], "the vehicle's own words, sent back to it"
    assert signed.vehicle.counts.old == 3


def test_what_was_heard_on_one_link_cannot_be_replayed_on_another(tmp_path: Path) -> None:
    clock = ManualClock(START_S)
    ring = Keyring(key_file(tmp_path), "vehicle", clock)
    ends = [pair() for _ in range(2)]
    links = [Connection(end[0], 1, 1, clock=clock, signing=ring.link(i, PX4_UNSIGNED)) for i, end in enumerate(ends)]
    packet = forge(0, 255, 190, ticks(clock.wall_us()))
    for _, theirs in ends:
        theirs.send(packet)
    assert [len(link.receive()) for link in links] == [1, 0]


def test_only_what_px4_lets_pass_is_believed_without_a_signature(signed: SignedPair) -> None:
    stranger = mav.MAVLink(None, srcSystem=255, srcComponent=190)
    command = mav.MAVLink_command_long_message(1, 1, 400, 0, 1, 21196, 0, 0, 0, 0, 0).pack(stranger)
    old_style = mav.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0).pack(stranger, force_mavlink1=True)
    beat = mav.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(stranger)
    radio = mav.MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1).pack(stranger)
    assert signed.at_vehicle(command, old_style, beat, radio) == ["HEARTBEAT", "RADIO_STATUS"]
    assert signed.vehicle.counts.unsigned == 2
    for packet in (beat, radio, command):
        signed.vehicle_end.send(packet)
    assert [m.get_type() for m in signed.companion.receive()] == ["RADIO_STATUS"], "it flies by the HEARTBEAT"


def test_a_wrong_signature_is_worse_than_none(signed: SignedPair) -> None:
    now = ticks(signed.clock.wall_us())
    assert signed.at_vehicle(forge(0, 255, 190, now, broken=True), forge(0, 255, 190, now, key=bytes(32))) == []
    assert signed.vehicle.counts.forged == 2
    assert signed.at_vehicle(forge(0, 255, 190, now)) == ["COMMAND_LONG"]


def test_without_a_key_signed_packets_are_read_as_px4_reads_them() -> None:
    ours, theirs = pair()
    theirs.send(HAND_MADE)
    (heartbeat,) = Connection(ours, 1, 1).receive()
    assert heartbeat.get_srcComponent() == 191
