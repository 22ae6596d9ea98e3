"""How is one run of the companion started and ended? Opens what it needs, turns the loop, closes everything."""

import dataclasses
import importlib.metadata
import platform
import sys
from contextlib import ExitStack, closing
from typing import Any

from companion import navigator as companion_navigator
from companion.app.config import CompanionConfig, ConfigError, check
from companion.app.logs import FlightLogs, LogFolderError
from companion.app.memory_use import peak_rss_mb
from companion.app.opening import connect, exposed, open_all
from companion.app.process import Companion, OnStatus, Say
from companion.app.session import Navigator
from companion.app.signals import StopRequest, stop_on_signals
from companion.app.status import ExitCode, Summary
from companion.core import params
from companion.core.clock import Clock, SystemClock
from companion.core.keyring import KeyFileError
from companion.core.transport import TransportError
from companion.link.lidar import LidarError
from companion.navigator.decide import policy_named
from companion.navigator.tightness import sets

DISTRIBUTIONS = ("swiftnav", "numpy", "scipy", "pymavlink")


def run(config: CompanionConfig) -> int:
    """Fly the task and return the process's exit code (``ExitCode``, or 128 + signal)."""
    return fly(config).exit_code


def fly(
    config: CompanionConfig,
    *,
    navigator: Navigator = companion_navigator,
    stop: StopRequest | None = None,
    on_status: OnStatus | None = None,
    say: Say | None = None,
    clock: Clock | None = None,
) -> Summary:
    """``run`` with everything that a caller may want to replace.

    Without ``stop`` Ctrl-C and SIGTERM are taken over, which only the main thread may do.
    """
    say = say or _to_stderr
    clock = clock or SystemClock()
    with ExitStack() as stack:
        try:
            check(config)
            for tuned in sets(config.params):
                policy_named(tuned.policy.name, tuned)  # reads profile and weights now, not in flight
            opened = open_all(config, clock, stack)
            logs = stack.enter_context(closing(FlightLogs(config.log_dir)))
        except (ConfigError, params.ParamError, KeyFileError, TransportError, LidarError, LogFolderError) as error:
            say(str(error))
            return Summary(int(ExitCode.BAD_INPUT), str(error), 0, "", str(config.log_dir))
        if stop is None:
            stop = StopRequest()
            stack.enter_context(stop_on_signals(stop))
        vehicle, lidar = connect(opened, config, logs, clock)
        logs.event("start", **_described(config))
        companion = Companion(config, vehicle, lidar, logs, navigator, clock)
        companion.say, companion.on_status = say, on_status
        warning = exposed(config)
        if warning is not None:
            say(warning)
        while companion.exit_code is None:
            companion.turn(stop)
        return _ended(companion, config, logs, say)


def _ended(companion: Companion, config: CompanionConfig, logs: FlightLogs, say: Say) -> Summary:
    assert companion.exit_code is not None
    summary = Summary(companion.exit_code, companion.reason, logs.ticks, logs.record_sha256, str(config.log_dir))
    counts = {link.transport.name: dataclasses.asdict(link.counts) for link in companion.links}
    facts = {
        "links": counts,
        "dropped_scans": companion.dropped_scans,
        "skipped_scans": companion.skipped_scans,
        "max_rss_mb": peak_rss_mb(),
    }
    logs.event("end", **facts, **dataclasses.asdict(summary))
    logs.close()
    if logs.problem is not None:
        say(logs.problem)
    return summary


def _described(config: CompanionConfig) -> dict[str, Any]:
    """Everything that the run depends on, for the log."""
    task = config.task
    return {
        "vehicle_url": config.vehicle_url,
        "lidar_url": config.lidar_url,
        "signed": config.sign_key is not None,
        "engage": str(config.engage),
        "goal_ned_m": task.goal_ned_m.tolist(),
        "down_m": task.down_m,
        "cruise_m_s": task.cruise_m_s,
        "seed": config.seed,
        "params": params.as_dict(config.params),
        "versions": {name: _version(name) for name in DISTRIBUTIONS} | {"python": platform.python_version()},
    }


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:  # run from a source tree
        return "source"


def _to_stderr(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
