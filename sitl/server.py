"""How does the simulation meet wall time and the links? One loop: serve, advance, tell.

Paced: vehicle time follows wall time at a given speed. Lockstep: after each scan the vehicle waits for the setpoint
that answers it, so that a flight over sockets is reproducible; without an answer it says so once and goes on paced.
Gates stop vehicle time where a flight waits for a command. Heartbeats and streams never stop.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from pymavlink.dialects.v20 import common as mav

from companion.core.clock import Clock
from companion.core.transport import Waitable, wait_readable
from sitl.airspace import Airspace
from sitl.answers import StatusText
from sitl.flight_logs import FlightLogs
from sitl.gates import GateKeeper
from sitl.link import Link
from sitl.pacer import Pacer
from sitl.param_file import ParamFile
from sitl.router import Router
from sitl.simulation import STEP_MS, Simulation
from sitl.truth_log import TruthFile
from sitl.voice import ScanBundle, Voice

ANSWER_WALL_S: Final = 2.0  # lockstep: patience for one setpoint
POLL_WALL_S: Final = 0.02  # the stop request is looked at this often
REST_WALL_S: Final = 0.001  # between two looks at the streams, whatever rate a client has asked for
FLUSH_WALL_S: Final = 1.0
SLICE_STEPS: Final = 5  # paced: 20 ms, the finest navigation stream


@dataclass(frozen=True, slots=True)
class RunConfig:
    """How vehicle time runs."""

    speed: float = 1.0  # vehicle seconds a wall second; inf: as fast as the answers come
    lockstep: bool = False
    gates: bool = False


class Server:
    """One vehicle on its links."""

    def __init__(
        self,
        sim: Simulation,
        links: Sequence[Link],
        config: RunConfig,
        clock: Clock,
        system_id: int = 1,
        truth: TruthFile | None = None,
        say: Callable[[str], None] = lambda _text: None,
        logs: FlightLogs | None = None,
        param_file: ParamFile | None = None,
        airspace: Airspace | None = None,
    ) -> None:
        """``airspace``: where the other vehicles of its world are, and what time it is; None: it flies alone."""
        self.sim = sim
        sim.boot_unix_us = clock.wall_us()
        self.lockstep = config.lockstep
        self._config = config
        self._links = list(links)
        self._waits_on: list[Waitable] = [link.connection.transport for link in links]
        if airspace is not None:
            self._waits_on.append(airspace)
        self._airspace = airspace
        self._clock = clock
        self._truth = truth
        self._logs = logs
        self._param_file = param_file
        self._voice = Voice(sim, links, say)
        self._router = Router(sim, system_id, logs)
        self._gates = GateKeeper(companion=config.lockstep, end=airspace is None) if config.gates else None
        self._pacer = Pacer(config.speed, STEP_MS / 1e3)
        self._ahead: ScanBundle | None = None  # taken already, to be delivered after the answer to the one before
        self._flush_s = -math.inf

    def run(self, stopped: Callable[[], bool]) -> None:
        """Until ``stopped()``."""
        if self._airspace is not None:
            self._airspace.tell(self.sim)
        while not (stopped() or self._alone_now()):
            if self._ahead is None:
                self._serve(0.0)
            if self._airspace is not None and self._airspace.waiting:
                self._serve(POLL_WALL_S)
            elif self._ahead is None and self._stands():
                self._pacer.restart()
                self._serve(POLL_WALL_S)
            elif self.lockstep:
                self._lockstep_scan(stopped)
            else:
                self._paced_slice()

    def flush(self) -> None:
        """Bring logs and parameters to the disk."""
        for link in self._links:
            link.flush()
        if self._param_file is not None:
            self._param_file.save(self.sim.autopilot.params)
        if self._truth is not None:
            self._truth.flush()

    def _serve(self, timeout_s: float) -> None:
        """Send what is due, then wait for messages at most ``timeout_s``, or until more is due, and act on them."""
        now_s = self._clock.now_s()
        self._voice.stream_by_wall(round(now_s * 1e6))
        if now_s - self._flush_s > FLUSH_WALL_S:
            self._flush_s = now_s
            self.flush()
        if timeout_s > 0.0:
            due_s = max(self._voice.next_by_wall_us / 1e6 - now_s, REST_WALL_S)
            wait_readable(self._waits_on, min(timeout_s, due_s), self._clock)
        if self._airspace is not None:
            self._airspace.listen()
        for link in self._links:
            for message in link.connection.receive():
                self._router.handle(link, message)
        self._router.tick(self._links, now_s)
        self._voice.tell_changes()

    def _stands(self) -> bool:
        """Does vehicle time stand still? At a gate, and after a flight in lockstep: there is nothing to answer."""
        return self._gate_waits() or (self.lockstep and self._over())

    def _over(self) -> bool:
        """Has everybody flown?"""
        return self.sim.finished if self._airspace is None else self._airspace.over(self.sim)

    def _alone_now(self) -> bool:
        """Has the hub of the other vehicles gone?"""
        return self._airspace is not None and self._airspace.closed

    def _gate_waits(self) -> bool:
        gates = self._gates
        return gates is not None and gates.waiting(self.sim, self._router.companion_heard) is not None

    # --- lockstep ---------------------------------------------------------------------------------------------

    def _lockstep_scan(self, stopped: Callable[[], bool]) -> None:
        """One scan and its answer. While the companion thinks, the vehicle flies on to the next scan, no further."""
        if self._ahead is None and self._airspace is not None:
            self._ahead = self._next_scan()  # delivered when everybody has come to its instant
            return
        scan, self._ahead = self._ahead or self._next_scan(), None
        self._pace(scan, stopped)
        self._voice.deliver(scan)
        deadline_s = self._clock.now_s() + ANSWER_WALL_S
        if self.sim.runs_ahead and not self._stands():
            self._ahead = self._next_scan()
        while self._router.answered_ms < scan.t_ms and not self._is_last(scan) and not stopped():
            left_s = deadline_s - self._clock.now_s()
            if left_s <= 0.0:
                self._leave_lockstep()
                return
            self._serve(min(left_s, POLL_WALL_S))

    def _is_last(self, scan: ScanBundle) -> bool:
        """Does nobody answer the scan that was delivered? The one before the vehicle had disarmed is still answered."""
        return scan.finished or (self.sim.finished and self._ahead is None)

    def _next_scan(self) -> ScanBundle:
        self.sim.advance_to_scan()
        self._at_scan()
        return self._voice.bundle(with_status=True)

    def _pace(self, scan: ScanBundle, stopped: Callable[[], bool]) -> None:
        """Lockstep at a given speed: no scan before its time."""
        while not stopped():
            wait_s = self._pacer.wait_s(self._clock.now_s(), scan.t_ms // STEP_MS)
            if wait_s <= 0.0:
                return
            self._serve(min(wait_s, POLL_WALL_S))

    def _leave_lockstep(self) -> None:
        self.lockstep = False
        if self._ahead is not None:
            self._voice.deliver(self._ahead)
            self._ahead = None
        self._pacer = Pacer(self._config.speed if math.isfinite(self._config.speed) else 1.0, STEP_MS / 1e3)
        text = f"Lockstep off: no setpoint in {ANSWER_WALL_S:.0f} s"
        self.sim.autopilot.texts.append(StatusText(mav.MAV_SEVERITY_WARNING, text))

    # --- paced ------------------------------------------------------------------------------------------------

    def _paced_slice(self) -> None:
        """What wall time allows, at most to the next navigation message."""
        step = self.sim.step
        due = self._pacer.steps_due(self._clock.now_s(), step, SLICE_STEPS - step % SLICE_STEPS)
        if due == 0:
            self._serve(min(self._pacer.wait_s(self._clock.now_s(), step + 1), POLL_WALL_S))
        elif self.sim.advance(due) is not None:
            self._at_scan()
            self._voice.deliver(self._voice.bundle(with_status=self.sim.finished))  # else it comes by wall time
        else:
            self.sim.refresh()
            self._voice.stream_by_vehicle()

    def _at_scan(self) -> None:
        if self._airspace is not None:
            self._airspace.tell(self.sim)
        if self._logs is not None:
            self._logs.tick(self.sim)
        if self._truth is not None:
            self._truth.write(self.sim.rows)
        self.sim.rows.clear()
