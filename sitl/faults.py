"""What is broken, how badly and when? Faults by name, from the command line, a mission file or MAVLink; pure.

A fault is written ``NAME[=VALUE][@START[..END]]``, times in vehicle seconds: ``gps_off@30..45``, ``motor2=0.5@20``,
``position_drift=1.5``. Nothing is broken unless it is asked for.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from companion.core.params import nearest

# Name: (value when none is given, unit, text). Drifts are random walks, noises standard deviations.
FAULTS: Final[Mapping[str, tuple[float, str, str]]] = {
    "position_drift": (1.0, "m/min", "the estimated position walks off, rms after a minute"),
    "baro_drift": (0.5, "m/min", "the estimated height walks off, rms after a minute"),
    "velocity_noise": (0.05, "m/s", "noise of the estimated velocity"),
    "gyro_noise": (0.01, "rad/s", "noise of the body rates"),
    "accel_noise": (0.1, "m/s2", "noise of the accelerometer"),
    "attitude_noise": (0.2, "deg", "noise of the estimated roll, pitch and yaw"),
    "gps_off": (1.0, "", "no GPS: the estimate coasts, and is lost after five seconds"),
    "gps_stuck": (1.0, "", "GPS repeats its last fix: rejected, as if it were off"),
    "baro_off": (1.0, "", "no barometer: height goes on by GPS"),
    "mag_off": (1.0, "", "no magnetometer: heading goes on by gyroscope"),
    "gyro_off": (1.0, "", "no gyroscope: no attitude estimate, no position"),
    "accel_off": (1.0, "", "no accelerometer: no attitude estimate, no position"),
    "gcs_off": (1.0, "", "nothing is heard from the ground station"),
    "battery": (0.05, "", "charge left, fraction of full; set once"),
    "wind_north": (5.0, "m/s", "additional wind towards north"),
    "wind_east": (5.0, "m/s", "additional wind towards east"),
    "gusts": (2.0, "m/s", "gusts of both horizontal axes, standard deviation"),
    **{f"motor{n}": (0.0, "", f"share of its thrust that motor {n} gives") for n in range(1, 5)},
}
MOTORS: Final = ("motor1", "motor2", "motor3", "motor4")
SENSORS_OFF: Final = ("gps_off", "gps_stuck", "baro_off", "mag_off", "gyro_off", "accel_off")
_SPEC: Final = re.compile(r"(?P<name>\w+)(=(?P<value>[^@]+))?(@(?P<start>[^.@]+(\.\d+)?)(\.\.(?P<end>.+))?)?")


@dataclass(frozen=True, slots=True)
class Fault:
    """One entry of a schedule."""

    name: str
    value: float
    start_s: float = 0.0
    end_s: float = math.inf


def parse(spec: str) -> Fault:
    """A fault as people write it. Raises ValueError naming what is wrong."""
    match = _SPEC.fullmatch(spec.strip())
    if match is None:
        raise ValueError(f"fault '{spec}': NAME[=VALUE][@START[..END]] is wanted")
    name = match["name"]
    if name not in FAULTS:
        raise ValueError(f"fault '{name}' is unknown{nearest(name, list(FAULTS))}")
    value = FAULTS[name][0] if match["value"] is None else _number(spec, match["value"])
    start_s = 0.0 if match["start"] is None else _number(spec, match["start"])
    end_s = math.inf if match["end"] is None else _number(spec, match["end"])
    if value < 0.0 and not name.startswith("wind"):
        raise ValueError(f"fault '{spec}': a value below 0 makes no sense")
    if name in (*MOTORS, "battery") and value > 1.0:
        raise ValueError(f"fault '{spec}': the value is a fraction, 0 to 1")
    if not 0.0 <= start_s < end_s:
        raise ValueError(f"fault '{spec}': it would end before it starts")
    return Fault(name, value, start_s, end_s)


class FaultBook:
    """What is broken at an instant: the schedule, and on top of it what was injected at run time."""

    def __init__(self, specs: Sequence[str] = ()) -> None:
        """Raises ValueError naming a fault that is none."""
        self._schedule = tuple(parse(spec) for spec in specs)
        self._injected: dict[str, float | None] = {}  # None: put right again

    @property
    def quiet(self) -> bool:
        """Has there never been anything?"""
        return not self._schedule and not self._injected

    def inject(self, name: str, value: float | None) -> None:
        """From now on; None ends the fault, whatever the schedule says."""
        self._injected[name] = value

    def at(self, t_s: float) -> dict[str, float]:
        """Values of all faults in force, by name."""
        active = {f.name: f.value for f in self._schedule if f.start_s <= t_s < f.end_s}
        for name, value in self._injected.items():
            active.pop(name, None)
            if value is not None:
                active[name] = value
        return active


def _number(spec: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"fault '{spec}': '{text}' is no number")
    return value
