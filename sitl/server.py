"""How does the simulation meet wall time and the links? One loop: serve, advance, tell.

Paced: vehicle time follows wall time at a given speed. Lockstep: after each scan the vehicle waits for the setpoint
that answers it, so that a flight over sockets is reproducible; without an answer it says so once and goes on paced.
Gates stop vehicle time where a flight waits for a command. Heartbeats and streams never stop.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from companion.core.clock import Clock
from companion.core.transport import wait_readable
from sitl import messages
from sitl.autopilot import StatusText
from sitl.gates import GateKeeper
from sitl.link import Link
from sitl.messages import BUILDERS
from sitl.pacer import Pacer
from sitl.router import Router
from sitl.simulation import STEP_MS, Observation, Simulation
from sitl.streams import NAVIGATION
from sitl.truth_log import TruthFile

Message = Any  # a MAVLink_*_message object

ANSWER_WALL_S: Final = 2.0  # lockstep: patience for one setpoint
POLL_WALL_S: Final = 0.02  # heartbeats and the stop request are looked at this often
FLUSH_WALL_S: Final = 1.0
READY_NEWS: Final = (mav.MAVLINK_MSG_ID_SYS_STATUS, mav.MAVLINK_MSG_ID_HOME_POSITION)
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
    ) -> None:
        self.sim = sim
        self.lockstep = config.lockstep
        self._config = config
        self._links = list(links)
        self._transports = [link.connection.transport for link in links]
        self._companion = next((link for link in links if link.companion), None)
        self._clock = clock
        self._truth = truth
        self._say = say
        self._router = Router(sim, system_id, lambda: clock.wall_us() * 1000)
        self._gates = GateKeeper(companion=config.lockstep) if config.gates else None
        self._pacer = Pacer(config.speed, STEP_MS / 1e3)
        self._told: tuple[object, ...] = ()  # what the last heartbeats said
        self._told_ready = False
        self._text_number = 0
        self._flush_s = -math.inf

    def run(self, stopped: Callable[[], bool]) -> None:
        """Until ``stopped()``."""
        while not stopped():
            self._serve(0.0)
            if self._gates is not None and self._gates.waiting(self.sim, self._router.companion_heard):
                self._pacer.restart()
                self._serve(POLL_WALL_S)
            elif self.lockstep:
                self._lockstep_scan(stopped)
            else:
                self._paced_slice()

    # --- vehicle time -----------------------------------------------------------------------------------------

    def _lockstep_scan(self, stopped: Callable[[], bool]) -> None:
        """One scan and its answer."""
        while not stopped():
            due = self._pacer.steps_due(self._clock.now_s(), self.sim.step, self.sim.scan_steps)
            if due >= self.sim.scan_steps:
                break
            self._serve(POLL_WALL_S / 10)
        self._deliver(self.sim.advance_to_scan())
        scan_ms = self.sim.t_ms
        deadline_s = self._clock.now_s() + ANSWER_WALL_S
        while self._router.answered_ms < scan_ms and not self.sim.finished and not stopped():
            left_s = deadline_s - self._clock.now_s()
            if left_s <= 0.0:
                self._leave_lockstep()
                return
            self._serve(min(left_s, POLL_WALL_S))

    def _leave_lockstep(self) -> None:
        self.lockstep = False
        self._pacer = Pacer(self._config.speed if math.isfinite(self._config.speed) else 1.0, STEP_MS / 1e3)
        text = f"Lockstep off: no setpoint in {ANSWER_WALL_S:.0f} s"
        self.sim.autopilot.texts.append(StatusText(mav.MAV_SEVERITY_WARNING, text))

    def _paced_slice(self) -> None:
        """What wall time allows, at most to the next navigation message."""
        step = self.sim.step
        most = SLICE_STEPS - step % SLICE_STEPS
        due = self._pacer.steps_due(self._clock.now_s(), step, most)
        if due == 0:
            self._serve(min(self._pacer.wait_s(self._clock.now_s(), step + 1), POLL_WALL_S))
            return
        observation = self.sim.advance(due)
        if observation is not None:
            self._deliver(observation)
            return
        self.sim.refresh()
        if self._companion is not None:
            self._stream(self._companion, self._companion.vehicle.due(self.sim.t_ms * 1000))

    # --- talking ----------------------------------------------------------------------------------------------

    def _serve(self, timeout_s: float) -> None:
        """Wait for messages at most ``timeout_s``, act on them, send what is due."""
        if timeout_s > 0.0:
            wait_readable(self._transports, timeout_s, self._clock)
        for link in self._links:
            for message in link.connection.receive():
                self._router.handle(link, message)
        self._tell_changes()
        now_s = self._clock.now_s()
        now_us = round(now_s * 1e6)
        for link in self._links:
            self._stream(link, link.wall.due(now_us))
        if now_s - self._flush_s > FLUSH_WALL_S:
            self._flush_s = now_s
            self.flush()

    def flush(self) -> None:
        """Bring the logs to the disk."""
        for link in self._links:
            link.flush()
        if self._truth is not None:
            self._truth.flush()

    def _deliver(self, observation: Observation) -> None:
        """A scan: changes first, then the companion's inputs with the scan last, in one datagram."""
        if self._truth is not None:
            self._truth.write(self.sim.rows)
        self._tell_changes()
        link = self._companion
        if link is None:
            return
        bundle: list[Message] = []
        if self.lockstep:
            bundle += [messages.heartbeat(self.sim), messages.extended_sys_state(self.sim)]
        bundle += [messages.attitude_quaternion(self.sim), messages.local_position_ned(self.sim)]
        link.vehicle.sent(NAVIGATION, self.sim.t_ms * 1000)
        if link.wall.interval_us(mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE):
            bundle.append(messages.obstacle_distance(self.sim))
        link.connection.send(*bundle)

    def _tell_changes(self) -> None:
        """Texts at once; HEARTBEAT and EXTENDED_SYS_STATE at once when they say something new."""
        ap = self.sim.autopilot
        texts, ap.texts[:] = list(ap.texts), []
        told = (ap.mode, ap.armed, ap.failsafe is not None, ap.ready, ap.landed_state)
        if told != self._told:
            self._told = told
            for link in self._links:
                link.connection.send(messages.heartbeat(self.sim), messages.extended_sys_state(self.sim))
        if ap.ready and not self._told_ready:
            self._told_ready = True
            for link in self._links:
                self._stream(link, list(READY_NEWS))
        for text in texts:
            self._text_number = self._text_number % 0xFFFF + 1
            self._say(text.text)
            for message in messages.status_texts(text.severity, text.text, self._text_number):
                for link in self._links:
                    link.connection.send(message)

    def _stream(self, link: Link, message_ids: list[int]) -> None:
        built = (BUILDERS[i](self.sim) for i in message_ids if not (link.companion and i == _SCAN))
        present = [message for message in built if message is not None]
        if present:
            link.connection.send(*present)


_SCAN: Final = mav.MAVLINK_MSG_ID_OBSTACLE_DISTANCE  # goes to the companion with every scan, not by the schedule
