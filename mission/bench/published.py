"""What have others published, and what differs from what we fly? Data for the report; every row with its source."""

from typing import Final

Rows = tuple[tuple[str, ...], ...]

_DIFFERS: Final = {
    "tracks": (
        "The paper gives two maps, one seed and curves, no rates: there is nothing to stand beside. Our rows",
        "end in the air, within 1 m of the goal; whole missions with landing are in the flight tables.",
    ),
    "barn": (
        "BARN worlds, BARN formula, own vehicle: a quadrotor as a disc of 0.33 m radius in place of a ground",
        "robot of 0.508 x 0.432 m, cap 2 m/s, 72 sectors over OBSTACLE_DISTANCE in place of 720 rays over 270",
        "deg, cylinders as tall as any flight, start within 5 cm, own simulator. Published rows are for the",
        "50 public worlds or hidden ones; ours say which worlds they flew.",
    ),
    "heldout": (
        "Worlds of our own generator under BARN's rules; the shortest way for the vehicle stands for the",
        "reference path, which makes the score harder than BARN's. Nobody else has flown them.",
    ),
    "forest": (
        "Set-up of Loquercio et al. 2021: 60 x 30 m, Poisson trunks of 0.6 m, 40 m straight on, sphere of 0.2",
        "m, sensing 6 m at 15 Hz (ours 14.7 Hz, planar LiDAR for their depth camera). Speed is the cap given",
        "to the pilot; `mean m/s` is what was flown from 8 m on. Their vehicle has more thrust than ours.",
    ),
    "gap": (
        "Set-up of Loquercio et al. 2021: a wall of 40 m across the way 10 m ahead, one opening of 0.8 to 1.0",
        "m, up to 5 m off the line, sensing 6 m.",
    ),
    "pole": (
        "Set-up of Loquercio et al. 2021: a pole of 1.5 m, its middle 6 m ahead of a vehicle that starts at",
        "speed; sensing 6 m. The ceiling of a vehicle that tilts 35 deg lies below theirs.",
    ),
    "dynamic": (
        "Counts as in a published draft table (third-party quote, 1000 trials); sizes, speeds of 0.5 to 1.5",
        "m/s and ways to and fro are our own, as they are not given. LiDAR 4 m, 2 m/s. `contact`: we moved;",
        "`struck`: we stood still.",
    ),
}

_TABLES: Final[dict[str, Rows]] = {
    "barn": (
        ("published system", "score .5 (or .25)", "success", "collision", "mean time s"),
        ("winner 2026, hidden 50 worlds: A* + VFH* + fuzzy speed + barrier (third-party quote)", "0.4975", "", "", ""),
        ("LiCS-KI 2024, public 50 x 10, own log", "0.4889", "0.980", "0.018", "7.7"),
        ("INVENTEC 2023, public 50", "(0.2445)", "0.990", "0.006", "14.0"),
        ("DRL-VO 2022, public 50 x 10", "0.3721", "0.936", "0.064", "15.0"),
        ("DWA 0.5 m/s, public 50 x 10", "0.1592", "0.850", "0.056", "34.1"),
        ("Nav2 MPPI 0.5 m/s, 8 worlds", "0.1045", "0.756", "0", "47.3"),
    ),
    "forest": (
        ("published system", "density", "3 m/s", "5 m/s", "10 m/s", "12 m/s"),
        ("Loquercio et al., 10 seeds", "1/25", "1.0", "1.0", "0.6", ""),
        ("others there, best", "1/25", "1.0", "", "0.0", ""),
        ("Loquercio et al., 10 seeds", "1/49", "", "", "0.9", "up to 0.5"),
    ),
    "gap": (
        ("published system", "5 m/s", "7 m/s"),
        ("Loquercio et al.", "1.0", "0.8"),
        ("FastPlanner there", "<= 0.5", "0.0"),
    ),
    "pole": (
        ("published system", "5 m/s", "7 m/s", "10 m/s"),
        ("Loquercio et al.", "1.0", "1.0", "0.6"),
        ("others there", "1.0", "", ""),
    ),
    "dynamic": (
        ("published, third-party quotes", "static 70", "moving 60", "mixed 20+40"),
        ("20 x 20 m draft table, 1000 trials", "0.941", "0.699", "0.618"),
        ("NavRL, 40 x 40 m, 350 static + 60..120 moving", "", "0.943 .. 0.687", ""),
    ),
}


def differs(suite: str) -> tuple[str, ...]:
    """What differs between published set-ups and ours; lines of text."""
    return _DIFFERS[suite]


def table(suite: str) -> list[str]:
    """Published figures as Markdown; nothing where there are none."""
    if suite not in _TABLES:
        return []
    head, *rows = _TABLES[suite]
    return [_line(head), _line(("---",) * len(head)), *(_line(row) for row in rows)]


def _line(words: tuple[str, ...]) -> str:
    return "| " + " | ".join(words) + " |"
