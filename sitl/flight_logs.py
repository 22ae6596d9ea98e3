"""Which flights are on record? One ULog from arming to disarming, as PX4 keeps them; memory: the log being written."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sitl.simulation import Simulation
from sitl.ulog import UlogWriter

PERIOD_MS: Final = 100


@dataclass(frozen=True, slots=True)
class FlightLog:
    """One log that can be downloaded."""

    path: Path
    utc_s: int


class FlightLogs:
    """The logs of one vehicle in a folder."""

    def __init__(self, folder: Path) -> None:
        self.logs: list[FlightLog] = []
        self._folder = folder
        self._writer: UlogWriter | None = None
        self._due_ms = 0

    def tick(self, sim: Simulation) -> None:
        """Vehicle time has passed."""
        armed = sim.autopilot.armed
        if self._writer is None:
            if armed:
                self._open(sim)
            return
        if not armed or sim.t_ms >= self._due_ms:
            self._writer.write(sim)
            self._due_ms = sim.t_ms + PERIOD_MS
        if not armed:
            self.close()

    def erase(self) -> None:
        """Forget every log but the one being written."""
        kept = self.logs[-1:] if self._writer is not None else []
        for log in self.logs[: len(self.logs) - len(kept)]:
            log.path.unlink(missing_ok=True)
        self.logs = kept

    def flush(self) -> None:
        """Bring the log to the disk."""
        if self._writer is not None:
            self._writer.flush()

    def close(self) -> None:
        """End the log that is being written."""
        if self._writer is not None:
            self._writer.close()
            self._writer = None

    def _open(self, sim: Simulation) -> None:
        path = self._folder / f"flight_{len(self.logs):03d}.ulg"
        self._writer = UlogWriter(path, sim)
        self.logs.append(FlightLog(path, (sim.boot_unix_us + sim.t_ms * 1000) // 1_000_000))
        self._due_ms = sim.t_ms
