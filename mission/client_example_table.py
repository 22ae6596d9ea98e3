"""Which example scripts of MAVSDK do we run, and what has each of them to do?"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

URL: Final = "udpin://0.0.0.0:14540"
PARAM_FILE: Final = "p.params"


class Kind(StrEnum):
    """How an example ends."""

    ENDS = "runs to its end"  # by itself, exit code 0
    ENDLESS = "runs on"  # until somebody ends it
    FAILS = "fails cleanly"  # what it wants is not there: it says so and stops


@dataclass(frozen=True, slots=True)
class Example:
    """One script: the longest that it may take and, unless it just ends, what it has to say by then."""

    script: str
    limit_s: float
    says: str = ""
    kind: Kind = Kind.ENDS
    arguments: tuple[str, ...] = ()
    before: str = ""  # an example that has to run first
    typed: str = ""  # at its keyboard
    server: bool = False  # it wants a mavsdk_server that runs already


def _endless(script: str, limit_s: float, says: str, typed: str = "") -> Example:
    return Example(script, limit_s, says, Kind.ENDLESS, typed=typed)


def _fails(script: str, limit_s: float, says: str, server: bool = False) -> Example:
    return Example(script, limit_s, says, Kind.FAILS, server=server)


# `examples` of mavlink/MAVSDK-Python, for mavsdk 3.17.4
MAVSDK_3: Final = (
    Example("all_params.py", 60),
    Example("calibration.py", 120, "Board level calibration finished"),
    Example("do_orbit.py", 150, "--- Landing"),
    Example("failure_injection.py", 120, "Disabling failure injection"),
    Example("firmware_version.py", 60),
    Example("follow_me_example.py", 120, "-- Landing"),
    Example("geofence.py", 60, "Geofence uploaded!"),
    Example("logfile_download.py", 90, "Downloading: log 0", before="takeoff_and_land.py"),
    Example("mavlink_direct_send.py", 60),
    Example("mission.py", 300, "Mission progress: 3/3"),
    Example("mission_import.py", 120, "Mission uploaded"),
    Example("mission_raw.py", 120, "-- Done"),
    Example("offboard_attitude.py", 120, "-- Stopping offboard"),
    Example("offboard_from_csv/offboard_from_csv.py", 300, "-- Disarming"),
    Example("offboard_position_ned.py", 150, "-- Stopping offboard"),
    Example("offboard_position_velocity_ned.py", 150, "-- Stopping offboard"),
    Example("offboard_velocity_body.py", 150, "-- Stopping offboard"),
    Example("offboard_velocity_ned.py", 150, "-- Stopping offboard"),
    Example("rtcm.py", 60),
    Example("send_status_message.py", 60),
    Example("show_debug_output.py", 60),
    Example("takeoff_and_land.py", 90, "-- Landing"),
    Example("telemetry_takeoff_and_land.py", 120, "Altitude: 0"),
    Example("tune.py", 60, "Tune played"),
    Example("upload_params.py", 60, "Params uploaded!", arguments=(URL, PARAM_FILE)),
    _endless("camera_params.py", 20, "=== Current settings ===", "p\n"),
    _endless("goto.py", 40, "Staying connected"),
    _endless("gripper.py", 20, "Staying connected"),
    _endless("highres_imu.py", 20, "X Acceleration"),
    _endless("manual_control.py", 40, "-- Starting manual control"),
    _endless("mavlink_direct_receive.py", 20, "ATTITUDE from 1/1"),
    _endless("px4_ev_automation.py", 30, "Landed state"),
    _endless("px4_ev_automation_keyboard.py", 30, "Landed state"),
    _endless("rtk_base_ublox.py", 20, "GPS info:"),
    _endless("shell.py", 20, "nsh>", "help\n"),
    _endless("telemetry.py", 20, "Position:"),
    _endless("telemetry_flight_mode.py", 20, "FlightMode: HOLD"),
    _endless("telemetry_is_armed_is_in_air.py", 20, "Is_armed: False"),
    _endless("telemetry_status_text.py", 20, "-- Connected to drone!"),
    _endless("transponder.py", 20, "Waiting for transponder messages"),
    _fails("camera.py", 20, "TypeError: Camera.set_mode() missing 1 required positional argument"),
    _fails("ftp_download_file.py", 20, "FtpError: FILE_DOES_NOT_EXIST", server=True),
    _fails("ftp_list_dir.py", 20, "FtpError: FILE_DOES_NOT_EXIST", server=True),
    _fails("gimbal.py", 30, "Timeout: No gimbals found."),
    _fails("winch.py", 20, "WinchError: TIMEOUT"),
)
# `py/mavsdk/examples` of mavlink/MAVSDK, for mavsdk 4.1
MAVSDK_4: Final = tuple(
    example
    for folder in ("", "asyncio/")
    for example in (
        Example(f"{folder}takeoff_and_land.py", 60, "Mission complete!"),
        Example(f"{folder}params.py", 60, "RTL_RETURN_ALT", arguments=(URL, "get_all")),
        Example(f"{folder}mission.py", 400, "Disarmed, exiting.", arguments=(URL,)),
        _endless(f"{folder}telemetry.py", 20, "osition"),
    )
)
