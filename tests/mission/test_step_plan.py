"""Rise time and overshoot of known responses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mission.step_plan import ASKS, END_S, STEPS, WATCH_S, ask_at, rise_and_overshoot

T_S = np.arange(0.0, 6.0, 0.02)


@given(st.floats(0.05, 1.5))
def test_a_first_order_response_rises_in_2_2_time_constants_and_never_overshoots(tau_s: float) -> None:
    rise_s, over = rise_and_overshoot(T_S, 1.0 - np.exp(-T_S / tau_s))
    assert rise_s == pytest.approx(tau_s * math.log(9.0), rel=0.03, abs=0.01)
    assert over == 0.0


@given(st.floats(0.3, 0.8))
def test_a_second_order_response_overshoots_as_the_book_says(damping: float) -> None:
    omega = 4.0
    damped = omega * math.sqrt(1.0 - damping**2)
    sway = np.cos(damped * T_S) + damping * omega / damped * np.sin(damped * T_S)
    _, over = rise_and_overshoot(T_S, 1.0 - np.exp(-damping * omega * T_S) * sway)
    assert over == pytest.approx(math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2)), abs=0.005)


def test_a_response_that_does_not_come_has_no_rise_time() -> None:
    rise_s, over = rise_and_overshoot(T_S, np.full_like(T_S, 0.5))
    assert math.isnan(rise_s)
    assert over == 0.0


def test_every_step_is_asked_for_and_is_over_before_the_next_one() -> None:
    changes = [ask.t_s for ask in ASKS[1:]]
    for step in STEPS:
        assert step.t_s in changes
        assert not any(step.t_s < change < step.t_s + WATCH_S for change in [*changes, END_S])
    assert ask_at(-1.0) is ASKS[0]
    assert ask_at(END_S) is ASKS[-1]
