"""Which trainings make up the reproduction?  A table of arms, each a preset in a world and what differs from it.

``arms.yaml`` beside this file is the table; a file of one's own has the same keys. Two arms that come to the same
training share its folder: the first of them in the table gives it its name.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any

from pydantic import Field

from companion.core.params import nearest
from mission.errors import InputError
from mission.strict_yaml import StrictModel, checked, read_yaml
from mission.training.presets import Preset, load_preset
from mission.training.run_folder import RunSpec
from mission.training.until import Until

GROUPS = ("paper", "replay", "epsilon", "checker", "sensing", "worlds")
QUICK_ARMS = ("t1", "t2", "vanilla", "no_stability", "no_checker")
QUICK_UNTIL = {"successes": 3, "episodes": 3}
QUICK_FLIGHTS = 2
EVALUATE = "training.evaluate_every"
QUICK_SETTINGS = {EVALUATE: 0, "training.warmup_decisions": 8, "env.time_limit_s": 40.0}


class UntilSpec(StrictModel):
    """When a seed is done."""

    successes: int
    episodes: int


class GroupSpec(StrictModel):
    """What is usual in a group; an arm may say otherwise."""

    until: UntilSpec | None = None
    seeds: int | None = Field(default=None, ge=1)  # at most; None: as many as are asked for
    checkpoints: bool | None = None


class ArmSpec(GroupSpec):
    """One arm as the table has it."""

    group: str
    text: str
    world: str
    preset: str | None = None
    settings: dict[str, Any] = Field(default_factory=dict)
    ticks_of: str | None = None


class TableSpec(StrictModel):
    """The file."""

    until: UntilSpec
    presets: dict[str, str] = Field(default_factory=dict)  # by world, of arms that name none
    groups: dict[str, GroupSpec] = Field(default_factory=dict)
    flights: int
    arms: dict[str, ArmSpec]


@dataclass(frozen=True, slots=True)
class Arm:
    """One arm. ``run``: the arm whose folder it trains in; ``ticks_of``: the arm whose ticks are its budget.

    ``seeds``: at most so many, however many are asked for. An arm without ``checkpoints`` flies greedily at its end
    alone; what it learns is the same.
    """

    name: str
    run: str
    group: str
    text: str
    world: str
    preset: Preset
    settings: Mapping[str, Any]
    until: Until
    ticks_of: str | None
    seeds: int | None

    def seeds_of(self, asked: Sequence[int]) -> tuple[int, ...]:
        """Which of the seeds asked for it trains: the first."""
        return tuple(sorted(asked)[: self.seeds])

    def spec(self, seeds: Sequence[int]) -> RunSpec:
        """What is trained, but for a budget of ticks."""
        return RunSpec(self.world, self.preset, tuple(seeds), self.until)


@dataclass(frozen=True, slots=True)
class Table:
    """Every arm, in the order in which they are run."""

    arms: tuple[Arm, ...]
    flights: int
    quick: bool = False

    def arm(self, name: str) -> Arm:
        """By name. Raises InputError with the nearest."""
        for arm in self.arms:
            if arm.name == name:
                return arm
        raise InputError(f"unknown arm '{name}'{nearest(name, [a.name for a in self.arms] + list(GROUPS))}")

    def chosen(self, only: str | None) -> tuple[Arm, ...]:
        """The arms of these names or groups (comma between them; None: all), and those whose ticks they need."""
        if only is None:
            names = [arm.name for arm in self.arms if not self.quick or arm.name in QUICK_ARMS]
        else:
            parts = [part.strip() for part in only.split(",") if part.strip()]
            if not parts:
                raise InputError("--only wants names of arms or groups, with commas between them")
            names = [name for part in parts for name in self._named(part)]
        needed = {self.arm(name).ticks_of for name in names}
        return tuple(arm for arm in self.arms if arm.name in names or arm.name in needed)

    def _named(self, part: str) -> list[str]:
        if part in GROUPS:
            return [arm.name for arm in self.arms if arm.group == part]
        return [self.arm(part).name]


def load_table(path: Path | None = None, quick: bool = False) -> Table:
    """The table in a file, or ours. ``quick``: a few episodes of each. Raises InputError naming arm and key."""
    if path is None:
        with resources.as_file(resources.files("mission.reproduce") / "arms.yaml") as ours:
            return _table(read_yaml(ours), "arms.yaml", quick)
    return _table(read_yaml(path), str(path), quick)


def _table(data: dict[str, Any], where: str, quick: bool) -> Table:
    spec = checked(TableSpec, data, where)
    arms: list[Arm] = []
    for group in spec.groups:
        _check_group(group, f"{where}: groups")
    for name, row in spec.arms.items():
        arm = _arm(name, _filled(row, spec), where, quick)
        if arm.ticks_of is not None and arm.ticks_of not in [earlier.name for earlier in arms]:
            raise InputError(f"{where}: arm '{name}': ticks_of '{arm.ticks_of}' is no arm before it")
        twin = next((earlier.run for earlier in arms if _same(earlier, arm)), name)
        arms.append(replace(arm, run=twin))
    return Table(tuple(arms), QUICK_FLIGHTS if quick else spec.flights, quick)


def _filled(row: ArmSpec, table: TableSpec) -> ArmSpec:
    """With what its group and the table say where the row says nothing."""
    group = table.groups.get(row.group, GroupSpec())
    return row.model_copy(
        update={
            "until": row.until or group.until or table.until,
            "preset": row.preset or table.presets.get(row.world, "default"),
            "seeds": row.seeds or group.seeds,
            "checkpoints": group.checkpoints if row.checkpoints is None else row.checkpoints,
        }
    )


def _check_group(name: str, where: str) -> None:
    if name not in GROUPS:
        raise InputError(f"{where}: unknown group '{name}'{nearest(name, list(GROUPS))}")


def _arm(name: str, row: ArmSpec, where: str, quick: bool) -> Arm:
    """From a row that was filled."""
    assert row.preset is not None
    assert row.until is not None
    told = f"{where}: arm '{name}'"
    _check_group(row.group, told)
    unwatched = {EVALUATE: 0} if row.checkpoints is False else {}
    settings = {**row.settings, **unwatched, **(QUICK_SETTINGS if quick else {})}
    try:
        preset = load_preset(row.preset, _nested(settings))
        until = Until(**(QUICK_UNTIL if quick else row.until.model_dump()))
    except (InputError, ValueError) as error:
        raise InputError(f"{told}: {error}") from error
    return Arm(name, name, row.group, row.text, row.world, preset, row.settings, until, row.ticks_of, row.seeds)


def _nested(settings: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """``{"section.field": value}`` by section."""
    nested: dict[str, dict[str, Any]] = {}
    for key, value in settings.items():
        section, dot, field = key.partition(".")
        if not dot:
            raise InputError(f"setting '{key}' wants section.field")
        nested.setdefault(section, {})[field] = value
    return nested


def _same(one: Arm, other: Arm) -> bool:
    """Would both train alike?"""
    return (one.world, unnamed(one.preset), one.until, one.ticks_of) == (
        other.world,
        unnamed(other.preset),
        other.until,
        other.ticks_of,
    )


def unnamed(preset: Preset) -> Preset:
    """What decides; not what it is called."""
    return replace(preset, name="", text="")
