"""How far does each ray of a tilted planar sweep go? Compiled; pure; ranges are slant ranges in the body plane.

Culling: an obstacle is tested only against the rays between its two tangent bearings, found in the body plane, so the
cost goes with what is visible and not with rays x obstacles.
"""

import math

import numpy as np

from companion.core.types import F64
from sitl.compiled import compiled

EDGE_ON = 1e-6  # cosine of the tilt below which the sweep is vertical and bearings no longer order the rays
INDEX_SLACK = 1e-6  # rays; a ray that grazes an obstacle's edge is tested rather than missed
IRWIN_HALL_SCALE = math.sqrt(3.0) / 65536.0  # the sum of four 16-bit uniforms has sigma 65536 / sqrt(3)

Frame = tuple[float, float, float, float, float, float]  # forward and right axis of the body, each north, east, down


@compiled
def cast_rays(
    pos_ned_m: F64, q_ned_frd: F64, circles: F64, boxes: F64, cos_sin: F64, range_max_m: float, range_m: F64
) -> None:
    """Write the true range of every ray into ``range_m`` (rays,); inf where nothing stands within ``range_max_m``.

    ``circles`` (n, 4) north, east, radius, height; ``boxes`` (b, 7) north, east, cos yaw, sin yaw, half length, half
    width, height; ``cos_sin`` (rays, 2) of the body bearings 0, 1, 2, ... times 2 pi / rays.
    """
    rays = cos_sin.shape[0]
    w, x, y, z = q_ned_frd[0], q_ned_frd[1], q_ned_frd[2], q_ned_frd[3]
    fn, fe, fd = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)
    rn, re, rd = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    frame = (fn, fe, fd, rn, re, rd)
    up_m = max(0.0, -pos_ned_m[2])
    for i in range(rays):
        down = fd * cos_sin[i, 0] + rd * cos_sin[i, 1]
        ground_m = up_m / down if down > 0.0 else math.inf
        range_m[i] = ground_m if ground_m <= range_max_m else math.inf
    for k in range(circles.shape[0]):
        _cast_at_circle(pos_ned_m, up_m, frame, circles[k], cos_sin, range_max_m, range_m)
    for k in range(boxes.shape[0]):
        _cast_at_box(pos_ned_m, up_m, frame, boxes[k], cos_sin, range_max_m, range_m)


@compiled
def _cast_at_circle(
    pos_ned_m: F64, up_m: float, frame: Frame, circle: F64, cos_sin: F64, range_max_m: float, range_m: F64
) -> None:
    fn, fe, fd, rn, re, rd = frame
    north, east, radius = circle[0] - pos_ned_m[0], circle[1] - pos_ned_m[1], circle[2]
    outside = north * north + east * east - radius * radius
    reach = range_max_m + radius
    if outside + radius * radius > reach * reach:
        return
    rays = cos_sin.shape[0]
    first, count = 0, rays
    if outside > 0.0:
        tangent = math.sqrt(outside)
        first, count = _ray_interval(
            frame,
            north * tangent + east * radius,
            east * tangent - north * radius,
            north * tangent - east * radius,
            east * tangent + north * radius,
            rays,
        )
    for j in range(first, first + count):
        i = j if j < rays else j - rays
        c, s = cos_sin[i, 0], cos_sin[i, 1]
        dn, de = fn * c + rn * s, fe * c + re * s
        flat = dn * dn + de * de
        along = north * dn + east * de
        disc = along * along - flat * outside
        if disc < 0.0 or flat == 0.0:
            continue
        root = math.sqrt(disc)
        near, far = (along - root) / flat, (along + root) / flat
        _keep_nearest(i, near, far, fd * c + rd * s, up_m, circle[3], range_max_m, range_m)


@compiled
def _cast_at_box(
    pos_ned_m: F64, up_m: float, frame: Frame, box: F64, cos_sin: F64, range_max_m: float, range_m: F64
) -> None:
    fn, fe, fd, rn, re, rd = frame
    north, east, cy, sy, hl, hw = box[0] - pos_ned_m[0], box[1] - pos_ned_m[1], box[2], box[3], box[4], box[5]
    reach = range_max_m + hl + hw
    if north * north + east * east > reach * reach:
        return
    rays = cos_sin.shape[0]
    px, py = -(north * cy + east * sy), north * sy - east * cy  # the sensor in the frame of the box
    first, count = 0, rays
    if abs(px) > hl or abs(py) > hw:
        first, count = _box_interval(frame, north, east, cy, sy, hl, hw, rays)
    for j in range(first, first + count):
        i = j if j < rays else j - rays
        c, s = cos_sin[i, 0], cos_sin[i, 1]
        dn, de = fn * c + rn * s, fe * c + re * s
        near_x, far_x = _slab(px, dn * cy + de * sy, hl)
        near_y, far_y = _slab(py, de * cy - dn * sy, hw)
        near, far = max(near_x, near_y), min(far_x, far_y)
        if near <= far:
            _keep_nearest(i, near, far, fd * c + rd * s, up_m, box[6], range_max_m, range_m)


@compiled
def _slab(offset: float, direction: float, half: float) -> tuple[float, float]:
    """Interval of ray parameter inside |coordinate| <= half."""
    if direction == 0.0:
        return (-math.inf, math.inf) if abs(offset) <= half else (math.inf, -math.inf)
    a, b = (-half - offset) / direction, (half - offset) / direction
    return (a, b) if a < b else (b, a)


@compiled
def _keep_nearest(
    i: int, near: float, far: float, down: float, up_m: float, height_m: float, range_max_m: float, range_m: F64
) -> None:
    """Enter the upright column between ``near`` and ``far``: through its side, or down through its top."""
    if far < 0.0:
        return
    near = max(near, 0.0)
    if up_m - down * near > height_m:
        if up_m - down * far > height_m:
            return
        near = (up_m - height_m) / down
    if near <= range_max_m and near < range_m[i]:
        range_m[i] = near


@compiled
def _box_interval(
    frame: Frame, north: float, east: float, cy: float, sy: float, hl: float, hw: float, rays: int
) -> tuple[int, int]:
    """Rays between the left-most and the right-most corner as seen from outside the box."""
    lo_n = lo_e = hi_n = hi_e = 0.0
    for k in range(4):
        along = hl if k < 2 else -hl
        across = hw if k % 2 == 0 else -hw
        n, e = north + along * cy - across * sy, east + along * sy + across * cy
        if k == 0 or lo_n * e - lo_e * n < 0.0:
            lo_n, lo_e = n, e
        if k == 0 or hi_n * e - hi_e * n > 0.0:
            hi_n, hi_e = n, e
    return _ray_interval(frame, lo_n, lo_e, hi_n, hi_e, rays)


@compiled
def _ray_interval(frame: Frame, lo_n: float, lo_e: float, hi_n: float, hi_e: float, rays: int) -> tuple[int, int]:
    """First ray and number of rays whose horizontal bearing lies clockwise between two directions < pi apart."""
    fn, fe, _, rn, re, _ = frame
    upright = fn * re - fe * rn
    if abs(upright) < EDGE_ON:
        return 0, rays
    if upright < 0.0:  # upside down: the sweep turns the other way
        lo_n, lo_e, hi_n, hi_e = hi_n, hi_e, lo_n, lo_e
    per_ray = 2.0 * math.pi / rays
    sign = 1.0 if upright > 0.0 else -1.0
    lo = math.atan2(sign * (fn * lo_e - fe * lo_n), sign * (re * lo_n - rn * lo_e)) / per_ray
    hi = math.atan2(sign * (fn * hi_e - fe * hi_n), sign * (re * hi_n - rn * hi_e)) / per_ray
    if hi < lo:
        hi += rays
    first = math.ceil(lo - INDEX_SLACK)
    count = min(rays, math.floor(hi + INDEX_SLACK) - first + 1)
    return first % rays, count


@compiled
def measure(
    true_m: F64, key: np.uint64, sigma_m: float, dropout: float, range_min_m: float, range_max_m: float
) -> None:
    """Turn true ranges into measured ones in place: noise on hits, dropped rays nan. ``key`` names the scan."""
    for i in range(true_m.shape[0]):
        bits = _mix(key + np.uint64(2 * i))
        if dropout > 0.0 and np.float64(_mix(key + np.uint64(2 * i + 1)) >> np.uint64(11)) < dropout * 2.0**53:
            true_m[i] = math.nan
        elif true_m[i] <= range_max_m:
            measured = max(range_min_m, true_m[i] + sigma_m * _near_gaussian(bits))
            true_m[i] = measured if measured <= range_max_m else math.inf


@compiled
def _near_gaussian(bits: np.uint64) -> float:
    """Zero mean, unit sigma: Irwin-Hall of four 16-bit uniforms, within 3.5 sigma."""
    low = np.uint64(0xFFFF)
    total = (bits & low) + ((bits >> np.uint64(16)) & low) + ((bits >> np.uint64(32)) & low) + (bits >> np.uint64(48))
    return (np.float64(total) - 131070.0) * IRWIN_HALL_SCALE


@compiled
def _mix(value: np.uint64) -> np.uint64:
    """splitmix64 finaliser: 64 independent-looking bits from a counter."""
    value = value * np.uint64(0x9E3779B97F4A7C15)
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))


@compiled
def sector_minima(ray_m: F64, first_ray: int, sector_m: F64) -> None:
    """Sector ``i`` takes the nearest of its rays that were not dropped; nan only if all were."""
    rays = ray_m.shape[0]
    width = rays // sector_m.shape[0]
    for i in range(sector_m.shape[0]):
        nearest = math.nan
        for j in range(width):
            value = ray_m[(first_ray + i * width + j) % rays]
            if value < nearest or math.isnan(nearest):
                nearest = value
        sector_m[i] = nearest
