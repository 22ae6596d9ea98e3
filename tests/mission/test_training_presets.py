"""All settings of a training in one checked value."""

from pathlib import Path

import pytest

from mission.errors import InputError
from mission.strict_yaml import write_yaml
from mission.training.configure import plain
from mission.training.presets import list_presets, load_preset, preset_from
from mission.training.run_folder import RunSpec, make_run, open_run
from mission.training.until import Until


def test_the_preset_paper_has_what_the_paper_prints() -> None:
    paper = load_preset("paper")
    assert (paper.replay.kind, paper.replay.capacity, paper.training.batch) == ("per", 50_000, 128)
    assert (paper.replay.alpha, paper.replay.beta_first, paper.replay.beta_last) == (0.6, 0.4, 1.0)
    assert (paper.exploration.epsilon_first, paper.exploration.epsilon_least, paper.exploration.decay) == (
        1.0,
        0.05,
        0.995,
    )
    assert paper.exploration.at_entry_only
    assert (paper.env.reward, paper.env.decoder, paper.env.observation) == ("paper", "waypoints", "paper")
    assert not paper.td3.zero_last
    assert paper.td3.saturation_penalty == 0.0


def test_the_default_preset_closes_the_farming_and_keeps_the_actor_off_its_bounds() -> None:
    default = load_preset("default")
    assert (default.env.reward, default.env.decoder) == ("default", "detour")
    assert default.td3.zero_last
    assert default.td3.saturation_penalty > 0.0


@pytest.mark.parametrize("name", list_presets())
def test_every_preset_survives_a_file(name: str, tmp_path: Path) -> None:
    preset = load_preset(name)
    write_yaml(tmp_path / "copy.yaml", plain(preset))
    assert load_preset(str(tmp_path / "copy.yaml")) == preset
    assert preset.text


@pytest.mark.parametrize("name", list_presets())
def test_rewards_are_scaled_once(name: str) -> None:
    assert load_preset(name).td3.reward_scale == 1.0  # the tables have a scale of their own


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"td3": {"tou": 0.1}}, r"td3: unknown key 'tou'; did you mean 'tau'\?"),
        ({"tdd3": {}}, r"unknown section 'tdd3'; did you mean 'td3'\?"),
        ({"td3": {"tau": "much"}}, r"td3: 'tau' = 'much'"),
        ({"td3": {"tau": float("nan")}}, "td3"),
        ({"td3": 3}, "td3: wants 'field: value' pairs"),
        ({"replay": {"kind": "pre"}}, r"'kind' = 'pre'; did you mean 'per'\?"),
        ({"replay": {"capacity": 0}}, "'capacity' = 0"),
        ({"training": {"batch": 0}}, "'batch' = 0"),
        ({"td3": {"actor_rate": -1.0}}, r"'actor_rate' = -1.0 is outside \(0, 1\]"),
        ({"td3": {"reward_scale": float("inf")}}, "td3: 'reward_scale' = inf wants a finite number"),
        ({"td3": {"tau": 7.0}}, r"'tau' = 7.0 is outside \[0, 1\]"),
        ({"td3": {"hidden": [0]}}, r"'hidden' = \[0\] wants layers of at least 1"),
        ({"td3": {"actor_every": 0}}, "'actor_every' = 0 wants at least 1"),
        ({"replay": {"capacity": 10**14}}, "'capacity' = 100000000000000 wants at most"),
        ({"replay": {"beta_last": 2.0}}, r"'beta_last' = 2.0 is outside \[0, 1\]"),
        ({"env": {"range_sigma_m": -1.0}}, r"range_sigma_m -1.0 is outside \[0, 0.5\]"),
        ({"env": {"wind_m_s": [5.0, 1.0]}}, r"wind_m_s \[5.0, 1.0\] wants \[low, high\]"),
        ({"env": {"decoder": "detor"}}, r"unknown decoder 'detor'; did you mean 'detour'\?"),
        ({"exploration": {"kind": "greedy"}}, "'greedy'"),
    ],
)
def test_a_mistake_is_told_in_one_line_with_its_key(settings: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said) as raised:
        preset_from(settings, "my.yaml")
    assert "\n" not in str(raised.value)
    assert str(raised.value).startswith("my.yaml")


def test_an_unknown_preset_is_told_with_the_nearest() -> None:
    with pytest.raises(InputError, match=r"unknown preset 'defualt'; did you mean 'default'\?"):
        load_preset("defualt")


def test_settings_come_on_top_of_a_preset() -> None:
    preset = load_preset("default", {"replay": {"kind": "uniform"}, "td3": {"tau": 0.01}})
    assert (preset.replay.kind, preset.td3.tau) == ("uniform", 0.01)
    assert preset.td3.saturation_penalty == load_preset("default").td3.saturation_penalty


def test_a_run_is_described_by_its_folder(tmp_path: Path) -> None:
    spec = RunSpec("trajectory2", load_preset("paper"), (4, 5), Until(10, 20))
    folder = make_run(spec, tmp_path / "run")
    assert open_run(folder) == spec
    with pytest.raises(InputError, match=r"not empty.*--resume"):
        make_run(spec, folder)
    with pytest.raises(InputError, match="no run folder"):
        open_run(tmp_path)
    (folder / "run.yaml").write_text("world: trajectory2\n")
    with pytest.raises(InputError, match="'seeds' is missing"):
        open_run(folder)
