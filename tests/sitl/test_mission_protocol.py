import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mission_kit import do, item_int, place, received
from pymavlink.dialects.v20 import common as mav

from sitl.answers import StatusText
from sitl.mission_items import MissionItem, MissionType, opaque_id, verdict
from sitl.mission_protocol import RETRY_S, TIMEOUT_S, MissionProtocol
from sitl.mission_store import MissionStore

GCS, OTHER = (245, 190), (255, 230)
SQUARE = (place(0, 0, 10), place(20, 0, 10), place(20, 20, 10), do(mav.MAV_CMD_NAV_RETURN_TO_LAUNCH))


class Vehicle:
    """The protocol with a store of its own, and a clock that stands still unless told."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.changed: list[MissionType] = []
        self.said: list[StatusText] = []
        self.store = MissionStore(self.changed.append)
        self.protocol = MissionProtocol(lambda: self.store, self.said.append)

    def hear(self, message: Any, sender: tuple[int, int] = GCS, link: str = "gcs") -> list[Any]:
        answers = self.protocol.handle(link, received(message, *sender), self.now_s)
        return [received(answer, 1, 1) for answer in answers]

    def wait(self, seconds: float) -> list[Any]:
        self.now_s += seconds
        return [received(message, 1, 1) for _, message in self.protocol.tick(self.now_s)]

    def texts(self) -> list[str]:
        return [text.text for text in self.said]

    def upload(self, items: tuple[MissionItem, ...], kind: int = 0, sender: tuple[int, int] = GCS) -> Any:
        (answer,) = self.hear(mav.MAVLink_mission_count_message(1, 1, len(items), kind), sender)
        while answer.get_type() == "MISSION_REQUEST_INT":
            assert (answer.target_system, answer.target_component, answer.mission_type) == (*sender, kind)
            (answer,) = self.hear(item_int(answer.seq, items[answer.seq], kind), sender)
        return answer


def count(number: int, kind: int = 0) -> Any:
    return mav.MAVLink_mission_count_message(1, 1, number, kind)


@pytest.mark.parametrize("kind", list(MissionType))
def test_what_was_uploaded_is_downloaded_again(kind: MissionType) -> None:
    items = {
        MissionType.MISSION: SQUARE,
        MissionType.FENCE: (place(0, 0, 0, mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, (80.0, 0.0, 0.0, 0.0)),),
        MissionType.RALLY: (place(9, 9, 0, mav.MAV_CMD_NAV_RALLY_POINT), place(1, 9, 0, mav.MAV_CMD_NAV_RALLY_POINT)),
    }[kind]
    vehicle = Vehicle()
    assert vehicle.upload(items, kind).type == mav.MAV_MISSION_ACCEPTED
    assert vehicle.changed == [kind]
    (number,) = vehicle.hear(mav.MAVLink_mission_request_list_message(1, 1, kind), OTHER)
    assert (number.count, number.mission_type) == (len(items), kind)
    for seq, item in enumerate(items):
        (sent,) = vehicle.hear(mav.MAVLink_mission_request_int_message(1, 1, seq, kind), OTHER)
        assert (sent.seq, sent.command, sent.x, sent.y, sent.mission_type) == (seq, item.command, item.x, item.y, kind)
        assert [sent.param1, sent.param4, sent.z] == pytest.approx(
            [item.params[0], item.params[3], item.z], nan_ok=True
        )
    assert vehicle.hear(mav.MAVLink_mission_ack_message(1, 1, 0, kind), OTHER) == []


def test_items_are_asked_for_with_mission_request_int_only() -> None:
    vehicle = Vehicle()
    (asked,) = vehicle.hear(count(4))
    assert asked.get_type() == "MISSION_REQUEST_INT"
    # a client that answers UNSUPPORTED is asked again in the same way
    (again,) = vehicle.hear(mav.MAVLink_mission_ack_message(1, 1, mav.MAV_MISSION_UNSUPPORTED, 0))
    assert (again.get_type(), again.seq) == ("MISSION_REQUEST_INT", 0)


def test_an_old_client_is_served_with_mission_item() -> None:
    vehicle = Vehicle()
    vehicle.upload(SQUARE)
    vehicle.hear(mav.MAVLink_mission_request_list_message(1, 1, 0))
    (sent,) = vehicle.hear(mav.MAVLink_mission_request_message(1, 1, 0, 0))
    assert sent.get_type() == "MISSION_ITEM"
    assert sent.x == pytest.approx(47.397742, abs=1e-4)


def test_items_of_an_old_client_are_taken() -> None:
    vehicle = Vehicle()
    vehicle.hear(count(1))
    item = mav.MAVLink_mission_item_message(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, 47.3978, 8.5456, 12.0, 0)
    (ack,) = vehicle.hear(item)
    assert ack.type == mav.MAV_MISSION_ACCEPTED
    assert vehicle.store.mission[0].lat_lon_deg == pytest.approx((47.3978, 8.5456), abs=1e-5)


def test_an_item_that_does_not_come_is_asked_for_again_until_the_transfer_dies() -> None:
    vehicle = Vehicle()
    vehicle.hear(count(4))
    vehicle.hear(item_int(0, SQUARE[0]))
    asked = []
    while not vehicle.said:
        asked += vehicle.wait(0.05)
    assert vehicle.now_s == pytest.approx(TIMEOUT_S, abs=0.11)
    assert {message.seq for message in asked} == {1}
    assert len(asked) == pytest.approx(TIMEOUT_S / RETRY_S, abs=4)
    assert vehicle.texts() == ["Operation timeout"]
    assert vehicle.store.mission == ()
    assert vehicle.upload(SQUARE).type == mav.MAV_MISSION_ACCEPTED  # and the next one may begin


def test_a_second_client_is_told_to_wait() -> None:
    vehicle = Vehicle()
    vehicle.hear(count(4))
    (same_link,) = vehicle.hear(count(2), OTHER)
    (other_link,) = vehicle.hear(count(2), OTHER, link="operator")
    assert same_link.type == other_link.type == mav.MAV_MISSION_ERROR
    assert (other_link.target_system, other_link.target_component) == OTHER
    (asked,) = vehicle.hear(item_int(0, SQUARE[0]))
    assert asked.seq == 1  # the first goes on


def test_an_upload_during_a_download_is_refused_with_px4s_text() -> None:
    vehicle = Vehicle()
    vehicle.upload(SQUARE)
    vehicle.hear(mav.MAVLink_mission_request_list_message(1, 1, 0))
    (ack,) = vehicle.hear(count(2), OTHER)
    assert ack.type == mav.MAV_MISSION_ERROR
    assert vehicle.texts() == ["WPM: IGN MISSION_COUNT: Busy"]


def test_two_links_download_at_the_same_time() -> None:
    vehicle = Vehicle()
    vehicle.upload(SQUARE)
    vehicle.hear(mav.MAVLink_mission_request_list_message(1, 1, 0))
    vehicle.hear(mav.MAVLink_mission_request_list_message(1, 1, 0), OTHER, "operator")
    for seq in range(len(SQUARE)):
        for sender, link in ((GCS, "gcs"), (OTHER, "operator")):
            (sent,) = vehicle.hear(mav.MAVLink_mission_request_int_message(1, 1, seq, 0), sender, link)
            assert sent.seq == seq


@pytest.mark.parametrize(
    ("item", "result", "text"),
    [
        (place(1, 1, 5, 31999), mav.MAV_MISSION_UNSUPPORTED, "IGN MISSION_ITEM: Invalid item"),
        (
            MissionItem(1, 16, (0, 0, 0, 0), 1, 1, 5.0),
            mav.MAV_MISSION_UNSUPPORTED_FRAME,
            "IGN MISSION_ITEM: Invalid item",
        ),
        (do(mav.MAV_CMD_DO_SET_ROI, 9.0), mav.MAV_MISSION_INVALID_PARAM1, "IGN MISSION_ITEM: Invalid item"),
        (place(1, 1, 5, mav.MAV_CMD_NAV_RALLY_POINT), mav.MAV_MISSION_ERROR, None),
    ],
)
def test_a_bad_item_ends_the_upload_as_px4_ends_it(item: MissionItem, result: int, text: str | None) -> None:
    vehicle = Vehicle()
    vehicle.hear(count(2))
    (ack,) = vehicle.hear(item_int(0, item))
    assert ack.type == result
    assert vehicle.texts() == ([text] if text else [])
    assert vehicle.upload(SQUARE).type == mav.MAV_MISSION_ACCEPTED


@pytest.mark.parametrize(
    "command", [1000, 1001, 2000, 2001, 2500, 2501, 530, 206, 203, 204, 205, 214, 177, 178, 93, 20, 189, 3000]
)
def test_commands_of_cameras_and_gimbals_are_taken(command: int) -> None:
    assert verdict(do(command, 0.0), MissionType.MISSION) == mav.MAV_MISSION_ACCEPTED


def test_a_list_that_is_too_long_finds_no_space() -> None:
    (ack,) = Vehicle().hear(count(2001))
    assert ack.type == mav.MAV_MISSION_NO_SPACE


@pytest.mark.parametrize(("kind", "left"), [(0, {1, 2}), (1, {0, 2}), (255, set())])
def test_clearing_takes_one_list_or_all(kind: int, left: set[int]) -> None:
    vehicle = Vehicle()
    vehicle.upload(SQUARE)
    vehicle.upload((place(0, 0, 0, mav.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION, (80.0, 0, 0, 0)),), 1)
    vehicle.upload((place(0, 0, 0, mav.MAV_CMD_NAV_RALLY_POINT),), 2)
    (ack,) = vehicle.hear(mav.MAVLink_mission_clear_all_message(1, 1, kind))
    assert (ack.type, ack.mission_type) == (mav.MAV_MISSION_ACCEPTED, kind)
    assert {int(k) for k in MissionType if vehicle.store.items(k)} == left
    (empty,) = vehicle.hear(mav.MAVLink_mission_request_list_message(1, 1, 0 if kind != 1 else 1))
    assert empty.count == 0


def test_the_current_item_is_set_within_the_list_only() -> None:
    vehicle = Vehicle()
    vehicle.upload(SQUARE)
    vehicle.hear(mav.MAVLink_mission_set_current_message(1, 1, 2))
    assert vehicle.store.current == 2
    vehicle.hear(mav.MAVLink_mission_set_current_message(1, 1, 4))
    assert vehicle.store.current == 2
    assert vehicle.texts() == ["WPM: WP CURR CMD: Not in list"]


def test_the_same_mission_again_leaves_its_progress() -> None:
    vehicle = Vehicle()
    vehicle.upload(SQUARE)
    vehicle.store.jump_to(2)
    assert vehicle.upload(SQUARE).type == mav.MAV_MISSION_ACCEPTED
    assert vehicle.store.current == 2
    assert vehicle.changed == [MissionType.MISSION]


def test_the_opaque_id_tells_lists_apart_and_travels_with_count_and_ack() -> None:
    vehicle = Vehicle()
    vehicle.hear(count(1))
    raw = vehicle.protocol.handle("gcs", received(item_int(0, SQUARE[0])), 0.0)[0].pack(mav.MAVLink(None, 1, 1))
    list_id = opaque_id(SQUARE[:1])
    assert raw[10:-2][4:8] == list_id.to_bytes(4, "little")
    assert len({opaque_id(SQUARE[:n]) for n in range(5)}) == 5
    assert opaque_id(()) == 0


def test_what_does_not_belong_to_a_transfer_is_answered_as_px4_answers() -> None:
    vehicle = Vehicle()
    vehicle.upload(SQUARE)
    (last_again,) = vehicle.hear(item_int(3, SQUARE[3]))
    assert last_again.type == mav.MAV_MISSION_ACCEPTED  # our ACK was lost
    (stray,) = vehicle.hear(item_int(1, SQUARE[1]))
    assert stray.type == mav.MAV_MISSION_ERROR
    assert vehicle.hear(mav.MAVLink_mission_request_int_message(1, 1, 0, 0)) == []
    vehicle.hear(mav.MAVLink_mission_request_list_message(1, 1, 0))
    (skipped,) = vehicle.hear(mav.MAVLink_mission_request_int_message(1, 1, 3, 0))
    assert skipped.type == mav.MAV_MISSION_ERROR
    assert vehicle.texts() == ["IGN MISSION_ITEM: No transfer", "WPM: REJ. CMD: Req. WP was unexpected"]


@settings(max_examples=40, deadline=None)
@given(st.lists(st.booleans(), max_size=60), st.integers(1, 6))
def test_a_lossy_link_transfers_the_mission_all_the_same(losses: list[bool], number: int) -> None:
    """Each True is a datagram lost, in either direction; then the link works."""
    fate = iter(losses)
    vehicle, items = Vehicle(), SQUARE[:1] * number
    ack, heard, sent_s = None, [], -math.inf
    while ack is None and vehicle.now_s < 60.0:
        for message in heard:
            if next(fate, False):
                continue
            if message.get_type() == "MISSION_ACK":
                ack = message
            else:
                answers = vehicle.hear(item_int(message.seq, items[message.seq])) if not next(fate, False) else []
                heard = [*answers]
                break
        else:
            heard = []
        if not heard:
            heard = vehicle.wait(0.1)
            if vehicle.now_s - sent_s > 6.0 and not next(fate, False):  # a client that starts anew
                sent_s = vehicle.now_s
                heard = vehicle.hear(count(number))
    assert ack is not None
    assert len(vehicle.store.mission) == number


@settings(max_examples=60, deadline=None)
@given(
    st.lists(
        st.one_of(
            st.builds(count, st.integers(0, 65535), st.integers(0, 255)),
            st.builds(item_int, st.integers(0, 65535), st.sampled_from(SQUARE), st.integers(0, 255)),
            st.builds(
                mav.MAVLink_mission_request_int_message, st.just(1), st.just(1), st.integers(0, 9), st.integers(0, 3)
            ),
            st.builds(mav.MAVLink_mission_request_list_message, st.just(1), st.just(1), st.integers(0, 255)),
            st.builds(mav.MAVLink_mission_set_current_message, st.just(1), st.just(1), st.integers(0, 65535)),
            st.builds(mav.MAVLink_mission_clear_all_message, st.just(1), st.just(1), st.integers(0, 255)),
            st.builds(mav.MAVLink_mission_ack_message, st.just(1), st.just(1), st.integers(0, 20), st.integers(0, 3)),
        ),
        max_size=30,
    )
)
def test_no_order_of_messages_breaks_the_protocol(messages: list[Any]) -> None:
    vehicle = Vehicle()
    for message in messages:
        vehicle.hear(message)
        vehicle.wait(0.1)
    vehicle.wait(2 * TIMEOUT_S)
    assert vehicle.upload(SQUARE).type == mav.MAV_MISSION_ACCEPTED
