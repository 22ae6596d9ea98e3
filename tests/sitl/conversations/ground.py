"""What does a client ask of a vehicle that stands on the ground, and send to it?"""

import asyncio
import base64
import json
from pathlib import Path
from typing import Any

from conversations.client import NATIVE, Vehicle, finish, first, kinds, refusal
from conversations.conversation import Conversation

UPLOAD = {"MIS_TAKEOFF_ALT": 4.0, "COM_RC_IN_MODE": 1, "RTL_RETURN_ALT": 14.0}
VISION = {"EKF2_HGT_REF": 3, "EKF2_EV_CTRL": 15, "EKF2_GPS_CTRL": 0}
AIRSPEED = """<mavlink><messages><message id="295" name="AIRSPEED"><description>air</description>
<field type="uint8_t" name="id" instance="true">which</field><field type="float" name="airspeed">m/s</field>
<field type="int16_t" name="temperature">cdegC</field><field type="float" name="raw_press">hPa</field>
<field type="uint8_t" name="flags">flags</field></message></messages></mavlink>"""


async def every_set_of_telemetry_comes(vehicle: Vehicle) -> None:
    tell = vehicle.telemetry
    battery, gps, position, heading, quaternion, velocity = await asyncio.gather(
        first(tell.battery()),
        first(tell.gps_info()),
        first(tell.position()),
        first(tell.heading()),
        first(tell.attitude_quaternion()),
        first(tell.velocity_ned()),
    )
    assert battery.remaining_percent > 0.5
    assert gps.fix_type.name == "FIX_3D"
    assert gps.num_satellites >= 6
    assert abs(position.relative_altitude_m) < 1.0
    assert abs(position.latitude_deg - vehicle.home.latitude_deg) < 1e-4
    assert 0.0 <= heading.heading_deg <= 360.0
    assert abs(sum(q * q for q in (quaternion.w, quaternion.x, quaternion.y, quaternion.z)) - 1.0) < 1e-3
    assert abs(velocity.down_m_s) < 1.0
    assert await first(tell.in_air()) is False
    assert await first(tell.armed()) is False
    assert (await first(tell.flight_mode())).name == "HOLD"
    assert (await first(tell.landed_state())).name == "ON_GROUND"
    assert await first(tell.health_all_ok(), bool)


async def the_imu_comes_as_often_as_asked(vehicle: Vehicle) -> None:
    await vehicle.telemetry.set_rate_imu(200.0)
    imu = await first(vehicle.telemetry.imu())
    assert abs(imu.acceleration_frd.down_m_s2 + 9.8) < 1.0
    assert abs(imu.angular_velocity_frd.forward_rad_s) < 0.2
    assert abs(imu.magnetic_field_frd.down_gauss) < 1.0
    later = await first(vehicle.telemetry.imu(), lambda value: value.timestamp_us > imu.timestamp_us)
    assert later.timestamp_us > imu.timestamp_us


async def an_arming_that_is_undone_is_told(vehicle: Vehicle) -> None:
    await vehicle.action.arm()
    await vehicle.until(lambda: vehicle.armed)
    await vehicle.action.disarm()
    await vehicle.until(lambda: not vehicle.armed)
    await vehicle.until(lambda: any("isarmed" in text for text in vehicle.texts))


async def all_parameters_come_and_some_are_set(vehicle: Vehicle) -> None:
    everything = await vehicle.param.get_all_params()
    names = {param.name: param.value for param in (*everything.int_params, *everything.float_params)}
    assert len(names) > 100
    assert not everything.custom_params
    assert set(UPLOAD) | set(VISION) <= set(names)
    for name, value in {**UPLOAD, **VISION}.items():
        await set_param(vehicle, name, value)
    assert await vehicle.param.get_param_int("EKF2_EV_CTRL") == 15
    assert await vehicle.param.get_param_float("RTL_RETURN_ALT") == 14.0
    for name in (*VISION, "COM_RC_IN_MODE"):
        await set_param(vehicle, name, names[name])


async def set_param(vehicle: Vehicle, name: str, value: float) -> None:
    """By the type that the value has."""
    setter = vehicle.param.set_param_int if isinstance(value, int) else vehicle.param.set_param_float
    await setter(name, value)


async def the_firmware_has_a_version(vehicle: Vehicle) -> None:
    version = await vehicle.info.get_version()
    assert (version.flight_sw_major, version.flight_sw_minor) == (1, 16)
    assert version.flight_sw_git_hash
    assert (await vehicle.info.get_identification()).hardware_uid


async def texts_tunes_corrections_and_foreign_messages_are_taken(vehicle: Vehicle) -> None:
    kind = kinds("server_utility").StatusTextType
    await vehicle.server_utility.send_status_text(kind.INFO, "the ground says hello")
    await play(vehicle)
    correction = base64.b64encode(bytes([0xD3, 0, 4, 1, 2, 3, 4, 9, 9, 9])).decode()
    await vehicle.rtk.send_rtcm_data(kinds("rtk").RtcmData(correction))
    direct = vehicle.mavlink_direct
    await direct.load_custom_xml(AIRSPEED)
    fields = {"id": 0, "airspeed": 3.5, "temperature": 2000, "raw_press": 1010, "flags": 0}
    message = kinds("mavlink_direct").MavlinkMessage("AIRSPEED", 245, 25, 0, 0, json.dumps(fields))
    for _ in range(5):
        await direct.send_message(message)
    await vehicle.until(lambda: vehicle.ready)


async def play(vehicle: Vehicle) -> None:
    """A tune. The plugin of 4.1 cannot pack a song (``int()`` of a list): there the message goes as it is."""
    if NATIVE:
        fields = {"target_system": 1, "target_component": 1, "format": 1, "tune": "MFT120L4CPE"}
        message = kinds("mavlink_direct").MavlinkMessage("PLAY_TUNE_V2", 245, 190, 1, 1, json.dumps(fields))
        await vehicle.mavlink_direct.send_message(message)
        return
    note = kinds("tune").SongElement
    song = [note.DURATION_4, note.NOTE_C, note.NOTE_PAUSE, note.NOTE_E]
    await vehicle.tune.play_tune(kinds("tune").TuneDescription(song, 120))


async def any_message_can_be_read_as_it_comes(vehicle: Vehicle) -> None:
    message = await first(vehicle.mavlink_direct.message("ATTITUDE"))
    assert (message.system_id, message.component_id) == (1, 1)
    assert abs(json.loads(message.fields_json)["roll"]) < 0.2


async def the_shell_has_a_prompt(vehicle: Vehicle) -> None:
    said: list[str] = []

    def heard(piece: Any) -> bool:
        said.append(piece.data if NATIVE else piece)
        return "nsh>" in "".join(said)

    listening = asyncio.create_task(first(vehicle.shell.receive(), heard))
    while not listening.done():
        await (
            vehicle.shell.send("ver all\n", kinds("shell").Device.SHELL) if NATIVE else vehicle.shell.send("ver all\n")
        )
        await asyncio.wait([listening], timeout=1.0)
    await listening


async def the_sensors_are_calibrated(vehicle: Vehicle) -> None:
    calibration = vehicle.calibration
    for sensor in ("gyro", "accelerometer", "magnetometer", "level_horizon"):
        await finish(getattr(calibration, f"calibrate_{sensor}")())
    await vehicle.until(lambda: vehicle.ready)


async def what_is_not_there_fails_cleanly(vehicle: Vehicle) -> None:
    """Camera, gimbal, winch, files, other aircraft: a clean no or silence; a gripper's command is taken."""
    camera, gimbal = vehicle.camera, kinds("gimbal").ControlMode.PRIMARY
    photo, mode, control, winch, *files, _ = await asyncio.gather(
        refusal("camera", camera.take_photo(1)),
        refusal("camera", camera.set_mode(1, kinds("camera").Mode.PHOTO)),
        refusal("gimbal", vehicle.gimbal.take_control(1, gimbal)),
        refusal("winch", vehicle.winch.load_payload(1)),
        refusal("ftp", vehicle.ftp.list_directory("/")),
        refusal("ftp", _download(vehicle)),
        _silence(vehicle.transponder.transponder()),
    )
    assert "UNSUPPORTED" in photo
    assert "UNSUPPORTED" in mode
    assert "INVALID_ARGUMENT" in control  # the client knows of no gimbal
    assert "TIMEOUT" in winch
    assert all("FILE_DOES_NOT_EXIST" in said for said in files)
    await vehicle.gripper.grab(1)
    await vehicle.gripper.release(1)
    assert vehicle.ready


async def _download(vehicle: Vehicle) -> None:
    await finish(vehicle.ftp.download("/nothing.txt", str(Path.cwd()), False))


async def _silence(stream: Any) -> str:
    try:
        await first(stream, limit_s=2.0)
    except TimeoutError:
        return "silence"
    raise AssertionError("something came")


CONVERSATIONS = (
    Conversation(
        every_set_of_telemetry_comes,
        (
            "telemetry.py",
            "asyncio/telemetry.py",
            "telemetry_flight_mode.py",
            "telemetry_is_armed_is_in_air.py",
            "px4_ev_automation.py",
            "px4_ev_automation_keyboard.py",
        ),
    ),
    Conversation(the_imu_comes_as_often_as_asked, ("highres_imu.py",)),
    Conversation(an_arming_that_is_undone_is_told, ("telemetry_status_text.py",)),
    Conversation(
        all_parameters_come_and_some_are_set, ("all_params.py", "upload_params.py", "params.py", "asyncio/params.py")
    ),
    Conversation(the_firmware_has_a_version, ("firmware_version.py",)),
    Conversation(
        texts_tunes_corrections_and_foreign_messages_are_taken,
        ("send_status_message.py", "tune.py", "rtcm.py", "rtk_base_ublox.py", "mavlink_direct_send.py"),
    ),
    Conversation(any_message_can_be_read_as_it_comes, ("mavlink_direct_receive.py",)),
    Conversation(the_shell_has_a_prompt, ("shell.py",)),
    Conversation(the_sensors_are_calibrated, ("calibration.py",)),
    Conversation(
        what_is_not_there_fails_cleanly,
        (
            "camera.py",
            "camera_params.py",
            "gimbal.py",
            "gripper.py",
            "winch.py",
            "transponder.py",
            "ftp_list_dir.py",
            "ftp_download_file.py",
        ),
    ),
)
