"""How long does the battery last, and where does its drain end?"""

import pytest

from sitl.battery import HOVER_ENDURANCE_S, HOVER_THRUST_NORM, Battery


def test_hovering_empties_it_in_the_time_of_the_data_sheet() -> None:
    battery = Battery()
    battery.draw(HOVER_ENDURANCE_S / 2, HOVER_THRUST_NORM, armed=True)
    assert battery.remaining == pytest.approx(0.5)
    battery.draw(HOVER_ENDURANCE_S, HOVER_THRUST_NORM, armed=True)
    assert battery.remaining == 0.0


def test_it_is_drawn_to_the_least_that_is_asked_for_and_never_charged() -> None:
    battery = Battery()
    battery.draw(HOVER_ENDURANCE_S / 2, HOVER_THRUST_NORM, armed=True, least=0.8)
    assert battery.remaining == 0.8
    battery.remaining = 0.3
    battery.draw(1.0, HOVER_THRUST_NORM, armed=True, least=0.8)
    assert battery.remaining == 0.3
