"""How much charge is left? Drawn by the thrust that the rotors give; time comes with every call."""

from typing import Final

HOVER_ENDURANCE_S: Final = 31 * 60.0  # hover time of the Mavic 2 Pro on one charge, data sheet
HOVER_THRUST_NORM: Final = 0.4539  # mavic2pro.xml: weight over full thrust
POWER_EXPONENT: Final = 1.5  # momentum theory: power over thrust
IDLE_SHARE: Final = 0.05  # assumed: electronics and idling rotors, share of hover power


class Battery:
    """Charge as a fraction of full."""

    def __init__(self) -> None:
        self.remaining = 1.0

    def draw(self, dt_s: float, thrust_norm: float, armed: bool, least: float = 0.0) -> None:
        """Time has passed with this much thrust; it draws no more once only ``least`` is left."""
        if not armed:
            return
        power = max(IDLE_SHARE, (max(thrust_norm, 0.0) / HOVER_THRUST_NORM) ** POWER_EXPONENT)
        left = self.remaining - power * dt_s / HOVER_ENDURANCE_S
        self.remaining = max(0.0, left, min(least, self.remaining))
