"""What does the bridge to a real PX4 need before it can run? Ports, links, aircraft; everything can be refused."""

from collections.abc import Callable
from contextlib import ExitStack

from companion.core.clock import Clock
from companion.core.codec import VEHICLE_COMPONENT
from companion.core.mavlink import Connection
from companion.core.tcp import tcp_in
from companion.core.udp import udp_in, udp_out
from sitl.hil_sensors import HilSensors
from sitl.link import HOST
from sitl.px4_airframe import NONE_IRIS
from sitl.px4_bridge import HIL_PORT, LIDAR_COMPONENT, LIDAR_PORT, Bridge, BridgeLinks
from sitl.px4_ear import EAR_PORT, Px4Ear
from sitl.px4_plant import Plant
from sitl.truth_log import TruthFile
from sitl.vehicle_config import VehicleConfig

Say = Callable[[str], None]


def open_plant(config: VehicleConfig) -> Plant:
    """The aircraft of airframe 10016. Raises ValueError for a LiDAR that does not fit the physics."""
    return Plant(config.world, config.sim, NONE_IRIS)


def open_links(config: VehicleConfig, plant: Plant, clock: Clock, stack: ExitStack) -> BridgeLinks:
    """All ports, closed with the stack. Raises TransportError naming one in use."""
    instance = config.instance
    system = instance + 1  # as PX4 numbers itself
    tcp = tcp_in(HOST, HIL_PORT + instance)
    stack.callback(tcp.close)
    lidar = udp_out(HOST, LIDAR_PORT + instance, clock=clock)
    stack.callback(lidar.close)
    ear = udp_in(HOST, EAR_PORT + instance, clock)
    stack.callback(ear.close)
    return BridgeLinks(
        hil=Connection(tcp, system, VEHICLE_COMPONENT, clock=clock),
        tcp=tcp,
        lidar=Connection(lidar, system, LIDAR_COMPONENT, clock=clock),
        ear=Px4Ear(Connection(ear, system, VEHICLE_COMPONENT, clock=clock), system, plant.status),
    )


def open_bridge(
    config: VehicleConfig, plant: Plant, links: BridgeLinks, clock: Clock, truth: TruthFile | None, say: Say
) -> Bridge:
    """The bridge over open links."""
    sensors = HilSensors(config.sim.seed)
    return Bridge(plant, sensors, links, config.run.speed, clock, truth, say)


def ready_line(config: VehicleConfig) -> str:
    """What is waited for."""
    hil, lidar = HIL_PORT + config.instance, LIDAR_PORT + config.instance
    return f"aircraft for PX4 in world {config.world.name}: waiting on tcp {hil}, LiDAR to udp {lidar}"
