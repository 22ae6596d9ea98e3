"""Does the guidance line measure errors as the paper defines them, and do its laws steer back to it?"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from companion.core import frames
from companion.core.params import ParamError
from companion.guidance import line as guidance
from companion.guidance.line import LineParams

STANLEY = LineParams()
PD = LineParams(law="pd")
COORDINATE = st.floats(-100.0, 100.0)


def northward() -> guidance.GuidanceLine:
    return guidance.line_through(np.array([1.0, 2.0]), np.array([11.0, 2.0]))


def test_hand_worked_line() -> None:
    line = guidance.line_through(np.array([1.0, 2.0]), np.array([4.0, 6.0]))
    assert line.length_m == pytest.approx(5.0)
    assert line.t == pytest.approx([0.6, 0.8])
    assert line.n == pytest.approx([-0.8, 0.6])
    assert line.course_rad == pytest.approx(math.atan2(4, 3))
    assert guidance.slope_intercept(line) == pytest.approx((4 / 3, 2 / 3))


def test_a_line_due_east_has_no_slope_but_errors_like_any_other() -> None:
    line = guidance.line_through(np.array([3.0, 0.0]), np.array([3.0, 8.0]))
    assert guidance.slope_intercept(line) is None
    seen = guidance.errors(line, np.array([2.0, 5.0]), math.pi / 2)
    assert (seen.cross_track_m, seen.progress_m, seen.heading_rad) == pytest.approx((1.0, 5.0, 0.0))


def test_a_line_of_no_length_points_north_and_is_used_up() -> None:
    line = guidance.line_through(np.array([3.0, 4.0]), np.array([3.0, 4.0]))
    assert line.length_m == 0.0
    assert line.t == pytest.approx([1.0, 0.0])
    assert guidance.done(line, np.array([3.0, 4.0]))


def test_right_of_the_line_and_clockwise_of_it_are_positive() -> None:
    seen = guidance.errors(northward(), np.array([4.0, 3.5]), 0.2)
    assert (seen.cross_track_m, seen.heading_rad, seen.progress_m) == pytest.approx((1.5, 0.2, 3.0))


def test_the_line_is_used_up_at_its_length_and_not_before() -> None:
    assert not guidance.done(northward(), np.array([10.99, 40.0]))
    assert guidance.done(northward(), np.array([11.0, 40.0]))
    assert not guidance.done(northward(), np.array([math.nan, 2.0]))


@given(a=st.tuples(COORDINATE, COORDINATE), b=st.tuples(COORDINATE, COORDINATE), p=st.tuples(COORDINATE, COORDINATE))
def test_progress_and_cross_track_rebuild_the_position(
    a: tuple[float, float], b: tuple[float, float], p: tuple[float, float]
) -> None:
    line = guidance.line_through(np.array(a), np.array(b))
    seen = guidance.errors(line, np.array(p), 0.0)
    rebuilt = line.origin_ned_m + seen.progress_m * line.t + seen.cross_track_m * line.n
    assert rebuilt == pytest.approx(np.array(p), abs=1e-9)
    assert line.origin_ned_m + line.length_m * line.t == pytest.approx(line.goal_ned_m, abs=1e-9)


@given(a=st.tuples(COORDINATE, COORDINATE), b=st.tuples(COORDINATE, COORDINATE), north_m=COORDINATE)
def test_slope_and_intercept_describe_the_same_line(
    a: tuple[float, float], b: tuple[float, float], north_m: float
) -> None:
    assume(abs(a[0] - b[0]) > 0.1)
    line = guidance.line_through(np.array(a), np.array(b))
    found = guidance.slope_intercept(line)
    assert found is not None
    on_line = np.array([north_m, found[0] * north_m + found[1]])
    assert guidance.errors(line, on_line, 0.0).cross_track_m == pytest.approx(0.0, abs=1e-6)


@given(cross_m=st.floats(-50, 50), heading_rad=st.floats(-3, 3), speed_m_s=st.floats(0, 20))
def test_both_laws_turn_against_the_error_and_are_odd(cross_m: float, heading_rad: float, speed_m_s: float) -> None:
    turn = guidance.stanley_rad(cross_m, heading_rad, speed_m_s, STANLEY)
    rate = guidance.pd_rad_s(cross_m, heading_rad, PD)
    assert guidance.stanley_rad(-cross_m, -heading_rad, speed_m_s, STANLEY) == pytest.approx(-turn)
    assert guidance.pd_rad_s(-cross_m, -heading_rad, PD) == pytest.approx(-rate)
    assert abs(rate) <= PD.max_rate_rad_s
    if cross_m >= 0.0 and heading_rad >= 0.0:
        assert turn <= 0.0
        assert rate <= 0.0


def test_stanley_on_a_hand_worked_case() -> None:
    params = LineParams(k_s=1.0)
    assert guidance.stanley_rad(1.1, 0.3, 1.0, params) == pytest.approx(-(0.3 + math.pi / 4))


def test_pd_on_hand_worked_cases() -> None:
    params = LineParams(law="pd", k_psi=1.5, k_y=0.5, max_course_rad=0.8, max_rate_rad_s=5.0)
    assert guidance.pd_rad_s(0.4, 0.2, params) == pytest.approx(-(1.5 * 0.2 + 0.5 * 0.4))
    assert guidance.pd_rad_s(100.0, 0.2, params) == pytest.approx(-1.5 * (0.2 + 0.8))  # pull of the line saturated
    assert guidance.pd_rad_s(100.0, 0.2, replace(params, max_rate_rad_s=1.0)) == -1.0


@pytest.mark.parametrize("law", ["stanley", "pd"])
@settings(max_examples=25, deadline=None)
@given(cross_m=st.floats(-15, 15), heading_rad=st.floats(-3.1, 3.1), speed_m_s=st.floats(0.5, 4.0))
def test_a_unicycle_steered_by_either_law_converges_from_any_offset(
    law: str, cross_m: float, heading_rad: float, speed_m_s: float
) -> None:
    line = guidance.line_through(np.array([0.0, 0.0]), np.array([3.0, 4.0]))
    pos, heading, dt_s = cross_m * line.n, line.course_rad + heading_rad, 0.04
    for _ in range(2500):
        seen = guidance.errors(line, pos, heading)
        if law == "pd":
            rate = guidance.pd_rad_s(seen.cross_track_m, seen.heading_rad, PD)
        else:
            rate = 1.5 * guidance.stanley_rad(seen.cross_track_m, seen.heading_rad, speed_m_s, STANLEY)
        heading += max(-1.0, min(1.0, rate)) * dt_s
        pos = pos + speed_m_s * dt_s * np.array([math.cos(heading), math.sin(heading)])
    seen = guidance.errors(line, pos, heading)
    assert abs(seen.cross_track_m) < 0.05
    assert abs(seen.heading_rad) < 0.05


@pytest.mark.parametrize("params", [STANLEY, PD], ids=["stanley", "pd"])
@settings(max_examples=25, deadline=None)
@given(
    cross_m=st.floats(-15, 15),
    vel_m_s=st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    speed_m_s=st.floats(0.5, 4.0),
    course_rad=st.floats(-3.1, 3.1),
)
def test_a_late_velocity_loop_flown_on_the_course_converges_from_any_offset(
    params: LineParams, cross_m: float, vel_m_s: tuple[float, float], speed_m_s: float, course_rad: float
) -> None:
    far = 500.0 * np.array([math.cos(course_rad), math.sin(course_rad)])
    line = guidance.line_through(np.zeros(2), far)
    pos, vel, dt_s = cross_m * line.n, np.array(vel_m_s), 0.04
    asked = [vel, vel]
    for _ in range(2000):
        course = guidance.course_rad(line, pos, speed_m_s, params)
        asked.append(speed_m_s * np.array([math.cos(course), math.sin(course)]))
        acc = 1.8 * (asked[-3] - vel)  # PX4's velocity loop, 80 ms late
        vel = vel + acc * dt_s
        pos = pos + vel * dt_s
    assert abs(guidance.errors(line, pos, 0.0).cross_track_m) < 0.05
    assert float(vel @ line.t) == pytest.approx(speed_m_s, rel=0.01)


@pytest.mark.parametrize("params", [STANLEY, PD], ids=["stanley", "pd"])
@given(cross_m=st.floats(-1e3, 1e3), speed_m_s=st.floats(0.0, 20.0))
def test_the_course_is_where_the_law_asks_for_no_turn_and_never_leaves_its_limit(
    params: LineParams, cross_m: float, speed_m_s: float
) -> None:
    line = northward()
    pos = line.origin_ned_m + cross_m * line.n
    course = guidance.course_rad(line, pos, speed_m_s, params)
    seen = guidance.errors(line, pos, course)
    assert abs(seen.heading_rad) <= params.max_course_rad + 1e-9
    if abs(seen.heading_rad) < params.max_course_rad - 1e-9:
        if params.law == "pd":
            assert guidance.pd_rad_s(seen.cross_track_m, seen.heading_rad, params) == pytest.approx(0.0, abs=1e-9)
        else:
            turn = guidance.stanley_rad(seen.cross_track_m, seen.heading_rad, speed_m_s, params)
            assert turn == pytest.approx(0.0, abs=1e-9)
    mirrored = guidance.course_rad(line, line.origin_ned_m - cross_m * line.n, speed_m_s, params)
    assert frames.wrap_rad(mirrored + course) == pytest.approx(0.0, abs=1e-9)


def test_an_unknown_law_is_refused() -> None:
    with pytest.raises(ParamError, match="law"):
        LineParams(law="bang")
