"""How does the vehicle move? JSBSim's quadrotor in SI units and local NED; the loops fly inside JSBSim.

Local ned: origin where the vehicle stands at the start (down_m = 0 standing on its legs), the world's axes. The control
loops run inside JSBSim at physics rate (models/aircraft/mavic2pro); here only setpoints, parameters and truth pass.
Same seed, same calls: the same bits.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from companion.core.frames import euler_rad, quaternion, rotation_ned_frd, wrap_rad
from companion.core.params import nearest
from companion.core.types import F64
from sitl.aircraft import (
    AXES,
    CONTACTS,
    FT_M,
    FULL_THRUST_N,
    IN_M,
    LB_N,
    LOOPS,
    MASS_KG,
    READ,
    REST_HEIGHT_M,
    ROTORS,
    TURBULENCE,
    WRITTEN,
    load,
    node,
)

DT_S = 0.004  # 250 Hz: 4 cm from the 1 kHz solution over a 40 m slalom of steps
ABSENT = (math.nan, math.nan, math.nan)
_SEEDS = 2**31 - 2  # JSBSim draws from minstd, whose state is 1 to 2^31 - 2; 0 would repeat 1
_MILSPEC = 3.0  # atmosphere/turb-type: Milspec (Tustin's variant is slow and drifts)
Vector = F64 | Sequence[float]


class ControlMode(IntEnum):
    """What the loops in the XML follow (property ap/mode)."""

    IDLE = 0
    POSITION = 1
    ATTITUDE = 2
    RATES = 3
    MOTORS = 4


class Turbulence(IntEnum):
    """Strength of MIL-F-8785C low-altitude turbulence; JSBSim scales it with the wind at 20 ft, and with airspeed."""

    NONE = 0
    LIGHT = 1
    MODERATE = 2
    SEVERE = 3

    @property
    def w20_m_s(self) -> float:
        """Wind speed at 20 ft above ground: 15, 30, 45 kt (MIL-F-8785C)."""
        return int(self) * 15 * 0.514444


@dataclass(frozen=True, slots=True)
class Wind:
    """Moving air: where it moves to, and how rough it is. Turbulence needs a mean wind or airspeed to be felt."""

    mean_ned_m_s: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turbulence: Turbulence = Turbulence.NONE


@dataclass(frozen=True, slots=True)
class Truth:
    """What really is, at one instant of vehicle time. Simulator only."""

    t_s: float
    pos_ned_m: F64  # (3,)
    vel_ned_m_s: F64  # (3,)
    q_ned_frd: F64  # (4,)
    rates_frd_rad_s: F64  # (3,)
    acc_frd_m_s2: F64  # (3,) specific force, as an accelerometer feels it
    on_ground: bool  # any leg or rotor tip touches
    thrust_norm: float  # sum of rotor thrusts over full thrust at sea level


@dataclass(frozen=True, slots=True)
class Loops:
    """What the control loops ask for right now. Telemetry only."""

    z_ned: F64  # (3,) where the body's down axis should point
    thrust_norm: float
    rates_frd_rad_s: F64  # (3,)
    rotors_norm: tuple[float, ...]  # speed of each rotor over its fullest; order as ``aircraft.ROTORS``


class Vehicle:
    """The quadrotor: ``reset``, then commands and ``step`` in any order; ``truth`` reads."""

    def __init__(self, dt_s: float = DT_S) -> None:
        self.dt_s = dt_s
        self._fdm = load(dt_s)
        self._run = self._fdm.run
        self._set = {name: node(self._fdm, name).set_double_value for name in WRITTEN}
        self._axes = tuple(
            tuple(self._set[f"{group}-{axis}"] for group in ("sp/pos", "use/pos", "sp/vel", "use/vel", "sp/acc"))
            for axis in AXES
        )
        self._get = tuple(node(self._fdm, name).get_double_value for name in READ)
        self._loops = tuple(node(self._fdm, name).get_double_value for name in LOOPS)
        self._touch = tuple(node(self._fdm, name).get_double_value for name in CONTACTS)
        names = self._fdm.query_property_catalog("param/").split()
        self._param_nodes = {n.removeprefix("param/"): node(self._fdm, n) for n in names if n.startswith("param/")}
        self._params = {name: float(n.get_double_value()) for name, n in self._param_nodes.items()}
        self._steps = 0
        self.reset(seed=0)

    def reset(self, seed: int, yaw_rad: float = 0.0, wind: Wind | None = None) -> None:
        """Stand on the ground at the local origin, motors off, t_s = 0. Parameters stay as they were set."""
        self.place((0.0, 0.0, 0.0), quaternion(0.0, 0.0, yaw_rad), seed, wind)

    def place(
        self, pos_ned_m: Vector, q_ned_frd: F64, seed: int, wind: Wind | None = None, vel_ned_m_s: Vector = (0, 0, 0)
    ) -> None:
        """Like ``reset``, but anywhere, in any attitude and with any velocity: for tests and training."""
        fdm, write = self._fdm, self._set
        roll, pitch, yaw = euler_rad(q_ned_frd)
        radius_m = fdm["inertial/sea-level-radius_ft"] * FT_M
        for name, value in (
            ("lat-geod-deg", math.degrees(pos_ned_m[0] / radius_m)),
            ("long-gc-deg", math.degrees(pos_ned_m[1] / radius_m)),
            ("terrain-elevation-ft", 0.0),
            ("h-sl-ft", (REST_HEIGHT_M - pos_ned_m[2]) / FT_M),
            ("phi-rad", roll),
            ("theta-rad", pitch),
            ("psi-true-rad", yaw),
            ("vn-fps", vel_ned_m_s[0] / FT_M),
            ("ve-fps", vel_ned_m_s[1] / FT_M),
            ("vd-fps", vel_ned_m_s[2] / FT_M),
        ):
            fdm[f"ic/{name}"] = value
        self._blow(Wind())  # a reset steps the turbulence that it finds
        fdm.reset_to_initial_conditions(0)
        write["simulation/randomseed"](1 + seed % _SEEDS)
        write["ap/rest-height-m"](REST_HEIGHT_M)
        self.set_effectiveness((1.0,) * len(ROTORS))
        for name, value in self._params.items():
            self._param_nodes[name].set_double_value(value)
        self._blow(wind or Wind())
        self._steps = 0

    def step(self, n: int = 1) -> None:
        """Advance ``n`` physics steps."""
        run = self._run
        for _ in range(n):
            run()
        self._steps += n

    @property
    def t_s(self) -> float:
        """Vehicle time since reset."""
        return self._steps * self.dt_s

    def truth(self) -> Truth:
        """Read everything at this instant."""
        n, e, d, vn, ve, vd, phi, theta, psi, p, q, r, fx, fy, fz, thrust_lbs = [get() for get in self._get]
        to_acc = LB_N / MASS_KG
        return Truth(
            self.t_s,
            np.array((n * FT_M, e * FT_M, REST_HEIGHT_M - d * FT_M)),
            np.array((vn * FT_M, ve * FT_M, vd * FT_M)),
            quaternion(phi, theta, wrap_rad(psi)),
            np.array((p, q, r)),
            np.array((fx * to_acc, fy * to_acc, fz * to_acc)),
            any(touch() for touch in self._touch),
            thrust_lbs * LB_N / FULL_THRUST_N,
        )

    def loops(self) -> Loops:
        """Read the control loops at this instant."""
        n, e, d, thrust, p, q, r, *rotors = (get() for get in self._loops)
        return Loops(np.array((n, e, d)), thrust, np.array((p, q, r)), tuple(rotors))

    def set_motors(self, armed: bool) -> None:
        """Start (idle speed) or stop the motors."""
        self._set["ap/armed"](float(armed))

    def command_position(
        self,
        pos_ned_m: Vector | None = None,
        vel_ned_m_s: Vector | None = None,
        acc_ned_m_s2: Vector | None = None,
        yaw_rad: float | None = None,
        yaw_rate_rad_s: float = 0.0,
    ) -> None:
        """Follow a trajectory setpoint as PX4 does: each axis of each vector may be absent (NaN; None = all three).

        Velocity and acceleration add to what the loops above them ask for. Without position and velocity an axis
        flies its acceleration alone; with nothing at all, zero acceleration. Without yaw the yaw rate is flown.
        """
        vectors = (_or_absent(pos_ned_m), _or_absent(vel_ned_m_s), _or_absent(acc_ned_m_s2))
        for (set_pos, use_pos, set_vel, use_vel, set_acc), pos, vel, acc in zip(self._axes, *vectors, strict=True):
            has_pos, has_vel = math.isfinite(pos), math.isfinite(vel)
            set_pos(pos if has_pos else 0.0)
            use_pos(float(has_pos))
            set_vel(vel if has_vel else 0.0)
            use_vel(float(has_pos or has_vel))
            set_acc(acc if math.isfinite(acc) else 0.0)
        self._command_yaw(yaw_rad, yaw_rate_rad_s)
        self._set["ap/mode"](ControlMode.POSITION)

    def command_attitude(self, q_ned_frd: F64, thrust_norm: float) -> None:
        """Hold an attitude with a collective thrust (fraction of full thrust)."""
        _finite("attitude", (*q_ned_frd, thrust_norm))
        write = self._set
        for axis, component in zip(AXES, rotation_ned_frd(q_ned_frd)[:, 2], strict=True):
            write[f"sp/z-{axis}"](float(component))
        self._command_yaw(euler_rad(q_ned_frd)[2], 0.0)
        write["sp/thrust"](min(1.0, max(0.0, thrust_norm)))
        write["ap/mode"](ControlMode.ATTITUDE)

    def command_rates(self, rates_frd_rad_s: Vector, thrust_norm: float) -> None:
        """Hold body rates with a collective thrust (fraction of full thrust)."""
        _finite("rates", (*rates_frd_rad_s, thrust_norm))
        write = self._set
        for axis, rate in zip("pqr", rates_frd_rad_s, strict=True):
            write[f"sp/{axis}-rad_s"](float(rate))
        write["sp/thrust"](min(1.0, max(0.0, thrust_norm)))
        write["ap/mode"](ControlMode.RATES)

    def command_motors(self, thrust_norm: Vector) -> None:
        """Thrust of each rotor (4,) as a fraction of its full thrust, past all loops; order as ``aircraft.ROTORS``."""
        _finite("motors", thrust_norm)
        for rotor, thrust in zip(ROTORS, thrust_norm, strict=True):
            self._set[f"sp/motor-{rotor}"](min(1.0, max(0.0, float(thrust))))
        self._set["ap/mode"](ControlMode.MOTORS)

    def mount_rotors(self, pos_frd_m: Sequence[tuple[float, float]]) -> None:
        """Put the rotors elsewhere (4, 2: forward, right), for good; order as ``aircraft.ROTORS``."""
        for rotor, (forward_m, right_m) in zip(ROTORS, pos_frd_m, strict=True):
            _finite("rotor position", (forward_m, right_m))
            place = f"external_reactions/rotor_{rotor}/location"
            self._set[f"{place}-x-in"](-forward_m / IN_M)  # JSBSim's structural frame: x aft
            self._set[f"{place}-y-in"](right_m / IN_M)

    def set_effectiveness(self, share: Vector) -> None:
        """Share of its thrust that each rotor gives (4,); order as ``aircraft.ROTORS``, until the next reset."""
        for rotor, value in zip(ROTORS, share, strict=True):
            self._set[f"rotor/effectiveness-{rotor}"](min(1.0, max(0.0, float(value))))

    def blow(self, mean_ned_m_s: Vector) -> None:
        """Change the mean wind; turbulence stays as it is."""
        _finite("wind", mean_ned_m_s)
        for axis, speed in zip(("north", "east", "down"), mean_ned_m_s, strict=True):
            self._set[f"atmosphere/wind-{axis}-fps"](speed / FT_M)

    def command_idle(self) -> None:
        """No control: armed motors idle, integrators rest at zero."""
        self._set["ap/mode"](ControlMode.IDLE)

    @property
    def parameters(self) -> dict[str, float]:
        """PX4 parameters that the loops obey, by name."""
        return dict(self._params)

    def set_parameter(self, name: str, value: float) -> None:
        """Change a PX4 parameter now and for all resets to come. Raises KeyError or ValueError naming it."""
        if name not in self._params:
            raise KeyError(f"unknown vehicle parameter '{name}'{nearest(name, list(self._params))}")
        _finite(f"parameter '{name}'", (value,))
        self._params[name] = float(value)
        self._param_nodes[name].set_double_value(float(value))

    def _command_yaw(self, yaw_rad: float | None, yaw_rate_rad_s: float) -> None:
        has_yaw = yaw_rad is not None and math.isfinite(yaw_rad)
        self._set["sp/yaw-rad"](yaw_rad if yaw_rad is not None and has_yaw else 0.0)
        self._set["use/yaw"](float(has_yaw))
        self._set["sp/yaw-rate-rad_s"](yaw_rate_rad_s if math.isfinite(yaw_rate_rad_s) else 0.0)

    def _blow(self, wind: Wind) -> None:
        write = self._set
        self.blow(wind.mean_ned_m_s)
        write["atmosphere/turb-type"](_MILSPEC if wind.turbulence else 0.0)
        write[f"{TURBULENCE}/windspeed_at_20ft_AGL-fps"](wind.turbulence.w20_m_s / FT_M)
        write[f"{TURBULENCE}/severity"](float(wind.turbulence))


def _or_absent(vector: Vector | None) -> Vector:
    return ABSENT if vector is None else vector


def _finite(what: str, values: Vector) -> None:
    if not all(math.isfinite(value) for value in values):
        raise ValueError(f"{what} must be finite, got {[float(value) for value in values]}")
