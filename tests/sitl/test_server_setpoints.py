import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common as mav

from companion.core.codec import decode_setpoint, encode_setpoint
from companion.core.types import Setpoint
from sitl.setpoints import SetpointError, local_ned, of_companion

NAN = math.nan
POSITION, VELOCITY, POS_VEL, POS_VEL_ACC, ACCELERATION, BODY = 2552, 2503, 2496, 2048, 3135, 1479  # as MAVSDK sends


def message(mask: int, frame: int = 1, values: tuple[float, ...] = (1, 2, 3, 4, 5, 6, 7, 8, 9, 0.5, 0.25)) -> Any:
    return mav.MAVLink_set_position_target_local_ned_message(0, 1, 1, frame, mask, *values)


@pytest.mark.parametrize(
    ("mask", "pos", "vel", "acc", "yaw", "rate"),
    [
        (POSITION, [1, 2, 3], [NAN] * 3, [NAN] * 3, 0.5, NAN),
        (VELOCITY, [NAN] * 3, [4, 5, 6], [NAN] * 3, 0.5, NAN),
        (POS_VEL, [1, 2, 3], [4, 5, 6], [NAN] * 3, 0.5, NAN),
        (POS_VEL_ACC, [1, 2, 3], [4, 5, 6], [7, 8, 9], 0.5, NAN),
        (ACCELERATION, [NAN] * 3, [NAN] * 3, [7, 8, 9], NAN, NAN),
        (0b101111_111_110, [1, NAN, NAN], [NAN] * 3, [NAN] * 3, 0.5, NAN),
        (504, [1, 2, 3], [NAN] * 3, [NAN] * 3, 0.5, 0.25),
        (504 | 1024, [1, 2, 3], [NAN] * 3, [NAN] * 3, NAN, 0.25),
    ],
)
def test_the_type_mask_takes_axes_out(
    mask: int, pos: list[float], vel: list[float], acc: list[float], yaw: float, rate: float
) -> None:
    sp = local_ned(message(mask), yaw_rad=0.3)
    for got, wanted in ((sp.pos_ned_m, pos), (sp.vel_ned_m_s, vel), (sp.acc_ned_m_s2, acc)):
        assert np.array_equal(got, np.array(wanted, dtype=float), equal_nan=True)
    assert (sp.yaw_rad, sp.yaw_rate_rad_s) == pytest.approx((yaw, rate), nan_ok=True)


def test_body_frame_turns_velocity_by_the_nose_and_ignores_position() -> None:
    sp = local_ned(message(BODY, frame=8, values=(1, 2, 3, 2.0, 0, -1.0, 0, 0, 0, 0, 0.25)), yaw_rad=math.pi / 2)
    assert np.isnan(sp.pos_ned_m).all()
    assert sp.vel_ned_m_s == pytest.approx([0.0, 2.0, -1.0], abs=1e-12)
    assert math.isnan(sp.yaw_rad)
    assert sp.yaw_rate_rad_s == 0.25


@pytest.mark.parametrize("frame", [0, 7, 9, 12])
def test_other_frames_are_refused_with_px4s_text(frame: int) -> None:
    with pytest.raises(SetpointError, match=f"coordinate frame {frame} unsupported"):
        local_ned(message(POSITION, frame), 0.0)


@pytest.mark.parametrize("values", [(1.0,) * 11, (NAN,) * 11])
def test_a_setpoint_that_asks_for_nothing_is_invalid(values: tuple[float, ...]) -> None:
    mask = 0b111111111 if values[0] == 1.0 else POS_VEL_ACC
    with pytest.raises(SetpointError, match="SET_POSITION_TARGET_LOCAL_NED invalid"):
        local_ned(message(mask, values=values), 0.0)


def test_forces_are_refused() -> None:
    with pytest.raises(SetpointError, match="force not supported"):
        local_ned(message(POS_VEL_ACC | 512), 0.0)
    local_ned(message(POSITION | 512), 0.0)


@settings(max_examples=200)
@given(
    st.integers(0, 0xFFFF),
    st.integers(0, 255),
    st.lists(st.floats(width=32), min_size=11, max_size=11),
)
def test_any_setpoint_is_either_refused_or_usable(mask: int, frame: int, values: list[float]) -> None:
    try:
        sp = local_ned(message(mask, frame, tuple(values)), 0.7)
    except SetpointError:
        return
    every = np.concatenate([sp.pos_ned_m, sp.vel_ned_m_s, sp.acc_ned_m_s2])
    assert np.isfinite(every).any()
    assert not np.isinf(every).any()
    assert not math.isinf(sp.yaw_rad)


axis = st.floats(-100, 100) | st.just(NAN)
vector = st.none() | st.tuples(axis, axis, axis).map(np.array)


@settings(max_examples=200)
@given(vector, vector, vector, st.none() | st.floats(-math.pi, math.pi))
def test_a_setpoint_means_the_same_over_the_wire_and_in_process(pos: Any, vel: Any, acc: Any, yaw: Any) -> None:
    sent = Setpoint(1.0, pos, vel, acc, yaw)
    link = mav.MAVLink(None, 1, 191)
    wire = mav.MAVLink(None).decode(bytearray(encode_setpoint(sent).pack(link)))
    assert decode_setpoint(wire).t_s == 1.0
    inside = of_companion(sent)
    try:
        outside = local_ned(wire, 0.0)
    except SetpointError:
        assert np.isnan(np.concatenate([inside.pos_ned_m, inside.vel_ned_m_s, inside.acc_ned_m_s2])).all()
        return
    for a, b in (
        (inside.pos_ned_m, outside.pos_ned_m),
        (inside.vel_ned_m_s, outside.vel_ned_m_s),
        (inside.acc_ned_m_s2, outside.acc_ned_m_s2),
    ):
        assert np.array_equal(a, b, equal_nan=True)
    assert (inside.yaw_rad, inside.yaw_rate_rad_s) == pytest.approx(
        (outside.yaw_rad, outside.yaw_rate_rad_s), nan_ok=True, abs=0
    )
