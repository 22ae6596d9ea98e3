"""Can these inputs be believed? Where a state is no set of numbers the last good one stands in, and nothing was seen.

Pure; local NED. The link lets no such state through; this is the navigator's own guard: nothing that arrives may raise,
give a setpoint that is not a number, or spoil the map.
"""

import math
from dataclasses import replace

import numpy as np

from companion.core.inputs import Inputs
from companion.core.types import F64, Scan, VehicleState

ABSURD = 1e6  # no position, speed, attitude or rate, in SI units, is as large as this

NOWHERE = VehicleState(0.0, np.zeros(3), np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3))


def believable(inputs: Inputs) -> bool:
    """Are time and state numbers, and of this world?"""
    state = inputs.state
    parts: tuple[F64, ...] = (state.pos_ned_m, state.vel_ned_m_s, state.q_ned_frd, state.rates_frd_rad_s)
    size = sum(abs(value) for part in parts for value in part.tolist())
    return size < ABSURD and math.isfinite(state.t_s) and math.isfinite(inputs.scan.t_s)


def stand_in(inputs: Inputs, last: VehicleState | None, last_t_s: float) -> Inputs:
    """Inputs that say: still as ``last``, nothing seen, not fresh."""
    t_s = next((t for t in (inputs.scan.t_s, inputs.state.t_s) if math.isfinite(t)), last_t_s)
    state = replace(last or NOWHERE, t_s=t_s)
    return replace(inputs, state=state, scan=_blind(inputs.scan, t_s), fresh=False)


def _blind(scan: Scan, t_s: float) -> Scan:
    return replace(scan, t_s=t_s, range_m=np.full(len(scan.range_m), math.nan))
