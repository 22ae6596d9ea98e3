"""What does the planar LiDAR report from here? One sweep as 72 sector minima; a pure function of time, pose and seed.

Rays lie in the body plane, so a tilted sweep sees the ground and passes over what is low. Noise and dropouts are keyed
by (seed, scan index), and the index follows from ``t_s``: a scan does not depend on the scans before it.
"""

import math
from dataclasses import dataclass

import numpy as np

from companion.core.types import F64, Scan
from sitl.lidar_kernel import cast_rays, measure, sector_minima
from sitl.world import World

DITHER = (0.0, 0.4, 0.8, 0.2, 0.6)  # of a sector, from scan to scan: 0, 2, 4, 1, 3 deg at 5 deg


@dataclass(frozen=True, slots=True)
class LidarParams:
    """The sensor. ``rays`` is a multiple of ``sectors``; ``latency_s`` is for whoever delivers the scan."""

    rays: int = 360
    sectors: int = 72
    rate_hz: float = 25.0
    range_min_m: float = 0.1
    range_max_m: float = 30.0
    sigma_m: float = 0.01
    dropout: float = 0.0  # chance of a ray to return nothing usable
    latency_s: float = 0.0
    mount_up_m: float = 0.1  # above the vehicle's position; assumed, as of a sensor on top of the hull
    dither: bool = True

    def __post_init__(self) -> None:
        if self.sectors < 1 or self.rays % self.sectors:
            raise ValueError(f"LiDAR: {self.rays} rays do not divide into {self.sectors} sectors")
        if not 0.0 <= self.dropout <= 1.0:
            raise ValueError(f"LiDAR: dropout {self.dropout} is outside [0, 1]")
        if not 0.0 <= self.sigma_m < math.inf:
            raise ValueError(f"LiDAR: sigma_m {self.sigma_m} is not a sigma")
        if not 0.0 < self.rate_hz < math.inf:
            raise ValueError(f"LiDAR: rate_hz {self.rate_hz} is not a rate")
        if not 0.0 <= self.range_min_m < self.range_max_m:
            raise ValueError(f"LiDAR: range_min_m {self.range_min_m} is not below range_max_m {self.range_max_m}")


class Lidar:
    """A LiDAR in one world: nothing in it changes from scan to scan."""

    def __init__(self, world: World, params: LidarParams | None = None, seed: int = 0) -> None:
        self.params = params or LidarParams()
        self._world = world
        self._key = np.random.SeedSequence(seed).generate_state(1, np.uint64)[0]
        self._boxes = _kernel_boxes(world.boxes)
        bearing_rad = np.arange(self.params.rays) * (math.tau / self.params.rays)
        self._cos_sin = np.stack([np.cos(bearing_rad), np.sin(bearing_rad)], axis=1)
        self.scan(0.0, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))  # compile now, not in the first flight tick

    def scan(self, t_s: float, pos_world_ned_m: F64, q_ned_frd: F64, circles: F64 | None = None) -> Scan:
        """The sweep at ``t_s`` from a world position (3,) and attitude; ``circles`` None: the world's at ``t_s``."""
        p = self.params
        index = round(t_s * p.rate_hz)
        ray_m = self.true_ranges(t_s, pos_world_ned_m, q_ned_frd, circles)
        measure(ray_m, self._scan_key(index), p.sigma_m, p.dropout, p.range_min_m, p.range_max_m)
        width = p.rays // p.sectors
        step = round(DITHER[index % len(DITHER)] * width) if p.dither else 0
        first_ray = step - width // 2
        sector_m = np.empty(p.sectors)
        sector_minima(ray_m, first_ray, sector_m)
        centre_rad = (first_ray + (width - 1) / 2) * (math.tau / p.rays)
        return Scan(t_s, sector_m, centre_rad, math.tau / p.sectors, p.range_min_m, p.range_max_m)

    def true_ranges(self, t_s: float, pos_world_ned_m: F64, q_ned_frd: F64, circles: F64 | None = None) -> F64:
        """What every ray (rays,) would read without noise: ray i at bearing i * 2 pi / rays; inf beyond the range."""
        ray_m = np.empty(self.params.rays)
        circles = self._world.at(t_s) if circles is None else circles
        lens_ned_m = pos_world_ned_m - np.array([0.0, 0.0, self.params.mount_up_m])
        cast_rays(lens_ned_m, q_ned_frd, circles, self._boxes, self._cos_sin, self.params.range_max_m, ray_m)
        return ray_m

    def _scan_key(self, index: int) -> np.uint64:
        """Counter block of a scan: two counters a ray, disjoint from every other scan's."""
        return np.uint64((int(self._key) + 2 * self.params.rays * index) % 2**64)


def _kernel_boxes(boxes: F64) -> F64:
    return np.column_stack([boxes[:, :2], np.cos(boxes[:, 2]), np.sin(boxes[:, 2]), boxes[:, 3:]])
