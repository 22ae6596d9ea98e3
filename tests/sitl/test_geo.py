import pytest
from hypothesis import given
from hypothesis import strategies as st

from sitl.geo import Origin

metres = st.floats(-20_000.0, 20_000.0)


@given(metres, metres)
def test_globe_and_local_plane_are_each_others_inverse(north_m: float, east_m: float) -> None:
    origin = Origin()
    assert origin.north_east_m(*origin.lat_lon_deg(north_m, east_m)) == pytest.approx((north_m, east_m), abs=1e-5)


def test_a_thousandth_of_a_degree_north_is_111_m() -> None:
    origin = Origin()
    assert origin.north_east_m(origin.lat_deg + 1e-3, origin.lon_deg) == pytest.approx((111.19, 0.0), abs=0.01)
