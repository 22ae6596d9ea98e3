"""A run of a benchmark as tests need it."""

from mission.bench.rows import Row


def row(run=0, world="barn_1", success=True, time_s=10.0, reference_m=12.0, **changes):
    end = "goal" if success else "contact"
    values = {
        "cell": "barn", "run": run, "world": world, "seed": 1, "end": end, "success": success,
        "collision": not success, "struck": False, "timeout": False, "time_s": time_s, "path_m": 12.0,
        "shortest_m": 9.0, "reference_m": reference_m, "mean_m_s": 1.2, "min_clearance_m": 0.1, "jerk_m2_s6": 2.0,
        "switches": 2, "switches_bound": 11, "start_m_s": 0.0, "decision_ms": "1.00 3.00", "tick_p50_ms": 0.5,
        "tick_p99_ms": 1.0, "commit": "abc",
    }  # fmt: skip
    return Row(**{**values, **changes})
