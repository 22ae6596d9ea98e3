"""The table of arms fits the presets, says what differs, and refuses what it does not know."""

from dataclasses import replace
from pathlib import Path

import pytest

from mission.errors import InputError
from mission.reproduce.arms import GROUPS, QUICK_ARMS, load_table
from mission.reproduce.run import check
from mission.training.low_level import ticks_of
from mission.training.presets import load_preset

MINE = """
until: {{successes: 10, episodes: 20}}
flights: 2
arms:
  base: {{group: paper, text: the base, world: trajectory1}}
  other: {other}
"""
BAD = [
    ("{group: paper, text: a, world: trajectory1, settings: {td3.tou: 0.1}}", "unknown key 'tou'; did you mean 'tau'"),
    ("{group: paper, text: a, world: trajectory1, settings: {tdd3.tau: 0.1}}", "unknown section 'tdd3'"),
    ("{group: paper, text: a, world: trajectory1, settings: {tau: 0.1}}", "setting 'tau' wants section.field"),
    ("{group: paper, text: a, world: trajectory1, settings: {td3.tau: big}}", "'tau' = 'big'"),
    ("{group: paper, text: a, world: trajectory1, preset: defualt}", "did you mean 'default'"),
    ("{group: papre, text: a, world: trajectory1}", "unknown group 'papre'; did you mean 'paper'"),
    ("{group: paper, text: a, world: trajectory1, ticks_of: later}", "ticks_of 'later' is no arm before it"),
    ("{group: paper, text: a, world: trajectory1, until: {successes: 0, episodes: 1}}", "'successes' = 0"),
    ("{group: paper, text: a, wrold: trajectory1}", "unknown key 'arms.other.wrold'; did you mean 'world'"),
]


def _mine(folder: Path, other: str) -> Path:
    path = folder / "arms.yaml"
    path.write_text(MINE.format(other=other))
    return path


def test_every_arm_of_our_table_can_be_trained() -> None:
    check(load_table().arms)


def test_every_group_has_arms_and_every_arm_says_what_it_is() -> None:
    table = load_table()
    assert {arm.group for arm in table.arms} == set(GROUPS)
    assert len({arm.text for arm in table.arms}) == len(table.arms)


def test_an_arm_differs_from_its_preset_by_what_it_says_and_by_nothing_else() -> None:
    for arm in load_table().arms:
        nested: dict[str, dict[str, object]] = {}
        for key, value in arm.settings.items():
            section, _, field = key.partition(".")
            nested.setdefault(section, {})[field] = value
        training = load_preset(arm.preset.name, nested).training
        assert arm.preset.training in (training, replace(training, evaluate_every=0))  # what is watched decides nothing
        assert replace(arm.preset, training=training) == load_preset(arm.preset.name, nested)


def test_an_arm_takes_from_its_group_what_it_does_not_say_itself(tmp_path: Path) -> None:
    path = tmp_path / "arms.yaml"
    path.write_text(
        "until: {successes: 10, episodes: 20}\nflights: 2\n"
        "groups: {replay: {seeds: 3, checkpoints: false, until: {successes: 10, episodes: 5}}}\narms:\n"
        "  plain: {group: paper, text: a, world: trajectory1}\n"
        "  usual: {group: replay, text: b, world: trajectory1}\n"
        "  own: {group: replay, text: c, world: trajectory1, seeds: 1, checkpoints: true, "
        "until: {successes: 10, episodes: 7}}\n"
    )
    plain, usual, own = load_table(path).arms
    assert [arm.until.episodes for arm in (plain, usual, own)] == [20, 5, 7]
    assert [arm.seeds_of((2, 1, 4, 3)) for arm in (plain, usual, own)] == [(1, 2, 3, 4), (1, 2, 3), (1,)]
    assert usual.preset.training.evaluate_every == 0
    assert plain.preset == own.preset
    path.write_text(path.read_text().replace("groups: {replay", "groups: {repley"))
    with pytest.raises(InputError, match="unknown group 'repley'; did you mean 'replay'"):
        load_table(path)


def test_the_baseline_learns_no_less_often_a_tick_than_the_arm_whose_ticks_it_gets() -> None:
    table = load_table()
    for name in ("vanilla", "vanilla_paper"):
        preset = table.arm(name).preset
        baseline, hold_ticks = preset.training.updates_per_decision, ticks_of(preset.env)
        assert table.arm(name).ticks_of is not None
        swift = table.arm(table.arm(name).ticks_of or "").preset.training.updates_per_decision
        assert baseline / hold_ticks > swift / 19  # ticks a decision, as trained


@pytest.mark.parametrize(("other", "expected"), BAD)
def test_a_mistake_in_a_table_is_told_in_one_line(other: str, expected: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as told:
        load_table(_mine(tmp_path, other))
    assert expected in str(told.value)
    assert "other" in str(told.value)
    assert "\n" not in str(told.value)


def test_a_world_that_does_not_exist_is_told_before_anything_trains(tmp_path: Path) -> None:
    table = load_table(_mine(tmp_path, "{group: paper, text: a, world: trajectry1}"))
    with pytest.raises(InputError, match=r"arm 'other': .*did you mean 'trajectory1'"):
        check(table.arms)


def test_arms_that_come_to_the_same_training_share_it(tmp_path: Path) -> None:
    same = load_table(_mine(tmp_path, "{group: replay, text: twin, world: trajectory1, settings: {env.checker: true}}"))
    assert [arm.run for arm in same.arms] == ["base", "base"]
    for other in ("world: trajectory2", "world: trajectory1, ticks_of: base", "world: trajectory1, preset: paper"):
        table = load_table(_mine(tmp_path, f"{{group: replay, text: other, {other}}}"))
        assert [arm.run for arm in table.arms] == ["base", "other"]


def test_arms_are_chosen_by_name_and_group_with_those_that_they_need() -> None:
    table = load_table()
    assert [arm.name for arm in table.chosen("vanilla")] == ["t1", "vanilla"]
    assert {arm.group for arm in table.chosen("replay, epsilon")} == {"replay", "epsilon"}
    assert table.chosen(None) == table.arms
    with pytest.raises(InputError, match="unknown arm 'vanila'; did you mean 'vanilla'"):
        table.chosen("t1,vanila")
    with pytest.raises(InputError, match="--only"):
        table.chosen(" , ")


def test_a_quick_table_trains_little_and_says_so() -> None:
    table = load_table(quick=True)
    assert table.quick
    assert tuple(sorted(arm.name for arm in table.chosen(None))) == tuple(sorted(QUICK_ARMS))
    assert all(arm.until.episodes <= 5 for arm in table.arms)
