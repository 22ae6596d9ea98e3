"""The 72 numbers of the paper: layout, frames, padding."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.core.frames import quaternion
from companion.core.types import VehicleState
from companion.perception.observation import (
    INTRINSIC,
    OBSTACLES,
    PAD,
    SIZE,
    nearest_representatives,
    observation,
)

START, GOAL = np.array([0.0, 0.0]), np.array([10.0, 0.0])


def state(pos: tuple[float, float, float] = (0.0, 0.0, -3.0), yaw: float = 0.0) -> VehicleState:
    return VehicleState(
        1.0, np.array(pos), np.array([1.0, 2.0, 0.5]), quaternion(0.1, -0.2, yaw), np.array([0.01, 0.02, 0.03])
    )


def test_layout_is_twelve_intrinsic_numbers_then_twenty_triples() -> None:
    obs = observation(state(), np.array([[3.0, 4.0]]), START, GOAL)
    assert obs.shape == (SIZE,) == (72,)
    assert obs[:3] == pytest.approx([-10.0, 0.0, -3.0])  # goal frame: ten metres before the goal
    assert obs[3:6] == pytest.approx([0.1, -0.2, 0.0])
    assert obs[6:9] == pytest.approx([0.01, 0.02, 0.03])
    assert obs[9:12] == pytest.approx([1.0, 2.0, 0.5])
    assert obs[INTRINSIC : INTRINSIC + 3] == pytest.approx([3.0, 4.0, 5.0])


def test_missing_obstacles_are_padded_with_55() -> None:
    obs = observation(state(), np.empty((0, 2)), START, GOAL)
    assert (obs[INTRINSIC:] == PAD).all()
    assert len(obs[INTRINSIC:]) == 3 * OBSTACLES


def test_offsets_turn_with_the_body_unless_the_paper_frame_is_asked_for() -> None:
    facing_east = state(yaw=math.pi / 2)
    obstacle = np.array([[0.0, 2.0]])  # two metres east: dead ahead
    assert observation(facing_east, obstacle, START, GOAL)[12:15] == pytest.approx([2.0, 0.0, 2.0])
    assert observation(facing_east, obstacle, START, GOAL, paper=True)[12:15] == pytest.approx([0.0, 2.0, 2.0])


@given(st.floats(-math.pi, math.pi), st.floats(-50, 50), st.floats(-50, 50))
def test_turning_and_moving_the_whole_scene_leaves_the_numbers_alone(turn: float, north: float, east: float) -> None:
    c, s = math.cos(turn), math.sin(turn)
    rotation, shift = np.array([[c, -s], [s, c]]), np.array([north, east])
    plain = state()
    moved = VehicleState(
        plain.t_s,
        np.append(rotation @ plain.pos_ned_m[:2] + shift, -3.0),
        np.append(rotation @ plain.vel_ned_m_s[:2], 0.5),
        quaternion(0.1, -0.2, turn),
        plain.rates_frd_rad_s,
    )
    obstacles = np.array([[3.0, 4.0], [-2.0, 1.0]])
    expected = observation(plain, obstacles, START, GOAL)
    got = observation(moved, obstacles @ rotation.T + shift, rotation @ START + shift, rotation @ GOAL + shift)
    assert got == pytest.approx(expected, abs=1e-6)


def test_the_nearest_twenty_within_the_radius_come_nearest_first() -> None:
    points = np.stack([np.arange(1.0, 41.0), np.zeros(40)], axis=1)[::-1]
    near = nearest_representatives(points, np.zeros(2), 15.0)
    assert near[:, 0].tolist() == [float(i) for i in range(1, 16)]
    assert len(nearest_representatives(points, np.zeros(2), 100.0)) == OBSTACLES
