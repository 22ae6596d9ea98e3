"""How is a flight written as a ULog, so that PX4's own tools can read it? One file a flight; topics named as PX4's."""

import struct
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from sitl.modes import FlightMode
from sitl.simulation import Simulation

MAGIC: Final = b"ULog\x01\x12\x35\x01"
ARMED, DISARMED = 2, 1  # vehicle_status: ARMING_STATE

# vehicle_status: NAVIGATION_STATE
NAV_STATES: Final[Mapping[FlightMode, int]] = {
    FlightMode.MANUAL: 0,
    FlightMode.ALTCTL: 1,
    FlightMode.POSCTL: 2,
    FlightMode.MISSION: 3,
    FlightMode.HOLD: 4,
    FlightMode.RTL: 5,
    FlightMode.POSITION_SLOW: 6,
    FlightMode.ACRO: 10,
    FlightMode.TERMINATION: 13,
    FlightMode.OFFBOARD: 14,
    FlightMode.STABILIZED: 15,
    FlightMode.TAKEOFF: 17,
    FlightMode.LAND: 18,
    FlightMode.FOLLOW: 19,
    FlightMode.PRECISION_LAND: 20,
    FlightMode.ORBIT: 21,
}
# Topic: fields as ULog names them, and their layout.
TOPICS: Final = (
    ("vehicle_attitude", "uint64_t timestamp;float[4] q;", struct.Struct("<HQ4f")),
    (
        "vehicle_local_position",
        "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;",
        struct.Struct("<HQ6f"),
    ),
    (
        "vehicle_local_position_setpoint",
        "uint64_t timestamp;float x;float y;float z;float vx;float vy;float vz;float yaw;",
        struct.Struct("<HQ7f"),
    ),
    ("vehicle_status", "uint64_t timestamp;uint8_t nav_state;uint8_t arming_state;", struct.Struct("<HQBB")),
)
_HEADER = struct.Struct("<HB")


class UlogWriter:
    """One log, written as the flight goes on."""

    def __init__(self, path: Path, sim: Simulation) -> None:
        """Raises OSError when ``path`` cannot be written."""
        self.path = path
        self._file = path.open("wb")
        self._file.write(MAGIC + struct.pack("<Q", sim.t_ms * 1000))
        self._put("B", bytes(40))
        for name, fields, _ in TOPICS:
            self._put("F", f"{name}:{fields}".encode())
        for key, text in (("sys_name", "SWIFT-Nav"), ("ver_sw_release", "1.16.0")):
            self._put("I", _keyed(f"char[{len(text)}] {key}") + text.encode())
        params = sim.autopilot.params
        for key in params.names():
            value = params[key]
            kind, packed = ("int32_t", struct.pack("<i", value)) if isinstance(value, int) else _float(value)
            self._put("P", _keyed(f"{kind} {key}") + packed)
        for number, (name, _, _) in enumerate(TOPICS):
            self._put("A", struct.pack("<BH", 0, number) + name.encode())

    def write(self, sim: Simulation) -> None:
        """The vehicle as it is now."""
        t_us, state, demand = sim.t_ms * 1000, sim.state, sim.autopilot.demand
        position = (*state.pos_ned_m.tolist(), *state.vel_ned_m_s.tolist())
        wanted = (*demand.pos_ned_m.tolist(), *demand.vel_ned_m_s.tolist(), demand.yaw_rad)
        status = (NAV_STATES[sim.autopilot.mode], ARMED if sim.autopilot.armed else DISARMED)
        for number, values in enumerate((state.q_ned_frd.tolist(), position, wanted, status)):
            self._put("D", TOPICS[number][2].pack(number, t_us, *values))

    def flush(self) -> None:
        """Hand everything to the system."""
        self._file.flush()

    def close(self) -> None:
        """End the log."""
        self._file.close()

    def _put(self, kind: str, body: bytes) -> None:
        self._file.write(_HEADER.pack(len(body), ord(kind)) + body)


def _keyed(text: str) -> bytes:
    return bytes([len(text)]) + text.encode()


def _float(value: float) -> tuple[str, bytes]:
    return "float", struct.pack("<f", value)
