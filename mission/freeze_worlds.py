"""What pins the acceptance worlds? Writes ``FROZEN.sha256``, ``forest100.json`` and ``heldout50.json`` in ``worlds``.

Run ``python -m mission.freeze_worlds`` only with a reason to change them: results before and after do not compare.
"""

import json
from pathlib import Path

from mission.bench import cells
from mission.world_file import load_world, world_hash
from mission.world_generator import freeze_forests

FOLDER = Path(__file__).parent / "worlds"
FROZEN = ("trajectory1", "trajectory1_movers", "trajectory2")
FOREST_FIRST_SEED = 1000
FOREST_COUNT = 100


def main() -> None:
    """Write the files."""
    lines = [f"{world_hash(load_world(name))}  {name}\n" for name in FROZEN]
    (FOLDER / "FROZEN.sha256").write_text("".join(lines), encoding="utf-8")
    forests = freeze_forests(FOREST_FIRST_SEED, FOREST_COUNT)
    data = {
        "text": "60 x 40 m, 0.05 trunks/m2, 0.6 m trunks; for acceptance, never for tuning; skipped seeds have no way"
        " through at radius 0.33 + 0.05 m",
        "seeds": forests.seeds,
        "skipped": forests.skipped,
        "sha256": forests.sha256,
    }
    (FOLDER / "forest100.json").write_text(json.dumps(data) + "\n", encoding="utf-8")
    held_out = cells.freeze()
    data = {
        "text": "worlds of our own cellular automaton under BARN's rules; flown once, never for tuning; skipped seeds"
        " have no way through at radius 0.33 + 0.02 m",
        "seeds": held_out.seeds,
        "sha256": held_out.sha256,
    }
    (FOLDER / "heldout50.json").write_text(json.dumps(data) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
