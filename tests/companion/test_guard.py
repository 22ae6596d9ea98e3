"""Whose path is flown while the guard is on."""

import math
from dataclasses import replace

import numpy as np
import pytest

from companion.checker.checker import REFUSAL, CheckQuery, Verdict, VerdictKind, check
from companion.checker.params import CheckerParams
from companion.core.types import F64
from companion.guidance.limits import LimitsParams
from companion.navigator.guard import Pace, steps_in

PACE = Pace(3.0, LimitsParams())
NOTHING = np.empty((0, 2))
WAY = np.stack([np.linspace(0.0, 20.0, 81), np.zeros(81)], axis=1)  # the expert's, straight north
STRAIGHT = np.array([[4.0, 0.0], [8.0, 0.0]])
TREE = np.array([[4.0, 0.55]])


def judged(waypoints_ne_m: F64 | list[list[float]], points_ne_m: F64 = NOTHING) -> tuple[Verdict, CheckQuery]:
    path = np.array(waypoints_ne_m, dtype=float)
    asked = CheckQuery(np.zeros(2), np.array([3.0, 0.0]), np.array([20.0, 0.0]), 0.33, points_ne_m, path, None)
    return check(asked, CheckerParams()), asked


def expert_flies(policy: F64 | list[list[float]], way: F64 = WAY, points: F64 = NOTHING, ratio: float = 1.0) -> bool:
    theirs, _ = judged(way[[8, 12, 16, 20, 32]], points)
    mine, asked = judged(policy, points)
    return steps_in(mine, theirs, asked, PACE, ratio)


def test_a_policy_that_goes_as_straight_as_the_expert_flies() -> None:
    assert not expert_flies([[2.0, 0.0], [5.0, 0.0]], ratio=1.001)


@pytest.mark.parametrize("east_m", [3.0, -3.0])
def test_a_policy_that_goes_astray_does_not(east_m: float) -> None:
    assert expert_flies([[1.0, east_m], [2.0, 2.0 * east_m]])


def test_a_policy_that_cuts_the_experts_corner_flies() -> None:
    bend = np.array([[0.0, 0.0], [4.0, 4.0], [8.0, 4.0], [12.0, 0.0], [20.0, 0.0]])
    theirs, _ = judged(bend[1:4])
    mine, asked = judged([[3.0, 0.0], [6.0, 0.0]])
    assert not steps_in(mine, theirs, asked, PACE, 1.0)


def test_a_policy_that_flies_closer_by_an_obstacle_loses_the_time_it_wins() -> None:
    away = np.stack([WAY[:, 0], -0.4 * np.exp(-((WAY[:, 0] - 4.0) ** 2))], axis=1)
    assert expert_flies([[2.0, 0.0], [6.0, 0.0]], away, TREE)


def test_where_only_one_of_them_has_a_path_that_one_flies() -> None:
    verdict, asked = judged(STRAIGHT)
    assert steps_in(REFUSAL, verdict, asked, PACE, 1.0)
    assert not steps_in(verdict, REFUSAL, asked, PACE, 1.0)


def test_a_policys_path_that_was_corrected_or_has_less_margin_does_not_fly() -> None:
    verdict, asked = judged(STRAIGHT)
    assert steps_in(replace(verdict, kind=VerdictKind.MODIFIED), verdict, asked, PACE, 1.0)
    assert steps_in(replace(verdict, margin_m=0.05), verdict, asked, PACE, 1.0)


def test_a_policy_behind_a_wall_that_sees_nothing_of_the_experts_way_does_not_fly() -> None:
    wall = np.stack([np.linspace(-30.0, 30.0, 601), np.full(601, 1.5)], axis=1)
    theirs, asked = judged(STRAIGHT, wall)
    behind = replace(theirs, path_ned_m=np.array([[0.0, 3.0], [4.0, 3.0]]))
    assert steps_in(behind, theirs, asked, PACE, 3.0)


def test_a_straight_way_takes_its_length_at_cruise_and_a_corner_takes_longer() -> None:
    _, asked = judged(STRAIGHT)
    rest = np.array([[8.0, 0.0], [12.0, 0.0]])
    straight_s = PACE.flight_s(np.array([[0.0, 0.0], [8.0, 0.0]]), rest, asked)
    corner_s = PACE.flight_s(np.array([[0.0, 0.0], [4.0, 4.0 * math.sqrt(3.0)]]), rest, asked)
    assert straight_s == pytest.approx(4.0)
    assert corner_s > 12.0 / 3.0
