"""Does the bridge give a PX4 what it needs, and get its aircraft flown? Real sockets, a stand-in for the firmware."""

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

import numpy as np
import pytest
from pretend_px4 import PretendPx4, Script
from pymavlink.dialects.v20 import common as mav

from companion.core.clock import SystemClock
from companion.core.mavlink import Connection
from companion.core.tcp import tcp_in
from companion.core.types import LandedState
from companion.core.udp import Udp, udp_in, udp_out
from sitl import px4_bridge
from sitl.app import EXIT_BAD_INPUT, run
from sitl.hil_sensors import HilSensors
from sitl.modes import FlightMode
from sitl.px4_airframe import NONE_IRIS
from sitl.px4_bridge import HIL_PORT, LIDAR_COMPONENT, Bridge, BridgeLinks
from sitl.px4_ear import Px4Ear
from sitl.px4_plant import Plant
from sitl.simulation import SimConfig
from sitl.truth_log import TruthRow
from sitl.vehicle_config import Firmware, VehicleConfig
from sitl.world import World

POST = np.array([[6.0, 0.0, 0.3, math.inf]])
INSTANCE = 231


def world(circles: np.ndarray = POST) -> World:
    return World("post", np.zeros(2), np.array([20.0, 0.0]), (-30, -30, 30, 30), circles, np.zeros((0, 6)))


@dataclass
class Rows:
    """Takes the place of the truth file."""

    rows: list[TruthRow] = field(default_factory=list)

    def write(self, rows: list[TruthRow]) -> None:
        self.rows += rows
        rows.clear()

    def flush(self) -> None:
        pass


@dataclass
class Flight:
    bridge: Bridge
    px4: PretendPx4
    truth: Rows
    companion: Udp
    said: list[str]

    def run(self, stopped: Callable[[], bool] = lambda: False) -> None:
        self.px4.start()
        self.bridge.run(stopped)

    def scans(self) -> list[mav.MAVLink_obstacle_distance_message]:
        return Connection(self.companion, 1, 191).receive()


@contextmanager
def flight(script: Script | None = None, speed: float = math.inf) -> Iterator[Flight]:
    clock = SystemClock()
    with ExitStack() as stack:
        tcp, ear, companion = tcp_in("127.0.0.1", 0), udp_in("127.0.0.1", 0), udp_in("127.0.0.1", 0)
        lidar = udp_out("127.0.0.1", companion.port)
        for link in (tcp, ear, companion, lidar):
            stack.callback(link.close)
        plant = Plant(world(), SimConfig(seed=3), NONE_IRIS)
        links = BridgeLinks(
            hil=Connection(tcp, 1, 1),
            tcp=tcp,
            lidar=Connection(lidar, 1, LIDAR_COMPONENT),
            ear=Px4Ear(Connection(ear, 1, 1), 1, plant.status),
        )
        truth, said = Rows(), list[str]()
        bridge = Bridge(plant, HilSensors(3), links, speed, clock, truth, said.append)
        px4 = PretendPx4(tcp.port, ear.port, script)
        yield Flight(bridge, px4, truth, companion, said)


@pytest.fixture(scope="module")
def flown() -> Iterator[Flight]:
    with flight() as one:
        one.run()
        yield one


def test_the_firmware_flies_the_aircraft_up_and_down_again(flown: Flight) -> None:
    heights = np.array([-row.truth.pos_ned_m[2] for row in flown.truth.rows])
    aside = np.array([math.hypot(*row.truth.pos_ned_m[:2]) for row in flown.truth.rows])
    assert heights.max() == pytest.approx(1.5, abs=0.4)
    assert heights[-1] == pytest.approx(0.0, abs=0.05)
    assert aside.max() < 1.0
    assert not flown.truth.rows[-1].contact


def test_the_truth_has_the_firmwares_own_mode_and_landed_state(flown: Flight) -> None:
    rows = flown.truth.rows
    assert {row.mode for row in rows} == {FlightMode.HOLD, FlightMode.OFFBOARD}
    airborne = [row for row in rows if row.landed is LandedState.IN_AIR]
    assert airborne and all(row.armed for row in airborne[:-3])
    assert not rows[-1].armed
    assert rows[-1].landed is LandedState.ON_GROUND


def test_the_truth_ends_when_the_flight_is_over(flown: Flight) -> None:
    disarmed = [row for row in flown.truth.rows if not row.armed and row.t_ms > 3000]
    assert len(disarmed) == 1
    assert flown.bridge.plant.status.finished


def test_sensors_come_at_250_hz_of_the_clock_that_they_set(flown: Flight) -> None:
    times = np.array(flown.px4.heard.sensor_us)
    assert times[0] == 4000
    assert set(np.diff(times).tolist()) == {4000}


def test_magnetometer_and_barometer_come_at_50_hz_and_gps_at_10_hz(flown: Flight) -> None:
    heard = flown.px4.heard
    slow = [time for time, bits in zip(heard.sensor_us, heard.fields, strict=True) if bits & 0x1BC0 == 0x1BC0]
    assert set(np.diff(slow).tolist()) == {20_000}
    assert set(np.diff(heard.gps_us).tolist()) == {100_000}
    assert all(bits & 0x3F == 0x3F for bits in heard.fields)


def test_no_step_is_taken_without_its_motor_outputs(flown: Flight) -> None:
    assert flown.bridge.missed == 0
    assert 0 <= flown.bridge.plant.step - len(flown.px4.heard.sensor_us) <= 1  # the last one found nobody


def test_the_companion_gets_every_scan_on_a_link_of_its_own(flown: Flight) -> None:
    scans = flown.scans()
    assert {scan.get_srcComponent() for scan in scans} == {LIDAR_COMPONENT}
    assert set(np.diff([scan.time_usec for scan in scans]).tolist()) == {40_000}
    assert min(scans[0].distances) == pytest.approx(570, abs=8)  # cm to the post


def test_a_firmware_that_goes_away_ends_the_run(flown: Flight) -> None:
    assert "PX4 has closed its connection" in flown.said
    assert any("times real time, 0 steps unanswered" in line for line in flown.said)


def test_a_firmware_that_hangs_is_waited_for_but_not_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(px4_bridge, "ANSWER_WALL_S", 0.02)
    with flight(Script(hang_after_s=0.5, end_s=0.54)) as one:
        one.run()
    assert one.bridge.missed > 2
    assert sum("no motor outputs" in line for line in one.said) == 1


def test_time_stands_still_until_a_firmware_has_connected_and_the_request_to_stop_is_heard() -> None:
    with flight() as one:
        one.px4._socket.close()
        one.bridge._links.tcp.receive()  # takes the connection, and sees that it is gone
        answers = iter([False] * 3 + [True] * 9)
        one.bridge.run(lambda: next(answers))
        assert one.bridge.plant.step == 0


def test_vehicle_time_is_no_faster_than_asked_for() -> None:
    with flight(Script(end_s=0.6), speed=1.5) as one:
        one.run()
    factor = one.bridge.realtime_factor
    assert factor is not None and 0.0 < factor < 1.6


def test_a_simulator_port_in_use_is_one_line_and_exit_code_2() -> None:
    said: list[str] = []
    holder = tcp_in("127.0.0.1", HIL_PORT + INSTANCE)
    try:
        config = VehicleConfig(world(), instance=INSTANCE, firmware=Firmware.PX4)
        assert run(config, said.append) == EXIT_BAD_INPUT
    finally:
        holder.close()
    assert len(said) == 1
    assert str(HIL_PORT + INSTANCE) in said[0]
