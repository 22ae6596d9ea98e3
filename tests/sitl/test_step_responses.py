"""Does the embedded flight stack answer steps as real PX4 does? Against figures of PX4 v1.16.0 on the same physics.

Measured through the bridge (airframe 10016, default parameters, calm air, GPS noise of 1 to 2 cm), truth at 50 Hz.
"""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from companion.core.frames import yaw_rad
from sitl.demand import TrajectorySetpoint
from sitl.modes import FlightMode
from sitl.simulation import Simulation
from sitl.world import World

ABSENT = np.full(3, math.nan)
HOVER = (0.0, 0.0, -5.0)
SETTLE_S, STEP_S = 12.0, 6.0
SAMPLE_STEPS = 5  # 50 Hz


@dataclass(frozen=True)
class Step:
    """One step from hover at 5 m, and what real PX4 made of it."""

    pos_ned_m: tuple[float, float, float]
    vel_ned_m_s: tuple[float, float, float]
    yaw_rad: float
    size: float
    rise_s: float  # from 10 to 90 %
    overshoot: float


NO = (math.nan, math.nan, math.nan)
STEPS = {
    "2 m aside": Step((0.0, 2.0, -5.0), NO, 0.0, 2.0, 1.36, 0.105),
    "2 m up": Step((0.0, 0.0, -7.0), NO, 0.0, 2.0, 1.54, 0.0),
    "90 deg": Step(HOVER, NO, math.pi / 2, math.pi / 2, 0.40, 0.124),
    "5 m/s": Step((math.nan, math.nan, -5.0), (5.0, 0.0, math.nan), 0.0, 5.0, 1.14, 0.017),
}
OF = {
    "2 m aside": lambda sim: float(sim.truth.pos_ned_m[1]),
    "2 m up": lambda sim: -5.0 - float(sim.truth.pos_ned_m[2]),
    "90 deg": lambda sim: yaw_rad(sim.truth.q_ned_frd),
    "5 m/s": lambda sim: float(sim.truth.vel_ned_m_s[0]),
}


def response(name: str) -> tuple[float, float]:
    """Rise time from 10 to 90 % and overshoot of the embedded stack."""
    step = STEPS[name]
    world = World("open", np.zeros(2), np.array([9.0, 0.0]), (-99, -99, 99, 99), np.zeros((0, 4)), np.zeros((0, 6)))
    sim = Simulation(world)
    began_s = math.inf
    values: list[tuple[float, float]] = []
    while sim.t_s < began_s + SETTLE_S + STEP_S:
        stepped = sim.t_s > began_s + SETTLE_S
        pos, vel, yaw = (step.pos_ned_m, step.vel_ned_m_s, step.yaw_rad) if stepped else (HOVER, NO, 0.0)
        sim.submit_trajectory(TrajectorySetpoint(np.array(pos), np.array(vel), ABSENT, yaw, 0.0), None)
        if not sim.autopilot.armed and sim.t_s > 4.0 and math.isinf(began_s):
            sim.autopilot.command_mode(FlightMode.OFFBOARD)
            sim.autopilot.command_arm()
            began_s = sim.t_s
        sim.advance(SAMPLE_STEPS)
        sim.refresh()
        if stepped:
            values.append((sim.t_s - began_s - SETTLE_S, OF[name](sim) / step.size))
    t_s, value = np.array(values).T
    return float(t_s[value > 0.9][0] - t_s[value > 0.1][0]), max(0.0, float(value.max()) - 1.0)


@pytest.mark.parametrize("name", STEPS)
def test_rise_time_and_overshoot_are_those_of_real_px4(name: str) -> None:
    rise_s, overshoot = response(name)
    assert rise_s == pytest.approx(STEPS[name].rise_s, rel=0.2)
    assert overshoot == pytest.approx(STEPS[name].overshoot, rel=0.2, abs=0.02)
