"""What does one scan add, and what follows from it? Map, d_min, S_fuzzy, density, line of sight; pure; local NED."""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.frames import yaw_rad
from companion.core.geometry import swept_free_length
from companion.core.gridmap import AZIMUTH_DIR, GridMap, MapParams, occupied_points, update
from companion.core.inputs import Inputs
from companion.core.params import param
from companion.core.types import F64, VehicleState
from companion.perception.movers import MoverParams, Track, avoidable, discs, follow, hazards
from companion.perception.noise import entered
from companion.perception.observation import nearest_representatives
from companion.perception.polar import BEARING_RAD, flatten
from companion.perception.score import local_density, safety_score
from companion.perception.threats import follow_seen


@dataclass(frozen=True, slots=True)
class PerceptionParams:
    """From ranges to facts."""

    sense_radius_m: float = param(20.0, "SN_PC_RADIUS", "Sensing radius R of d_min (eq. dmin)", "m", 1.0, 60.0)
    near_m: float = param(2.0, "SN_PC_NEAR", "Range of membership 0 (eq. membership)", "m", 0.1, 20.0)
    far_m: float = param(10.0, "SN_PC_FAR", "Range of membership 1 (eq. membership)", "m", 0.5, 60.0)
    lidar_up_m: float = param(0.1, "SN_PC_LIDAR_UP", "Height of the LiDAR above the autopilot's position", "m", -1, 2)
    ground_margin_m: float = param(
        0.4, "SN_PC_GROUND", "Returns lower than this above ground are the ground", "m", 0, 3
    )
    sight_m: float = param(12.0, "SN_PC_SIGHT", "Line of sight looks this far towards the goal at most", "m", 1.0, 50.0)
    sight_margin_m: float = param(0.3, "SN_PC_SIGHT_W", "Free width beyond the radius that sight needs", "m", 0.0, 3.0)
    density_radius_m: float = param(8.0, "SN_PC_DENS_R", "Density counts bearings blocked within this", "m", 1.0, 30.0)
    density_open: float = param(0.25, "SN_PC_DENS_LO", "Density up to which nothing is scaled", "", 0.0, 1.0)
    density_tight: float = param(0.80, "SN_PC_DENS_HI", "Density from which the scale is least", "", 0.0, 1.0)
    scale_min: float = param(
        0.5, "SN_PC_SCALE", "Least scale of thresholds and membership (1: schedule off)", "", 0.1, 1
    )
    unbias: float = param(
        0.0, "SN_PC_UNBIAS", "Sector minima are taken back by so many sigma of a ray, as scans show it", "", 0.0, 2.0
    )
    refute: float = param(
        0.0, "SN_PC_REFUTE", "A hit that a scan looks past by so many sigma is dropped (0: with its cell)", "", 0, 10
    )


@dataclass(frozen=True, slots=True)
class Percept:
    """What the rest of the tick knows of the surroundings."""

    grid: GridMap
    tracks: tuple[Track, ...]  # of what moves
    static_ne_m: F64  # (k, 2) remembered hits
    hazard_ne_m: F64  # (h, 2) what movers will sweep within the look-ahead
    points_ne_m: F64  # (p, 2) hits, and hazards that do not hold the vehicle already: what no path may touch
    bearing_range_m: F64  # (72,) of this scan, at fixed bearings off the nose
    d_min_m: float  # inf when nothing is within the sensing radius
    s_fuzzy: float
    density: float
    scale: float  # of thresholds and membership bounds (sensitivity schedule)
    line_of_sight: bool


@dataclass(frozen=True, slots=True)
class Remembered:
    """What perception carries from scan to scan."""

    t_s: float
    grid: GridMap
    tracks: tuple[Track, ...]
    ground_down_m: float = 0.0  # height of the ground in local NED


def perceive(
    before: Remembered,
    inputs: Inputs,
    goal_ne_m: F64,
    radius_m: float,
    params: PerceptionParams,
    map_params: MapParams,
    mover_params: MoverParams,
) -> Percept:
    """Digest one scan."""
    state, pos_ne_m = inputs.state, inputs.state.pos_ned_m[:2]
    flat = flatten(inputs.scan, state, params.lidar_up_m + before.ground_down_m, params.ground_margin_m)
    if params.unbias > 0.0 or params.refute > 0.0:
        grid = entered(before.grid, flat.polar, params.unbias, params.refute, map_params)
    else:
        grid = update(before.grid, flat.polar, map_params)
    dt_s = state.t_s - before.t_s
    if mover_params.again_m > 0.0:
        seen_ne_m = AZIMUTH_DIR.take(flat.polar.hit_bin, axis=0) * flat.polar.hit_m[:, None] + pos_ne_m
        tracks = follow_seen(before.tracks, grid.moved_ne_m, seen_ne_m, pos_ne_m, state.t_s, dt_s, mover_params)
    else:
        tracks = follow(before.tracks, grid.moved_ne_m, pos_ne_m, state.t_s, dt_s, mover_params)
    static, swept = occupied_points(grid, state.t_s, map_params), hazards(tracks, mover_params)
    points, hazard = static, swept
    if len(swept):
        points = np.concatenate([static, discs(avoidable(swept, pos_ne_m, radius_m, mover_params), mover_params)])
        hazard = discs(swept, mover_params)
    density = local_density(flat.bearing_range_m, params.density_radius_m)
    scale = sensitivity(density, params)
    score = safety_score(flat.bearing_range_m, params.near_m * scale, params.far_m * scale)
    seen_m = flat.polar.hit_m
    d_min = float(seen_m.min()) if seen_m.size else math.inf
    return Percept(
        grid,
        tracks,
        static,
        hazard,
        points,
        flat.bearing_range_m,
        d_min if d_min <= params.sense_radius_m else math.inf,
        score,
        density,
        scale,
        line_of_sight(pos_ne_m, goal_ne_m, points, radius_m, params),
    )


def sensitivity(density: float, params: PerceptionParams) -> float:
    """Scale in [scale_min, 1] by which denser surroundings shrink thresholds and membership bounds."""
    share = (density - params.density_open) / max(params.density_tight - params.density_open, 1e-6)
    return 1.0 - (1.0 - params.scale_min) * min(max(share, 0.0), 1.0)


def line_of_sight(pos_ne_m: F64, goal_ne_m: F64, points_ne_m: F64, radius_m: float, params: PerceptionParams) -> bool:
    """Is a corridor as wide as the vehicle plus margin free along the ray to the goal, or to ``sight_m``?"""
    (north, east), (goal_north, goal_east) = pos_ne_m.tolist(), goal_ne_m.tolist()
    distance = math.hypot(goal_north - north, goal_east - east)
    if distance < 1e-6:
        return True
    reach = min(distance, params.sight_m)
    share = reach / distance
    ray = np.array([[north, east], [north + share * (goal_north - north), east + share * (goal_east - east)]])
    return swept_free_length(ray, points_ne_m, radius_m + params.sight_margin_m) >= reach - 1e-9


def representatives(bearing_range_m: F64, state: VehicleState, radius_m: float) -> F64:
    """(<= 20, 2) one point per fixed bearing with a hit, the nearest first."""
    pos = state.pos_ned_m[:2]
    hit = np.isfinite(bearing_range_m)
    azimuth = BEARING_RAD[hit] + yaw_rad(state.q_ned_frd)
    points = pos + np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1) * bearing_range_m[hit][:, None]
    return nearest_representatives(points, pos, radius_m)
