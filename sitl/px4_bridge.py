"""How does a real PX4 fly our aircraft? Sensors out, motor outputs back, one pair a step, over its simulator port.

PX4 connects (TCP 4560 + instance) and takes its clock from HIL_SENSOR. Until its first motor outputs the aircraft
stands and time runs freely; from then on each step waits for its outputs. The LiDAR goes to the companion on a link of
its own, since PX4 does not pass it on; everything else the companion has from PX4 itself.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from companion.core.clock import Clock
from companion.core.codec import encode_scan
from companion.core.mavlink import Connection
from companion.core.tcp import Tcp
from companion.core.transport import wait_readable
from sitl.hil_sensors import HilSensors
from sitl.pacer import Pacer
from sitl.px4_ear import Px4Ear
from sitl.px4_plant import Plant
from sitl.simulation import STEP_MS
from sitl.truth_log import TruthSink

Message = Any  # a MAVLink_*_message object

HIL_PORT: Final = 4560
LIDAR_PORT: Final = 14650  # where the companion listens for OBSTACLE_DISTANCE; instance N adds N to both
LIDAR_COMPONENT: Final = mav.MAV_COMP_ID_OBSTACLE_AVOIDANCE
MOTORS: Final = 4

ANSWER_WALL_S: Final = 1.0  # patience for one set of motor outputs; a PX4 that is late is not stopped for ever
POLL_WALL_S: Final = 0.02  # the stop request is looked at this often
FLUSH_WALL_S: Final = 1.0


@dataclass(frozen=True, slots=True)
class BridgeLinks:
    """Everything that the bridge talks through."""

    hil: Connection  # over ``tcp``
    tcp: Tcp
    lidar: Connection
    ear: Px4Ear


class Bridge:
    """One PX4 and one aircraft."""

    def __init__(
        self,
        plant: Plant,
        sensors: HilSensors,
        links: BridgeLinks,
        speed: float,
        clock: Clock,
        truth: TruthSink | None = None,
        say: Callable[[str], None] = lambda _text: None,
    ) -> None:
        """``speed``: vehicle seconds a wall second; inf: as fast as PX4 answers."""
        self.plant = plant
        self.missed = 0  # steps that PX4 did not answer in time
        self._sensors = sensors
        self._links = links
        self._speed = speed
        self._clock = clock
        self._truth = truth
        self._say = say
        self._controls = [0.0] * MOTORS
        self._answered_us = -1  # time of the newest motor outputs; -1: none yet
        self._pacer = Pacer(min(speed, 1.0), STEP_MS / 1e3)
        self._flush_s = -math.inf
        self._lockstep_from: tuple[float, int] | None = None  # wall time and step

    @property
    def realtime_factor(self) -> float | None:
        """Vehicle time over wall time since the first motor outputs."""
        if self._lockstep_from is None:
            return None
        began_s, step = self._lockstep_from
        return (self.plant.step - step) * STEP_MS / 1e3 / max(self._clock.now_s() - began_s, 1e-9)

    def run(self, stopped: Callable[[], bool]) -> None:
        """Until ``stopped()``, or until PX4 has come and gone."""
        links = self._links
        while not stopped() and not links.tcp.clients:
            wait_readable([links.tcp], POLL_WALL_S, self._clock)
            links.hil.receive()
        if links.tcp.clients:
            self._say("PX4 has connected")
        while not stopped() and links.tcp.clients:
            self._step(stopped)
        if not stopped():
            self._say("PX4 has closed its connection")
        factor = self.realtime_factor
        if factor is not None:
            self._say(f"flown in lockstep with PX4 at {factor:.1f} times real time, {self.missed} steps unanswered")
        counts = links.hil.counts
        if counts.bad_bytes or counts.unknown:
            self._say(f"simulator link: {counts.bad_bytes} bytes of no packet, {counts.unknown} unknown packets")

    def flush(self) -> None:
        """Bring the truth to the disk."""
        if self._truth is not None:
            self._truth.flush()

    def _step(self, stopped: Callable[[], bool]) -> None:
        plant = self.plant
        plant.advance(self._controls, plant.status.armed)
        self._links.hil.send(*self._sensors.read(plant.step, plant.truth))
        self._await_controls(stopped)
        if plant.scan_due:
            self._at_scan()
        self._pace(stopped)

    def _await_controls(self, stopped: Callable[[], bool]) -> None:
        """Motor outputs for this instant; before the first ones, whatever is there."""
        self._take_controls()
        time_us = self.plant.step * STEP_MS * 1000
        deadline_s = self._clock.now_s() + ANSWER_WALL_S
        while 0 <= self._answered_us < time_us and self._links.tcp.clients and not stopped():
            if self._clock.now_s() > deadline_s:
                self._miss()
                return
            wait_readable([self._links.tcp], POLL_WALL_S, self._clock)
            self._take_controls()

    def _take_controls(self) -> None:
        now_us = self.plant.step * STEP_MS * 1000
        for message in self._links.hil.receive():
            if message.get_msgId() != mav.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS or message.time_usec > now_us:
                continue  # no answer to any step so far
            outputs = message.controls[:MOTORS]
            self._controls = [c if math.isfinite(c) else 0.0 for c in outputs]
            self.plant.status.armed = bool(message.mode & mav.MAV_MODE_FLAG_SAFETY_ARMED)
            if self._answered_us < 0:
                self._lockstep_from = (self._clock.now_s(), self.plant.step)
                self._pacer = Pacer(self._speed, STEP_MS / 1e3)
                self._say("PX4 answers: lockstep")
            self._answered_us = message.time_usec

    def _miss(self) -> None:
        self.missed += 1
        if self.missed == 1:
            self._say(f"PX4 sent no motor outputs for {ANSWER_WALL_S:g} s: going on without")

    def _at_scan(self) -> None:
        now_s = self._clock.now_s()
        self._links.ear.listen()
        self._links.lidar.send(encode_scan(self.plant.observe()))
        self._links.lidar.receive()  # the companion's heartbeat: only to be taken off the socket
        if self._truth is not None:
            self._truth.write(self.plant.rows)
            if now_s - self._flush_s > FLUSH_WALL_S:
                self._flush_s = now_s
                self._truth.flush()
        self.plant.rows.clear()

    def _pace(self, stopped: Callable[[], bool]) -> None:
        while not stopped():
            wait_s = self._pacer.wait_s(self._clock.now_s(), self.plant.step + 1)
            if wait_s <= 0.0:
                return
            self._clock.sleep_s(min(wait_s, POLL_WALL_S))
