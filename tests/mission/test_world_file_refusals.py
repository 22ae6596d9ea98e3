"""Is every mistake in a world file refused with one line that names it?"""

import pytest

from mission.world_check import WorldError
from mission.world_file import world_from_data

GOOD = {
    "name": "yard",
    "goal": [20.0, 0.0],
    "bounds": {"north": [-5.0, 25.0], "east": [-5.0, 5.0]},
    "cylinders": [{"at": [10.0, 0.0], "radius_m": 0.5}],
}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"goaal": [1.0, 0.0]}, "unknown key 'goaal'; did you mean 'goal'?"),
        (
            {"cylinders": [{"at": [1.0, 2.0], "radius": 0.3}]},
            "unknown key 'cylinders.0.radius'; did you mean 'radius_m'?",
        ),
        ({"bounds": {"nord": [0.0, 1.0], "east": [0.0, 1.0]}}, "unknown key 'bounds.nord'; did you mean 'north'?"),
        ({"goal": [float("nan"), 0.0]}, "'goal.0' = nan"),
        ({"cylinders": [{"at": [1.0, 2.0], "radius_m": -0.3}]}, "'cylinders.0.radius_m' = -0.3"),
        ({"cylinders": [{"at": [1.0, 2.0], "radius_m": "wide"}]}, "'cylinders.0.radius_m' = 'wide'"),
        ({"bounds": {"north": [5.0, -5.0], "east": [-5.0, 5.0]}}, "wants north: [min, max]"),
        ({"walls": [{"between": [[1.0, 1.0], [1.0, 1.0]]}]}, "wants two places that are apart"),
        ({"arcs": [{"centre": [5, 0], "radius_m": 2, "from_deg": 90, "to_deg": 0}]}, "turns clockwise"),
        (
            {"movers": [{"between": [[3, 3], [3, 4]], "radius_m": 0.3, "speed_max_m_s": 1.0, "speed_m_s": 2.0}]},
            "at most its speed_max_m_s",
        ),
    ],
)
def test_a_file_with_a_wrong_key_or_value_is_refused_by_name(change: dict[str, object], message: str) -> None:
    with pytest.raises(WorldError) as refusal:
        world_from_data({**GOOD, **change}, "world yard")
    text = str(refusal.value)
    assert message in text
    assert text.startswith("world yard: ")
    assert "\n" not in text
