"""The page about the MAVLink contract is the vehicle's own tables, and every entry says what it does."""

from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import common as mav

from sitl import contract
from sitl.answers import Result
from sitl.commands import request_message
from sitl.messages_sensors import distance_sensor
from sitl.router import Router
from sitl.simulation import Simulation
from sitl.world import World

PAGE = Path(__file__).parents[2] / "docs" / "mavlink.md"
NOT_SENT = {8: "LINK_NODE_STATUS", 65: "RC_CHANNELS", 291: "ESC_STATUS", 345: "PARAM_ERROR", 380: "TIME_ESTIMATE"}
NOT_SENT |= {395: "COMPONENT_INFORMATION", 397: "COMPONENT_METADATA", 410: "EVENT", 411: "CURRENT_EVENT_SEQUENCE"}


def sim(north_m: float = 7.0) -> Simulation:
    """A post ahead of the nose."""
    post = np.array([[north_m, 0.0, 0.5, np.inf]])
    world = World("post", np.zeros(2), np.array([9.0, 5.0]), (-99, -99, 99, 99), post, np.zeros((0, 6)))
    return Simulation(world)


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == contract.page(), "run `make docs`"


def test_no_cell_of_commands_and_messages_is_empty() -> None:
    for table in (contract._commands(), contract._understood(), contract._modes()):
        assert all(all(row) for row in table)


@pytest.mark.parametrize("message_id", NOT_SENT)
def test_what_the_page_says_is_not_sent_is_denied(message_id: int) -> None:
    assert NOT_SENT[message_id] in " ".join(contract.NOT_SENT)
    assert request_message(message_id, sim()).result is Result.DENIED


def test_what_the_page_calls_without_effect_has_no_handler() -> None:
    handled = {mav.mavlink_map[i].msgname for i in Router(sim(), 1).handlers if i in mav.mavlink_map}
    idle = {name for names in contract.IDLE for name in names.split(", ")}
    assert not handled & idle


@pytest.mark.parametrize(("north_m", "wanted_cm", "quality"), [(7.0, 650, 100), (60.0, 3001, 1)])
def test_the_distance_sensor_looks_ahead(north_m: float, wanted_cm: int, quality: int) -> None:
    vehicle = sim(north_m)
    assert distance_sensor(vehicle) is None
    vehicle.advance_to_scan()
    message = distance_sensor(vehicle)
    assert message is not None
    assert message.current_distance == pytest.approx(wanted_cm, abs=6)
    assert message.signal_quality == quality
    assert (message.orientation, message.max_distance) == (mav.MAV_SENSOR_ROTATION_NONE, 3000)
