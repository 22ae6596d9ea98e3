"""Which rotor is which to a real PX4, and where does it believe them to be? Airframes by name; pure.

PX4 turns torques into motor commands with the rotor positions of its airframe file. Where these disagree with the
aircraft's, one axis acts on another; so the aircraft's rotors are put at PX4's positions, shrunk to their own size.
"""

from dataclasses import dataclass
from typing import Final

from sitl.aircraft import ROTORS

ARM_M: Final = 0.1252  # of each rotor, forward and right (mavic2pro.xml)


@dataclass(frozen=True, slots=True)
class Airframe:
    """PX4's view of the rotors, in PX4's order: CA_ROTORn_PX and _PY, and the place on our aircraft."""

    name: str
    autostart: int  # SYS_AUTOSTART
    pos_frd_m: tuple[tuple[float, float], ...]  # (4, 2) forward, right
    rotors: tuple[str, ...]  # names as ``aircraft.ROTORS``; their turning directions are the aircraft's

    def own_positions(self) -> list[tuple[float, float]]:
        """Places (4, 2) on the aircraft in the order of ``aircraft.ROTORS``: PX4's, with the aircraft's mean arms."""
        forward = ARM_M * len(ROTORS) / sum(abs(x) for x, _ in self.pos_frd_m)
        right = ARM_M * len(ROTORS) / sum(abs(y) for _, y in self.pos_frd_m)
        places = dict(zip(self.rotors, self.pos_frd_m, strict=True))
        return [(places[rotor][0] * forward, places[rotor][1] * right) for rotor in ROTORS]

    def own_order(self, controls: list[float]) -> list[float]:
        """PX4's motor outputs (at least 4) as thrusts in the order of ``aircraft.ROTORS``."""
        thrusts = dict(zip(self.rotors, controls, strict=False))
        return [thrusts[rotor] for rotor in ROTORS]


# Rotors 0 and 1 have CA_ROTORn_KM 0.05: counter-clockwise from above, as our front right and rear left.
NONE_IRIS: Final = Airframe(
    name="none_iris",
    autostart=10016,
    pos_frd_m=((0.1515, 0.245), (-0.1515, -0.1875), (0.1515, -0.245), (-0.1515, 0.1875)),
    rotors=("fr", "rl", "fl", "rr"),
)
