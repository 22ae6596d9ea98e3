"""What would have happened with left and right exchanged? Mirrored transitions, for worlds without a favoured side."""

from dataclasses import replace

import numpy as np

from companion.policy.decoder import mirror_action
from companion.policy.observations import mirror_observation
from mission.training.replay import F32, Batch


def half_mirrored(batch: Batch, observation: str, decoder: str) -> Batch:
    """The batch with every second transition mirrored. Of no use where training knows a single, lopsided map."""
    obs, action, next_obs = batch.obs.copy(), batch.action.copy(), batch.next_obs.copy()
    obs[1::2] = _seen(observation, obs[1::2])
    next_obs[1::2] = _seen(observation, next_obs[1::2])
    action[1::2] = mirror_action(decoder, action[1::2].astype(np.float64))
    return replace(batch, obs=obs, action=action, next_obs=next_obs)


def _seen(observation: str, rows: F32) -> F32:
    return mirror_observation(observation, rows.astype(np.float64)).astype(np.float32)
