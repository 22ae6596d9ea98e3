"""Is a flight on real PX4 firmware set up right? And flown, where PX4_BIN names a build of it (else left out)."""

import json
import os
import socket
import time
from pathlib import Path

import pytest

from mission.cli import main
from mission.errors import InputError
from mission.flight_plan import plan_flight
from mission.px4_firmware import Px4Build, find_build, running, with_gps_tolerance
from mission.runner import FlySettings, check_ports, companion_arguments, vehicle_config
from sitl.vehicle_config import Firmware

PX4_BIN = os.environ.get("PX4_BIN")


def build_at(folder: Path, script: str = "exit 0") -> Path:
    """Something that looks like a build."""
    (folder / "bin").mkdir()
    (folder / "etc" / "init.d-posix").mkdir(parents=True)
    (folder / "etc" / "init.d-posix" / "rcS").write_text("")
    binary = folder / "bin" / "px4"
    binary.write_text(f"#!/bin/sh\n{script}\n")
    binary.chmod(0o755)
    return binary


def test_a_build_is_found_by_its_binary(tmp_path: Path) -> None:
    binary = build_at(tmp_path)
    assert find_build(binary) == Px4Build(binary.resolve(), (tmp_path / "etc").resolve())


def test_a_path_that_is_no_build_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"PX4_BIN '.*missing' is no program"):
        find_build(tmp_path / "missing")
    binary = build_at(tmp_path)
    (tmp_path / "etc" / "init.d-posix" / "rcS").unlink()
    with pytest.raises(InputError, match="no start scripts in"):
        find_build(binary)


def test_the_firmware_gets_its_airframe_instance_and_a_folder_of_its_own(tmp_path: Path) -> None:
    binary = build_at(tmp_path, 'echo "$PX4_SIM_MODEL $* in $(pwd)"; exec sleep 60')
    out = tmp_path / "out"
    with running(find_build(binary), 3, out):
        deadline_s = time.monotonic() + 10.0
        while not (out / "px4.log").read_text() and time.monotonic() < deadline_s:
            time.sleep(0.01)
    rootfs, etc = (out / "px4").resolve(), (tmp_path / "etc").resolve()
    assert (out / "px4.log").read_text() == f"none_iris -d -i 3 -w {rootfs} {etc} in {rootfs}\n"


def test_the_companion_listens_for_the_lidar_on_a_link_of_its_own(tmp_path: Path) -> None:
    plan = plan_flight("trajectory1", 0)
    px4 = companion_arguments(plan, FlySettings(instance=2, firmware=Firmware.PX4), tmp_path)
    embedded = companion_arguments(plan, FlySettings(instance=2), tmp_path)
    assert px4 == [*embedded, "--lidar", "udpin://0.0.0.0:14652"]


def test_the_vehicle_is_told_who_flies(tmp_path: Path) -> None:
    plan = plan_flight("trajectory1", 0)
    assert vehicle_config(plan, FlySettings(firmware=Firmware.PX4), tmp_path).firmware is Firmware.PX4


def test_a_landing_by_gps_may_be_a_metre_off() -> None:
    plan = plan_flight("trajectory1", 0)
    wider = with_gps_tolerance(plan)
    assert (plan.mission.success.landing_error_m, wider.mission.success.landing_error_m) == (0.5, 1.0)
    assert wider.draws == plan.draws


@pytest.mark.parametrize(("kind", "port"), [(socket.SOCK_STREAM, 4565), (socket.SOCK_DGRAM, 14655)])
def test_a_port_in_use_is_named(kind: socket.SocketKind, port: int) -> None:
    with socket.socket(socket.AF_INET, kind) as holder:
        holder.bind(("127.0.0.1", port))
        if kind is socket.SOCK_STREAM:
            holder.listen()
        with pytest.raises(InputError, match=str(port)):
            check_ports(5, Firmware.PX4)


def test_an_unknown_firmware_is_one_line_with_the_nearest_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["fly", "trajectory1", "--firmware", "px5"]) == 2
    assert "did you mean 'px4'" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.skipif(PX4_BIN is None, reason="PX4_BIN names no build of PX4 1.16")
@pytest.mark.parametrize("mission", ["trajectory1", "trajectory2"])
def test_real_firmware_flies_the_mission(mission: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["fly", mission, "--firmware", "px4", "--json", "--out", str(tmp_path / "flight")]
    assert main(arguments) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["collisions"] == 0
    assert result["landing_error_m"] < 1.0
