"""Where does everything about one training run lie?  ``runs/<UTC>_<world>_<preset>/``: ``run.yaml``, a folder a seed.

``run.yaml`` holds all that decides what is learned, so a run goes on from its folder alone.
"""

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from mission.errors import InputError
from mission.strict_yaml import read_yaml, write_yaml
from mission.training.configure import configured, plain
from mission.training.presets import Preset, preset_from
from mission.training.until import Until

RUN_FILE = "run.yaml"
DEFAULT_PARENT = Path("runs")
KEYS = ("world", "seeds", "device", "until", "preset")


@dataclass(frozen=True, slots=True)
class RunSpec:
    """What is trained."""

    world: str
    preset: Preset
    seeds: tuple[int, ...]
    until: Until
    device: str = "cpu"

    def as_dict(self) -> dict[str, Any]:
        """What ``run.yaml`` holds."""
        return {
            "world": self.world,
            "seeds": list(self.seeds),
            "device": self.device,
            "until": plain(self.until),
            "preset": plain(self.preset),
        }


def make_run(spec: RunSpec, out: Path | None, now: datetime | None = None) -> Path:
    """A new run folder with its ``run.yaml``: ``out``, which must be new or empty, or one below ./runs."""
    stamp = (now or datetime.now(UTC)).strftime("%Y%m%dT%H%M%SZ")
    world = "".join(c if c.isalnum() or c in "_-" else "_" for c in Path(spec.world).stem)
    folder = out or DEFAULT_PARENT / f"{stamp}_{world}_{spec.preset.name}"
    try:
        folder.mkdir(parents=True, exist_ok=out is not None)
        if any(folder.iterdir()):
            raise InputError(f"run folder '{folder}' is not empty; 'swiftnav train --resume {folder}' goes on with it")
        temporary = folder / f".{RUN_FILE}"
        write_yaml(temporary, spec.as_dict())
        temporary.replace(folder / RUN_FILE)
    except OSError as error:
        raise InputError(f"run folder '{folder}' cannot be written: {error.strerror or error}") from error
    return folder


def open_run(folder: Path) -> RunSpec:
    """The run in a folder. Raises InputError."""
    path = folder / RUN_FILE
    if not path.is_file():
        raise InputError(f"'{folder}' is no run folder: it has no {RUN_FILE}")
    data = read_yaml(path)
    for key in KEYS:
        if key not in data:
            raise InputError(f"{path}: key '{key}' is missing")
    seeds = data["seeds"]
    if not isinstance(seeds, list) or not seeds or not all(isinstance(seed, int) for seed in seeds):
        raise InputError(f"{path}: 'seeds' = {seeds!r} wants a list of whole numbers")
    until = configured(Until, data["until"], f"{path}: until")
    preset = preset_from(data["preset"], f"{path}: preset")
    return RunSpec(str(data["world"]), preset, tuple(seeds), until, str(data["device"]))
