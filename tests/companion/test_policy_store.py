"""Which policy files may fly: what is saved loads again, and each misfit is refused by itself."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from policy_kit import MAP, query
from safetensors.numpy import load_file, save_file

from companion.core.params import ParamError
from companion.navigator import Params
from companion.navigator.decide import policy_named
from companion.policy import store
from companion.policy.actor import Actor, from_arrays
from companion.policy.headings import NEXT_CHOICES
from companion.policy.interface import Query
from companion.policy.learned import LearnedPolicy, PolicySpec
from companion.policy.observations import SIZES
from companion.policy.store import Card, PolicyError, load_policy, save_policy


def actor(sizes: tuple[int, ...], seed: int = 0) -> Actor:
    rng = np.random.default_rng(seed)
    pairs = list(zip(sizes[1:], sizes[:-1], strict=True))
    weights = tuple(rng.normal(size=pair, scale=0.1).astype(np.float32) for pair in pairs)
    return Actor(weights, tuple(np.zeros(size, np.float32) for size in sizes[1:]))


SPEC = PolicySpec("map")
SIZE = SIZES["map"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    save_policy(tmp_path / "p", actor((SIZE, 16, 8, 10)), Card("p", SPEC, {"seed": 1}, {"success": 0.9}, ("walls",)))
    return tmp_path / "p"


def edit(folder: Path, **changes: Any) -> None:
    card = json.loads((folder / store.CARD).read_text())
    card.update(changes)
    (folder / store.CARD).write_text(json.dumps({k: v for k, v in card.items() if v is not ...}))


def asked() -> Query:
    return query(hits_ne_m=np.array([[4.1, 0.1]]))


def test_a_saved_policy_flies_as_before(folder: Path) -> None:
    loaded = load_policy(folder, MAP)
    same = LearnedPolicy("p", actor((SIZE, 16, 8, 10)), SPEC, MAP)
    (one, memory), (other, again) = loaded.propose(asked(), None), same.propose(asked(), None)
    assert one is not None and other is not None and memory is not None and again is not None
    assert one.waypoints_ne_m.tobytes() == other.waypoints_ne_m.tobytes()
    assert memory.tobytes() == again.tobytes()
    card, _ = store.read_policy(folder)
    assert (card.training, card.evaluation, card.limits) == ({"seed": 1}, {"success": 0.9}, ("walls",))


def test_a_ranking_policy_proposes_next_choices_too(tmp_path: Path) -> None:
    save_policy(tmp_path / "h", actor((SIZES["corridors"], 16, 41)), Card("h", PolicySpec("corridors", "headings")))
    offered, _ = load_policy(str(tmp_path / "h"), MAP).propose(asked(), None)
    assert offered is not None and len(offered.others_ne_m) == NEXT_CHOICES


def test_numbers_that_are_not_finite_are_no_proposal() -> None:
    broken = actor((SIZE, 16, 10))
    broken.biases[0][0] = np.nan
    assert LearnedPolicy("b", broken, SPEC, MAP).propose(asked(), None) == (None, None)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"format": 2}, "format = 2, expected 1"),
        ({"observation": "mpa"}, "observation = 'mpa'; did you mean 'map'?"),
        ({"observation": "corridors"}, f"observation_size = {SIZE}, expected {SIZES['corridors']}"),
        ({"observation_size": 72}, f"observation_size = 72, expected {SIZE}"),
        ({"head": "heading"}, "head = 'heading'; did you mean 'headings'?"),
        ({"head": "headings"}, "action_size = 10, expected 41"),
        ({"action_size": 3}, "action_size = 3, expected 10"),
        ({"decoder": "detuor"}, "decoder = 'detuor'; did you mean 'detour'?"),
        ({"decoder_params": {}}, "decoder_params: key 'reach_m' is missing"),
        ({"hidden": [16, 9]}, "shape of layer1.weight = float32 (8, 16), expected float32 (9, 16)"),
        ({"hidden": [16]}, "layer2.bias is not expected, hidden = [16]"),
        ({"hidden": [16, 8, 8]}, "layer3.bias is missing, hidden = [16, 8, 8]"),
        ({"hidden": 16}, "hidden = 16, expected a list"),
        ({"sha256": "0" * 64}, "the card expects '000"),
        ({"sha256": ...}, "key 'sha256' is missing"),
        ({"observaton": "map"}, "unknown key 'observaton'; did you mean 'observation'?"),
    ],
)
def test_a_card_that_does_not_fit_is_refused(folder: Path, changes: dict[str, Any], said: str) -> None:
    edit(folder, **changes)
    with pytest.raises(PolicyError) as error:
        load_policy(folder, MAP)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_tampered_or_truncated_actor_is_refused(folder: Path) -> None:
    path = folder / store.ACTOR
    whole = path.read_bytes()
    path.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    with pytest.raises(PolicyError, match="sha256 = "):
        load_policy(folder, MAP)
    path.write_bytes(whole[:-100])
    with pytest.raises(PolicyError, match="sha256 = "):
        load_policy(folder, MAP)


def test_a_truncated_actor_with_its_own_hash_is_refused_too(folder: Path) -> None:
    path = folder / store.ACTOR
    path.write_bytes(path.read_bytes()[:-100])
    edit(folder, sha256=hashlib.sha256(path.read_bytes()).hexdigest())
    with pytest.raises(PolicyError, match="not a whole safetensors file"):
        load_policy(folder, MAP)


def test_weights_that_are_not_finite_are_refused(folder: Path) -> None:
    named = load_file(folder / store.ACTOR)
    named["layer0.bias"][0] = np.inf
    save_policy(folder, from_arrays(named), Card("p", SPEC))
    with pytest.raises(PolicyError, match=r"layer0\.bias holds a number that is not finite"):
        load_policy(folder, MAP)


def test_weights_of_another_precision_are_refused(folder: Path) -> None:
    named = load_file(folder / store.ACTOR)
    save_file({key: value.astype(np.float64) for key, value in named.items()}, folder / store.ACTOR)
    edit(folder, sha256=hashlib.sha256((folder / store.ACTOR).read_bytes()).hexdigest())
    with pytest.raises(PolicyError, match="float64"):
        load_policy(folder, MAP)


@pytest.mark.parametrize(
    ("name", "text"), [(store.CARD, "{"), (store.CARD, "[]"), (store.CARD, None), (store.ACTOR, None)]
)
def test_files_that_are_missing_or_no_json_are_refused(folder: Path, name: str, text: str | None) -> None:
    if text is None:
        (folder / name).unlink()
    else:
        (folder / name).write_text(text)
    with pytest.raises(PolicyError, match=name.replace(".", r"\.")):
        load_policy(folder, MAP)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(PolicyError, match="unknown policy 'forrest'"):
        load_policy("forrest", MAP)


def test_the_navigator_knows_policies_by_name_and_by_folder(folder: Path) -> None:
    assert policy_named("geometric", Params()).name == "geometric"
    assert policy_named(str(folder), Params()).name == "p"
    with pytest.raises(ParamError, match="unknown policy 'geometrc'; did you mean 'geometric'"):
        policy_named("geometrc", Params())


def test_an_actor_that_does_not_fit_its_card_is_not_saved(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match="action_size = 9, expected 10"):
        save_policy(tmp_path / "p", actor((SIZE, 8, 9)), Card("p", SPEC))
    assert not (tmp_path / "p").exists()


def test_a_full_disk_leaves_the_policy_that_was_there(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(store.os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        save_policy(folder, actor((SIZE, 16, 8, 10), seed=5), Card("p", SPEC))
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
