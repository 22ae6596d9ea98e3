"""How is a policy kept, and is this file one that may fly? A folder: ``actor.safetensors`` and ``card.json``.

The card says what the numbers mean, what the actor was trained on, how it did and where it ends; and the hash of the
weights. Whatever does not fit is refused with one line that names file, key, value and what was expected.
"""

import dataclasses
import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from companion.core.gridmap import MapParams
from companion.core.params import ParamError, nearest
from companion.policy import decoder
from companion.policy.actor import Actor, arrays, from_arrays
from companion.policy.decoder import DecoderParams
from companion.policy.learned import HEADS, LearnedPolicy, PolicySpec
from companion.policy.observations import SIZES

POLICIES = Path(__file__).resolve().parents[2] / "models" / "policies"  # beside companion, in a checkout as in a wheel
FORMAT = 1  # counts up whenever an observation, a decoder or the card changes its meaning
ACTOR, CARD = "actor.safetensors", "card.json"
KEYS = (
    "format", "name", "observation", "observation_size", "head", "decoder", "decoder_params", "hidden", "action_size",
    "sha256", "training", "evaluation", "limits",
)  # fmt: skip


class PolicyError(ParamError):
    """A policy that may not fly; the text is one line that names file, key, value and what was expected."""


@dataclass(frozen=True, slots=True)
class Card:
    """What is written of a policy besides its weights."""

    name: str
    spec: PolicySpec
    training: Mapping[str, Any] = field(default_factory=dict)  # worlds, seeds, preset, commit, ...
    evaluation: Mapping[str, Any] = field(default_factory=dict)  # figures by set
    limits: tuple[str, ...] = ()  # what it is not good for, in words


def shipped() -> list[str]:
    """Names of the policies that come with the package."""
    return sorted(path.parent.name for path in POLICIES.glob(f"*/{CARD}"))


def load_policy(policy: str | Path, map_params: MapParams) -> LearnedPolicy:
    """A policy by the name of a shipped one or by its folder. Raises PolicyError."""
    card, actor = read_policy(folder_of(policy))
    return LearnedPolicy(card.name, actor, card.spec, map_params)


def is_folder(policy: str | Path) -> bool:
    """Does this say where a policy is kept? What holds a slash does, anything else is the name of a shipped one."""
    return isinstance(policy, Path) or "/" in policy or os.sep in policy


def folder_of(policy: str | Path) -> Path:
    """Where a policy is kept. Raises PolicyError with the nearest name."""
    if is_folder(policy):
        return Path(policy)
    known = shipped()
    if policy not in known:
        raise PolicyError(f"unknown policy '{policy}'{nearest(str(policy), known) if known else ''}")
    return POLICIES / policy


def digest_of(policy: str | Path) -> str:
    """sha256 of the weights of a policy that was read without complaint. Raises PolicyError."""
    return hashlib.sha256(_bytes(folder_of(policy) / ACTOR)).hexdigest()


def read_policy(folder: Path) -> tuple[Card, Actor]:
    """Card and actor from a folder, everything checked. Raises PolicyError."""
    data, weights = _json(folder / CARD), _bytes(folder / ACTOR)
    where = str(folder / CARD)
    _expect_keys(data, KEYS, where)
    _expect(data, "format", FORMAT, where)
    _expect_one_of(data, "observation", list(SIZES), where)
    _expect_one_of(data, "head", list(HEADS), where)
    _expect_one_of(data, "decoder", list(decoder.NAMES), where)
    _expect(data, "observation_size", SIZES[data["observation"]], where)
    _expect(data, "action_size", HEADS[data["head"]], where)
    params = _decoder_params(data["decoder_params"], where)
    digest = hashlib.sha256(weights).hexdigest()
    if data["sha256"] != digest:
        raise PolicyError(f"{folder / ACTOR}: sha256 = {digest}, the card expects {data['sha256']!r}")
    actor = _actor(weights, data, folder / ACTOR)
    spec = PolicySpec(data["observation"], data["head"], data["decoder"], params)
    return Card(str(data["name"]), spec, data["training"], data["evaluation"], tuple(data["limits"])), actor


def save_policy(folder: Path, actor: Actor, card: Card) -> None:
    """Write a policy. Each file is complete or untouched; the card comes last and does not fit to other weights.

    Raises PolicyError if the actor does not fit the card, OSError if the disk does not take it.
    """
    weights = save(arrays(actor), metadata={"format": "np"})
    inputs, *hidden, outputs = actor.sizes()
    spec = card.spec
    data = {
        "format": FORMAT,
        "name": card.name,
        "observation": spec.observation,
        "observation_size": inputs,
        "head": spec.head,
        "decoder": spec.decoder,
        "decoder_params": dataclasses.asdict(spec.decoder_params),
        "hidden": hidden,
        "action_size": outputs,
        "sha256": hashlib.sha256(weights).hexdigest(),
        "training": dict(card.training),
        "evaluation": dict(card.evaluation),
        "limits": list(card.limits),
    }
    _expect(data, "observation_size", SIZES[spec.observation], card.name)
    _expect(data, "action_size", HEADS[spec.head], card.name)
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(data, indent=2, allow_nan=False) + "\n"
    for name, content in ((ACTOR, weights), (CARD, text.encode())):
        _replace(folder / name, content)


def _replace(path: Path, content: bytes) -> None:
    """The whole content under that name, or what was there before."""
    part = path.with_name(f"{path.name}.part")
    try:
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _json(path: Path) -> dict[str, Any]:
    text = _bytes(path)
    try:
        data = json.loads(text)
    except ValueError as error:
        raise PolicyError(f"{path}: not JSON: {error}") from error
    if not isinstance(data, dict):
        raise PolicyError(f"{path}: wants an object of keys, got {type(data).__name__}")
    return data


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise PolicyError(f"{path}: {error.strerror or error}") from error


def _expect_keys(data: dict[str, Any], keys: tuple[str, ...], where: str) -> None:
    for key in data:
        if key not in keys:
            raise PolicyError(f"{where}: unknown key '{key}'{nearest(key, list(keys))}")
    for key in keys:
        if key not in data:
            raise PolicyError(f"{where}: key '{key}' is missing")
    kinds = {"hidden": list, "limits": list, "training": dict, "evaluation": dict, "decoder_params": dict}
    for key, kind in kinds.items():
        if key in keys and not isinstance(data[key], kind):
            raise PolicyError(f"{where}: {key} = {data[key]!r}, expected a {kind.__name__}")


def _expect(data: dict[str, Any], key: str, expected: int, where: str) -> None:
    if data[key] != expected:
        raise PolicyError(f"{where}: {key} = {data[key]!r}, expected {expected}")


def _expect_one_of(data: dict[str, Any], key: str, known: list[str], where: str) -> None:
    if data[key] not in known:
        raise PolicyError(f"{where}: {key} = {data[key]!r}{nearest(str(data[key]), known)}")


def _decoder_params(data: dict[str, Any], where: str) -> DecoderParams:
    names = tuple(f.name for f in dataclasses.fields(DecoderParams))
    _expect_keys(data, names, f"{where}: decoder_params")
    for key, value in data.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value < np.inf:
            raise PolicyError(f"{where}: decoder_params: {key} = {value!r}, expected a number from 0 up")
    return DecoderParams(**data)


def _actor(weights: bytes, data: dict[str, Any], path: Path) -> Actor:
    try:
        named = load(weights)
    except SafetensorError as error:
        raise PolicyError(f"{path}: not a whole safetensors file: {error}") from error
    hidden = data["hidden"]
    sizes = [data["observation_size"], *hidden, data["action_size"]]
    shapes: dict[str, tuple[int, ...]] = {}
    for k in range(len(sizes) - 1):
        shapes[f"layer{k}.weight"], shapes[f"layer{k}.bias"] = (sizes[k + 1], sizes[k]), (sizes[k + 1],)
    for key in sorted(shapes.keys() ^ named.keys()):
        raise PolicyError(f"{path}: {key} is {'missing' if key in shapes else 'not expected'}, hidden = {hidden}")
    for key, shape in shapes.items():
        array = named[key]
        if array.shape != shape or array.dtype != np.float32:
            raise PolicyError(f"{path}: shape of {key} = {array.dtype} {array.shape}, expected float32 {shape}")
        if not np.isfinite(array).all():
            raise PolicyError(f"{path}: {key} holds a number that is not finite")
    return from_arrays(named)
