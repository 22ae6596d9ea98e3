"""Which tunables does the companion have? Every group in one value; the full set goes into every log."""

from dataclasses import dataclass, field

from companion.arbiter.facts import ArbiterParams
from companion.checker.params import CheckerParams
from companion.core.gridmap import MapParams
from companion.core.params import param
from companion.guidance.follower import FollowerParams
from companion.guidance.landing import LandingParams
from companion.guidance.limits import LimitsParams
from companion.guidance.line import LineParams
from companion.guidance.yielding import YieldParams
from companion.link.lidar_params import LidarParams
from companion.link.params import LinkParams
from companion.perception.movers import MoverParams
from companion.perception.perceive import PerceptionParams
from companion.policy.expert import ExpertParams, GeometricExpert


@dataclass(frozen=True, slots=True)
class VehicleParams:
    """The vehicle profile."""

    radius_m: float = param(0.33, "SN_RADIUS", "Radius of the vehicle's disc, rotors included", "m", 0.05, 2.0)
    corridor_m: float = param(0.10, "SN_CORRIDOR", "Margin of the corridor that the speed clamp looks along", "m", 0, 1)
    yaw_rate_rad_s: float = param(1.2, "SN_YAW_RATE", "How fast the nose turns into the course", "rad/s", 0.0, 4.0)


@dataclass(frozen=True, slots=True)
class PolicyParams:
    """Who proposes waypoints in RL mode, and how often it is asked."""

    name: str = param("geometric", "SN_POLICY", "Policy that proposes waypoints")
    guard: bool = param(True, "SN_PO_GUARD", "A learned policy's path is flown only while the expert's is no better")
    guard_ratio: float = param(
        0.95, "SN_PO_G_RATIO", "Share of the time of the expert's way that the policy's may take", "", 0.5, 3.0
    )
    horizon_s: float = param(0.4, "SN_PO_HORIZON", "The expert plans a path older than this anew", "s", 0.05, 10.0)
    learned_horizon_s: float = param(3.0, "SN_PO_L_HORIZON", "The same for a learned policy", "s", 0.05, 10.0)
    retry_s: float = param(0.2, "SN_PO_RETRY", "Least time between two decisions", "s", 0.0, 5.0)
    used_up_m: float = param(
        1.0, "SN_PO_USED_UP", "The expert's path with less than this left is used up", "m", 0.1, 10
    )
    learned_used_up_m: float = param(2.0, "SN_PO_L_USED_UP", "The same for a learned policy", "m", 0.1, 10.0)
    learned_run_out_m: float = param(
        4.0,
        "SN_PO_L_RUN_OUT",
        "A learned policy's path is flown as if it went straight on, where that is free",
        "m",
        0,
        10,
    )
    lead_s: float = param(0.4, "SN_PO_LEAD", "A new path leaves the old one this far ahead", "s", 0.0, 2.0)
    rejoin_m: float = param(0.4, "SN_PO_REJOIN", "Farther off the old path than this, plan from the vehicle", "m", 0, 3)

    def wear(self, guarded: bool) -> tuple[float, float, float]:
        """Age in s and length left in m at which a path is due to be replaced, and the run-out in m beyond its end."""
        if guarded or self.name == GeometricExpert.name:
            return self.horizon_s, self.used_up_m, 0.0
        return self.learned_horizon_s, self.learned_used_up_m, self.learned_run_out_m


@dataclass(frozen=True, slots=True)
class TightParams:
    """When another set of parameters flies."""

    profile: str = param("tight", "SN_TI_PROFILE", "Profile that flies where it is tight; empty: none does")
    radius_m: float = param(3.0, "SN_TI_RADIUS", "Density counts bearings blocked within this", "m", 0.5, 30.0)
    density_enter: float = param(0.5, "SN_TI_ENTER", "Density from which it is tight", "", 0.0, 1.0)
    density_exit: float = param(0.3, "SN_TI_EXIT", "Density up to which it is open again", "", 0.0, 1.0)
    dwell_s: float = param(2.0, "SN_TI_DWELL", "Least time between two changes", "s", 0.1, 60.0)
    vain_s: float = param(
        8.0, "SN_TI_VAIN", "The set flies at most so long without coming nearer to the goal", "s", 1.0, 300.0
    )
    again_s: float = param(20.0, "SN_TI_AGAIN", "Then that of the open alone for so long", "s", 0.0, 600.0)
    calm_m_s2: float = param(
        0.15, "SN_TI_CALM", "Push of the wind from which margins stay as in the open", "m/s^2", 0.0, 10.0
    )
    drag_1_s: float = param(0.12, "SN_TI_DRAG", "Deceleration by still air at 1 m/s", "1/s", 0.0, 2.0)


@dataclass(frozen=True, slots=True)
class Params:
    """All of it."""

    vehicle: VehicleParams = field(default_factory=VehicleParams)
    link: LinkParams = field(default_factory=LinkParams)
    lidar: LidarParams = field(default_factory=LidarParams)
    perception: PerceptionParams = field(default_factory=PerceptionParams)
    map: MapParams = field(default_factory=MapParams)
    movers: MoverParams = field(default_factory=MoverParams)
    arbiter: ArbiterParams = field(default_factory=ArbiterParams)
    tight: TightParams = field(default_factory=TightParams)
    policy: PolicyParams = field(default_factory=PolicyParams)
    expert: ExpertParams = field(default_factory=ExpertParams)
    checker: CheckerParams = field(default_factory=CheckerParams)
    line: LineParams = field(default_factory=LineParams)
    follower: FollowerParams = field(default_factory=FollowerParams)
    limits: LimitsParams = field(default_factory=LimitsParams)
    landing: LandingParams = field(default_factory=LandingParams)
    yielding: YieldParams = field(default_factory=YieldParams)

    def __hash__(self) -> int:
        """Of three groups, and so quick: every tick looks up what belongs to its set."""
        return hash((self.vehicle, self.map, self.policy))
