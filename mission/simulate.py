"""What does a flight do with everything in one process? The twin of ``runner``: same gates, same bytes, no sockets.

Training, benchmarks and closed-loop tables fly this; a flight over MAVLink with the same plan gives the same records.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from companion import navigator
from companion.core.codec import quantise_setpoint
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import Setpoint
from mission.flight_plan import FlightPlan
from sitl.lidar import LidarParams
from sitl.modes import FlightMode
from sitl.simulation import Observation, SimConfig, Simulation
from sitl.vehicle import Turbulence, Wind

GROUND_LIMIT_S = 60.0  # vehicle time before OFFBOARD, at most

OnRecord = Callable[[navigator.Record], None]
Think = Callable[
    [navigator.Memory, Inputs, Task, navigator.Params], tuple[navigator.Memory, Setpoint, navigator.Record]
]


@dataclass(frozen=True, slots=True)
class InProcessFlight:
    """What was flown."""

    sim: Simulation
    records: list[navigator.Record]  # empty where they were handed over
    timed_out: bool


def sim_config(plan: FlightPlan) -> SimConfig:
    """The vehicle's side of a flight plan."""
    noise, wind = plan.mission.noise, plan.mission.wind
    return SimConfig(
        seed=plan.draws.sim_seed,
        spawn_ned_m=plan.draws.spawn_ned_m,
        spawn_yaw_rad=plan.draws.yaw_rad,
        wind=Wind(plan.draws.wind_ned_m_s, Turbulence[wind.turbulence.upper()]),
        radius_m=plan.params.vehicle.radius_m,
        lidar=LidarParams(sigma_m=noise.range_sigma_m, dropout=noise.dropout),
        faults=plan.mission.faults,
    )


def fly_in_process(
    plan: FlightPlan, on_record: OnRecord | None = None, think: Think = navigator.tick
) -> InProcessFlight:
    """Fly the plan until the vehicle has landed and disarmed, or its time is over.

    With ``on_record`` each record is handed over instead of kept: the maps in a flight's records fill 300 MB. ``think``
    stands in for the navigator's tick: the same tick with another policy asked.
    """
    sim = Simulation(plan.world, sim_config(plan))
    records: list[navigator.Record] = []
    keep = records.append if on_record is None else on_record
    engaged_s: float | None = None
    for record in ticks(sim, plan, think):
        keep(record)
        t_s = record.inputs.state.t_s
        if engaged_s is None and record.inputs.status.offboard:
            engaged_s = t_s
        limit_s = GROUND_LIMIT_S if engaged_s is None else engaged_s + plan.mission.success.time_limit_s
        if t_s > limit_s:
            return InProcessFlight(sim, records, True)
    return InProcessFlight(sim, records, False)


def ticks(sim: Simulation, plan: FlightPlan, think: Think = navigator.tick) -> Iterator[navigator.Record]:
    """Scan, tick, setpoint, operator; until the vehicle has flown and disarmed."""
    memory = navigator.start(plan.params)
    while not sim.finished:
        seen = sim.advance_to_scan()
        memory, setpoint, record = think(memory, _inputs(seen), plan.task, plan.params)
        sim.submit(quantise_setpoint(setpoint))
        yield record
        _operate(sim)


def _inputs(seen: Observation) -> Inputs:
    return Inputs(seen.state, seen.scan, seen.status)


def _operate(sim: Simulation) -> None:
    """What the operator does at the gates: arm, take off, hand over."""
    autopilot = sim.autopilot
    if autopilot.has_flown and autopilot.mode is FlightMode.HOLD and autopilot.armed and not autopilot.landed:
        autopilot.command_mode(FlightMode.OFFBOARD)
    elif not autopilot.armed and autopilot.ready and not autopilot.has_flown:
        autopilot.command_arm()
        autopilot.command_takeoff()
