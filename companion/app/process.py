"""How does the navigator meet the world? The loop: receive, assemble, tick, send, record, and the watchdogs around it.

Before OFFBOARD every scan is answered with the vehicle's own position; in OFFBOARD with the navigator's setpoint; once
the vehicle has flown and is disarmed the last scan is answered and the run is over. The companion never arms. Its
own failures end in a hold: a scan that stops, an exception in the tick, a request to stop.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import common as mav

from companion.app.config import CompanionConfig, Engage
from companion.app.logs import FlightLogs
from companion.app.session import HoldReason, Navigator, Session, decided, is_flying
from companion.app.signals import StopRequest
from companion.app.status import ExitCode, StatusLine, status_line
from companion.app.watch import ModeRequest, VehicleWatch, may_engage, scan_lost
from companion.core import codec
from companion.core.clock import Clock
from companion.core.inputs import Inputs
from companion.core.mavlink import Connection
from companion.core.transport import wait_readable
from companion.core.types import Setpoint
from companion.link.assembler import Assembler
from companion.link.lidar import Lidar
from companion.link.vehicle_clock import VehicleClock

Message = Any  # a MAVLink_*_message object

TURN_S = 0.05  # longest wait for a message; watchdogs and heartbeat are looked at this often
HEARTBEAT_S = 1.0
STATUS_S = 0.2  # between two status lines; logs are flushed as often
HOLD_STEP_S = 0.05  # vehicle time between two hold setpoints: well above the 10 Hz that keep OFFBOARD alive
HAND_BACK_S = 2.0  # wall time the autopilot has to take over when we stop
NO_SCAN_HINT_S = 5.0  # vehicle time without any scan after which the user is told

OnStatus = Callable[[StatusLine], None]
Say = Callable[[str], None]


class Companion:
    """The process between two sockets; ``turn`` it until ``exit_code`` is set."""

    def __init__(
        self,
        config: CompanionConfig,
        vehicle: Connection,
        lidar: Lidar | None,
        logs: FlightLogs,
        navigator: Navigator,
        clock: Clock,
    ) -> None:
        """``lidar`` None: the vehicle passes the scans on."""
        self.exit_code: int | None = None
        self.reason = ""
        self.skipped_scans = 0  # overtaken by a newer one before they could be answered
        self.on_status: OnStatus | None = None
        self.say: Say = _silent
        self._config = config
        self._vehicle = vehicle
        self._lidar = lidar
        self.links = [vehicle, *(lidar.links() if lidar is not None else ())]
        self._waits_on = [vehicle.transport, *(lidar.waits_on() if lidar is not None else ())]
        self._vehicle_clock = VehicleClock()
        self._logs = logs
        self._clock = clock
        self._assembler = Assembler(config.params.link)
        self._session = Session(config.task, config.params, navigator)
        now_s = clock.now_s()
        self._watch = VehicleWatch(now_s, config.connect_timeout_s, config.lost_timeout_s)
        self._engage_request = ModeRequest()
        self._hand_back = ModeRequest()
        self._stop_s: float | None = None  # wall time at which we were asked to stop
        self._heartbeat_s = now_s - HEARTBEAT_S
        self._status_s = now_s
        self._status: StatusLine | None = None
        self._pending: tuple[Inputs, float] | None = None  # the newest scan, and when it arrived
        self._held_t_s = 0.0  # vehicle time of the last hold setpoint
        self._first_state_s: float | None = None
        self._reboots = 0  # of the vehicle, that we know of
        self._hinted = False

    @property
    def dropped_scans(self) -> int:
        """Scans that could not be used."""
        return self._assembler.dropped_scans

    def turn(self, stop: StopRequest | None = None, wait_s: float = TURN_S) -> None:
        """Wait for messages, answer them, look after everything else."""
        wait_readable(self._waits_on, wait_s, self._clock)
        arrived_s = self._clock.now_s()
        for message in self._vehicle.receive():
            if self.exit_code is None:
                self._handle(message, arrived_s)
        if self._lidar is not None:
            self._look_through(self._lidar, arrived_s)
        self._take_pending()
        now_s = self._clock.now_s()
        if self.exit_code is None and stop is not None and stop.number is not None:
            self._stop(stop, now_s)
        if self.exit_code is None:
            self._look_after_vehicle(now_s)
        self._send_heartbeat(now_s)
        self._show_status(now_s)

    def _look_through(self, lidar: Lidar, arrived_s: float) -> None:
        """Scans of a LiDAR of our own; the autopilot is told of those that it cannot hear itself."""
        self._vehicle_clock.update(self._assembler.vehicle_time_s, arrived_s)
        arrived_s = self._clock.now_s()
        for message in lidar.receive(self._vehicle_clock):
            if self.exit_code is None:
                self._handle(self._vehicle.relay(message) if lidar.local else message, arrived_s)

    # --- messages -------------------------------------------------------------------------------------------------

    def _handle(self, message: Message, arrived_s: float) -> None:
        inputs = self._assembler.feed(message)
        if self._assembler.reboots != self._reboots:
            self._vehicle_booted()
        system = self._assembler.vehicle_system
        if message.get_srcSystem() == system and message.get_srcComponent() == codec.VEHICLE_COMPONENT:
            self._heard(arrived_s)
        if inputs is not None:
            self.skipped_scans += self._pending is not None
            self._pending = inputs, arrived_s
        elif message.get_msgId() == mav.MAVLINK_MSG_ID_LOCAL_POSITION_NED:
            self._watch_scans()
        elif message.get_msgId() == mav.MAVLINK_MSG_ID_COMMAND_ACK:
            self._logs.event("command ack", command=message.command, result=message.result)

    def _heard(self, now_s: float) -> None:
        if self._watch.heard_s is None:
            system = self._assembler.vehicle_system or self._config.system
            for link in self.links:
                link.speak_as(system, codec.COMPANION_COMPONENT)
            self._heartbeat_s = now_s - HEARTBEAT_S  # introduce ourselves at once
            self._tell(f"vehicle {system} heard on {self._vehicle.transport.name}")
        elif self._watch.waiting:
            self._watch.waiting = False
            self._tell("vehicle is back")
        self._watch.heard_s = now_s

    def _vehicle_booted(self) -> None:
        """Its clock and origin are new: nothing that was judged by the old ones counts any more."""
        self._reboots = self._assembler.reboots
        self._pending = self._first_state_s = None
        self._held_t_s = 0.0
        if self._session.hold_reason is HoldReason.SCAN_LOST:
            self._session.release()
        self._tell("vehicle has booted: starting afresh, with the goal counted from where it is now")

    def _take_pending(self) -> None:
        """Only the newest scan of a batch is answered: one who falls behind must not fly on old news."""
        if self._pending is not None and self.exit_code is None:
            inputs, arrived_s = self._pending
            self._pending = None
            self._take(inputs, arrived_s)

    def _take(self, inputs: Inputs, arrived_s: float) -> None:
        """Answer a scan."""
        session = self._session
        if session.hold_reason is HoldReason.SCAN_LOST:
            session.release()
            self._warn("swiftnav: scan is back, going on")
        if session.hold_reason is not None:
            self._send(session.held(inputs.state))
            return
        began_s = self._clock.now_s()
        try:
            answer = session.tick(inputs)
            ticked_s = self._clock.now_s()
            self._send(answer.setpoint)
            sent_s = self._clock.now_s()
            row = answer.row
        except Exception as error:  # the one place: whatever the tick trips over must end in a hold, not in a fall
            self._tick_failed(error, inputs)
            return
        timing = {
            "t_s": inputs.scan.t_s,
            "wall_s": arrived_s,
            "tick_ms": (ticked_s - began_s) * 1e3,
            "loop_ms": (sent_s - arrived_s) * 1e3,
            "decision": decided(row),
        }
        self._keep(row, timing)
        if answer.over:
            self._finish(ExitCode.LANDED, "landed and disarmed")

    def _keep(self, row: Mapping[str, Any], timing: dict[str, Any]) -> None:
        self._logs.tick(row, timing)
        self._status = status_line(row, timing["tick_ms"])

    def _tick_failed(self, error: Exception, inputs: Inputs) -> None:
        self._logs.event("navigator failed", exc_info=True, t_s=inputs.scan.t_s)
        if not is_flying(inputs.status):
            self._finish(ExitCode.TICK_FAILED, f"navigator failed before the flight: {type(error).__name__}: {error}")
            return
        self._session.hold(HoldReason.TICK_FAILED)
        self._send(self._session.held(inputs.state))
        self._warn("swiftnav: navigator failed, holding")

    # --- holding --------------------------------------------------------------------------------------------------

    def _watch_scans(self) -> None:
        """A state has arrived: brake when its scan has not come for too long, and keep the stream alive."""
        t_s, session = self._assembler.vehicle_time_s, self._session
        flying = is_flying(self._assembler.status)
        if not scan_lost(flying, t_s, self._last_scan_s(t_s), self._config.params.link.scan_lost_s):
            return
        if session.hold_reason is None:
            session.hold(HoldReason.SCAN_LOST)
            self._warn("swiftnav: scan lost, holding")
        state = self._assembler.latest_state()
        if state is not None and abs(t_s - self._held_t_s) >= HOLD_STEP_S:
            self._send(session.held(state))

    def _last_scan_s(self, t_s: float) -> float:
        """Time of the last scan, or of the first state without any; tells once that there is no LiDAR."""
        if self._first_state_s is None:
            self._first_state_s = t_s
        last_s = max(self._assembler.last_scan_s, self._first_state_s)
        if not self._hinted and t_s - last_s > NO_SCAN_HINT_S:
            self._hinted = True
            self._tell(f"no scan for {NO_SCAN_HINT_S:g} s: is the LiDAR running, and on the vehicle's clock?")
        return last_s

    def _stop(self, stop: StopRequest, now_s: float) -> None:
        """Asked to stop: hold, hand the vehicle back to the autopilot's own hold mode, leave."""
        if not is_flying(self._assembler.status):
            self._finish(stop.exit_code, "stopped" if self._stop_s is None else "stopped, the autopilot holds")
        elif self._stop_s is None:
            self._stop_s = now_s
            self._session.hold(HoldReason.STOPPING)
            self._warn("swiftnav: stopping, holding")
            self._ask_mode(self._hand_back, codec.PX4_HOLD, now_s)
        elif now_s - self._stop_s > HAND_BACK_S:
            self._finish(stop.exit_code, "stopped, but the autopilot did not take over: its failsafe will")
        else:
            self._ask_mode(self._hand_back, codec.PX4_HOLD, now_s)

    # --- wall clock -----------------------------------------------------------------------------------------------

    def _look_after_vehicle(self, now_s: float) -> None:
        config, status, hold_reason = self._config, self._assembler.status, self._session.hold_reason
        if self._watch.never_heard(now_s):
            patience = f"{config.connect_timeout_s:g} s"
            self._finish(ExitCode.NO_VEHICLE, f"no vehicle answered on {config.vehicle_url} within {patience}")
        elif self._watch.lost(now_s) and is_flying(status):
            self._finish(ExitCode.VEHICLE_LOST, f"vehicle lost: nothing heard for {config.lost_timeout_s:g} s")
        elif self._watch.lost(now_s):
            self._wait_for_vehicle(now_s)
        elif hold_reason is HoldReason.TICK_FAILED and not is_flying(status):
            self._finish(ExitCode.TICK_FAILED, "navigator failed in flight; somebody else has the vehicle now")
        elif hold_reason is HoldReason.SCAN_LOST and status is not None and not status.armed:
            self._finish(ExitCode.LANDED, "disarmed while the scan was lost")
        elif config.engage is Engage.AUTO and self._may_engage():
            self._ask_mode(self._engage_request, codec.PX4_OFFBOARD, now_s)

    def _wait_for_vehicle(self, now_s: float) -> None:
        """Silent while we did not steer: it boots, or somebody sees to the cable."""
        if not self._watch.waiting:
            self._watch.waiting = True
            self._tell(f"vehicle silent for {self._config.lost_timeout_s:g} s: waiting for it")
        if self._watch.given_up(now_s):
            self._finish(ExitCode.NO_VEHICLE, f"vehicle did not come back within {self._config.connect_timeout_s:g} s")

    def _may_engage(self) -> bool:
        """Setpoints are streaming, and nobody would be surprised."""
        streaming = self._status is not None and self._session.hold_reason is None
        return streaming and may_engage(self._assembler.status, self._assembler.custom_mode, self._session.engaged)

    def _ask_mode(self, request: ModeRequest, custom_mode: int, now_s: float) -> None:
        if request.due(now_s) and self._assembler.vehicle_system is not None:
            self._vehicle.send(codec.encode_set_mode(custom_mode, self._assembler.vehicle_system))
            self._logs.event("asked for mode", custom_mode=custom_mode, count=request.count)

    def _send_heartbeat(self, now_s: float) -> None:
        if now_s - self._heartbeat_s >= HEARTBEAT_S:
            self._heartbeat_s = now_s
            for link in self.links:
                link.send(codec.encode_companion_heartbeat())

    def _show_status(self, now_s: float) -> None:
        if now_s - self._status_s < STATUS_S:
            return
        self._status_s = now_s
        self._logs.flush()
        if self.on_status is not None and self._status is not None:
            self.on_status(self._status)

    # --- speaking -------------------------------------------------------------------------------------------------

    def _send(self, setpoint: Setpoint) -> None:
        self._held_t_s = setpoint.t_s
        self._vehicle.send(codec.encode_setpoint(setpoint, self._assembler.vehicle_system or self._config.system))

    def _warn(self, text: str) -> None:
        """Tell the ground station too."""
        self._vehicle.send(codec.encode_text(text))
        self._tell(text.removeprefix("swiftnav: "))

    def _tell(self, text: str) -> None:
        t_s = self._assembler.vehicle_time_s
        self._logs.event("said", text=text, t_s=t_s if math.isfinite(t_s) else None)
        self.say(text)

    def _finish(self, exit_code: int, reason: str) -> None:
        self.exit_code, self.reason = int(exit_code), reason
        self._tell(reason)


def _silent(_text: str) -> None:
    """Nobody listens."""
