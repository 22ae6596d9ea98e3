"""Anything at all on the companion's link: no crash, and what the vehicle is told stays finite."""

import math
from pathlib import Path

import pytest
from companion_bench import Bench
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from companion.core import codec
from companion.core.clock import ManualClock
from companion.core.keyring import Keyring
from companion.core.mavlink import Connection
from companion.core.signing import COMPANION_UNSIGNED
from companion.core.transport import pair

HEARD = [0, 1, 22, 30, 31, 32, 33, 74, 76, 77, 147, 148, 242, 245, 253, 330]  # what the companion may listen to
SENDERS = st.sampled_from([(1, 1), (1, 195), (2, 1), (255, 190), (0, 0)])


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.binary(max_size=300), max_size=20))
def test_no_bytes_break_the_companion_or_reach_it(bench: Bench, chunks: list[bytes]) -> None:
    before = bench.companion.links[0].counts.received
    for chunk in chunks:
        bench.vehicle.link.transport.send(chunk)
    bench.companion.turn(bench.stop, wait_s=0.0)
    assert bench.companion.links[0].counts.received == before
    assert bench.companion.exit_code is None


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(HEARD), st.binary(min_size=255, max_size=255), SENDERS)
def test_no_payload_of_any_message_breaks_the_companion(
    bench: Bench, message_id: int, payload: bytes, sender: tuple[int, int]
) -> None:
    kind = mav.mavlink_map[message_id]
    bench.run(0.08)
    mavlink = mav.MAVLink(None, *sender)
    body = payload[: kind.unpacker.size]
    packet = mav.MAVLink_message(message_id, kind.msgname)._pack(mavlink, kind.crc_extra, body)
    bench.vehicle.link.transport.send(packet)
    bench.companion.turn(bench.stop, wait_s=0.0)
    bench.vehicle.listen()
    for setpoint in bench.vehicle.setpoints[-2:]:
        assert setpoint.pos_ned_m is None or all(map(math.isfinite, setpoint.pos_ned_m.tolist()))


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(HEARD), st.binary(min_size=255, max_size=255), SENDERS, st.binary(min_size=32, max_size=32))
def test_on_a_signed_link_nothing_is_believed_that_another_key_has_signed(
    tmp_path: Path, message_id: int, payload: bytes, sender: tuple[int, int], key: bytes
) -> None:
    path = tmp_path / "key"
    path.write_text("11" * 32)
    path.chmod(0o600)
    ours, theirs = pair()
    link = Connection(ours, 1, 191, signing=Keyring(path, "fuzz", ManualClock()).link(0, COMPANION_UNSIGNED))
    kind = mav.mavlink_map[message_id]
    mavlink = mav.MAVLink(None, *sender)
    mavlink.signing.secret_key, mavlink.signing.sign_outgoing, mavlink.signing.timestamp = key, True, 1 << 47
    body = payload[: kind.unpacker.size]
    theirs.send(mav.MAVLink_message(message_id, kind.msgname)._pack(mavlink, kind.crc_extra, body))
    theirs.send(codec.encode_companion_heartbeat().pack(mav.MAVLink(None, *sender)))
    assert link.receive() == []
    assert (link.counts.forged, link.counts.unsigned) == (1, 1)
