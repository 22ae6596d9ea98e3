"""How long does one update take, sampling and priorities included? ``python -m mission.training.bench_update``.

CPU time of the process, one thread: what else runs on the machine does not count.
"""

import time

import numpy as np

from companion.policy.decoder import ACTION_SIZE
from companion.policy.observations import SIZES
from mission.training.replay import KINDS, Replay, ReplayConfig
from mission.training.td3 import TD3, TD3Config

BATCH, FILLED, UPDATES, FIRST = 128, 5000, 400, 40


def update_ms(kind: str, observation: str) -> tuple[float, float]:
    """Median and 99th percentile of one update."""
    rng = np.random.default_rng(0)
    size = SIZES[observation]
    replay = Replay(kind, 50_000, size, ACTION_SIZE, ReplayConfig(), 0)
    for k in range(FILLED):
        seen, after = rng.normal(size=(2, size)).astype(np.float32)
        action = rng.uniform(-1.0, 1.0, ACTION_SIZE).astype(np.float32)
        replay.add(seen, action, float(rng.normal()), after, 0.95, k % 50 == 0)
    learner = TD3(size, ACTION_SIZE, TD3Config(), 0)
    spent = []
    for _ in range(UPDATES):
        begin = time.process_time()
        batch = replay.sample(BATCH)
        replay.update_priorities(batch.indices, learner.update(batch)["td_errors"])
        spent.append(1000.0 * (time.process_time() - begin))
    median, worst = np.percentile(spent[FIRST:], [50, 99])
    return float(median), float(worst)


def main() -> None:
    """Print a line for each kind of replay."""
    for kind in KINDS:
        median, worst = update_ms(kind, "goal")
        print(f"{kind:8} {median:5.2f} ms, 99 % below {worst:5.2f} ms (batch {BATCH}, hidden {TD3Config().hidden})")


if __name__ == "__main__":
    main()
