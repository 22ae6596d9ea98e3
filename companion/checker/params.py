"""Which figures rule the trajectory checker?"""

from dataclasses import dataclass

from companion.core.params import param


@dataclass(frozen=True, slots=True)
class CheckerParams:
    """Margins, bounds of the correction, weights of the score."""

    margin_full_m: float = param(0.20, "CHK_MARGIN_FULL", "margin asked for first", "m", 0.0, 2.0)
    margin_reduced_m: float = param(
        0.10, "CHK_MARGIN_RED", "margin in force if nothing passes the first", "m", 0.0, 2.0
    )
    margin_least_m: float = param(
        0.05, "CHK_MARGIN_LEAST", "margin in force if nothing passes the second", "m", 0.0, 2.0
    )
    recheck_share: float = param(
        0.4, "CHK_RECHECK", "share of the margin in force that must last in flight", "", 0.0, 1.0
    )
    shift_max_m: float = param(1.2, "CHK_SHIFT_MAX", "farthest sideways correction of a waypoint", "m", 0.0, 5.0)
    escape_least_m: float = param(0.5, "CHK_ESCAPE_LEAST", "shortest escape worth flying", "m", 0.05, 5.0)
    clearance_full_m: float = param(0.8, "CHK_CLEAR_FULL", "clearance that scores full", "m", 0.05, 5.0)
    weight_clearance: float = param(1.0, "CHK_W_CLEAR", "weight of clearance in the score", "", 0.0, 10.0)
    weight_curvature: float = param(0.5, "CHK_W_CURV", "weight of turning in the score", "", 0.0, 10.0)
    weight_progress: float = param(1.0, "CHK_W_PROGRESS", "weight of progress in the score", "", 0.0, 10.0)

    def margins_m(self) -> tuple[float, ...]:
        """The declared margin levels, widest first."""
        levels = {self.margin_full_m, self.margin_reduced_m, self.margin_least_m}
        return tuple(sorted(levels, reverse=True))

    def recheck_radius_m(self, radius_m: float, margin_m: float) -> float:
        """Radius at which an accepted path must stay free in flight: less than accepted, or noise would refuse it."""
        return radius_m + self.recheck_share * margin_m
