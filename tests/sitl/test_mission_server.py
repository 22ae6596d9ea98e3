"""Missions over UDP, message by message: what pymavlink sees."""

import threading
import time
from collections.abc import Iterator

import pytest
from mavsdk_kit import vehicle
from mission_kit import do, item_int, place
from pymavlink.dialects.v20 import common as mav
from server_kit import Client

from sitl.mission_items import MissionItem, MissionType, opaque_id
from sitl.modes import FlightMode
from sitl.server import Server

INSTANCE = 71
LEG = (place(0, 0, 5), do(mav.MAV_CMD_DO_CHANGE_SPEED, 1.0, 5.0, -1.0), place(12, 0, 5))


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    with vehicle(INSTANCE, speed=6.0) as running:
        yield running


@pytest.fixture(scope="module")
def operator(server: Server) -> Iterator[Client]:
    client = Client(14030 + INSTANCE, 14280 + INSTANCE)
    yield client.ready()
    client.close()


@pytest.fixture(scope="module")
def ground(server: Server) -> Iterator[Client]:
    client = Client(14550 + INSTANCE, 18570 + INSTANCE, 255, 230)
    client.message("HEARTBEAT")
    yield client
    client.close()


def upload(client: Client, items: tuple[MissionItem, ...], kind: int = 0, component: int = 1) -> int:
    """Result of an upload."""
    client.send(mav.MAVLink_mission_count_message(1, component, len(items), kind))
    while True:
        message = client.until(lambda m: m.get_type() in ("MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_ACK"))
        assert message.get_type() != "MISSION_REQUEST"
        if message.get_type() == "MISSION_ACK":
            return int(message.type)
        client.send(item_int(message.seq, items[message.seq], kind))


def test_a_mission_is_flown_and_its_news_are_repeated(operator: Client) -> None:
    assert upload(operator, LEG, component=0) == mav.MAV_MISSION_ACCEPTED
    news = operator.until(lambda m: m.get_type() == "MISSION_CURRENT" and m.total == 3)
    assert (news.seq, news.mission_state) == (0, 0)
    assert operator.command(mav.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == 0
    assert operator.command(mav.MAV_CMD_MISSION_START, 0.0, 0.0) == 0
    operator.until(lambda m: m.get_type() == "MISSION_ITEM_REACHED" and m.seq == 2, 30.0)
    operator.told("Mission finished, loitering")
    for _ in range(2):
        began_s = time.monotonic()
        operator.until(lambda m: m.get_type() == "MISSION_ITEM_REACHED" and m.seq == 2, 3.0)
    assert time.monotonic() - began_s > 0.5
    operator.mode(FlightMode.HOLD)
    reached = [m.seq for m in operator.seen if m.get_type() == "MISSION_ITEM_REACHED"]
    assert sorted(set(reached)) == [1, 2]  # the speed is changed together with reaching the place
    assert operator.command(mav.MAV_CMD_NAV_LAND) == 0
    operator.told("Disarmed by landing", 30.0)


def test_mission_current_comes_every_second_on_every_link(operator: Client, ground: Client) -> None:
    for client in (operator, ground):
        client.drain()
        client.message("MISSION_CURRENT")
        began_s = time.monotonic()
        for _ in range(3):
            client.message("MISSION_CURRENT")
        assert 1.0 < time.monotonic() - began_s < 9.0  # not sharper: the machine may be busy


def test_a_mission_uploaded_on_one_link_is_read_on_another(operator: Client, ground: Client) -> None:
    assert upload(operator, LEG) == mav.MAV_MISSION_ACCEPTED
    ground.send(mav.MAVLink_mission_request_list_message(1, 1, 0))
    assert ground.message("MISSION_COUNT").count == len(LEG)
    for seq, item in enumerate(LEG):
        ground.send(mav.MAVLink_mission_request_int_message(1, 1, seq, 0))
        assert ground.message("MISSION_ITEM_INT").command == item.command
    ground.send(mav.MAVLink_mission_ack_message(1, 1, 0, 0))
    for kind in (1, 2):
        ground.send(mav.MAVLink_mission_request_list_message(1, 1, kind))
        assert ground.message("MISSION_COUNT").count == 0


def test_a_second_client_waits_while_one_uploads(operator: Client, ground: Client) -> None:
    operator.send(mav.MAVLink_mission_count_message(1, 1, 2, 0))
    operator.message("MISSION_REQUEST_INT")
    assert upload(ground, LEG) == mav.MAV_MISSION_ERROR
    operator.send(item_int(0, LEG[0]), item_int(1, LEG[2]))
    assert operator.message("MISSION_ACK").type == mav.MAV_MISSION_ACCEPTED


def test_what_is_addressed_to_somebody_else_is_ignored(operator: Client) -> None:
    operator.seen.clear()
    operator.send(mav.MAVLink_mission_count_message(9, 1, 2, 0), mav.MAVLink_mission_count_message(1, 77, 2, 0))
    end_s = time.monotonic() + 0.5
    while time.monotonic() < end_s:
        assert not [m for m in operator.poll() if m.get_type() in ("MISSION_ACK", "MISSION_REQUEST_INT")]


def test_the_id_of_the_mission_is_that_of_its_items(server: Server, operator: Client) -> None:
    upload(operator, LEG[:1])
    plans = server.sim.autopilot.plans
    assert plans.id_of(MissionType.MISSION) == opaque_id(plans.mission) != opaque_id(LEG)


def test_a_silent_ground_station_is_noticed(server: Server, ground: Client) -> None:
    """Both clients fall silent; COM_DL_LOSS_T counts wall time, as clients do."""
    server.sim.set_parameter("COM_DL_LOSS_T", 1)
    silent = threading.Event()
    silent.wait(1.6)
    ground.until(lambda m: m.get_type() == "STATUSTEXT" and m.text == "Connection to ground station lost")
    ground.until(lambda _: "GCS connection regained" in ground.texts())  # it may have come together with the loss
