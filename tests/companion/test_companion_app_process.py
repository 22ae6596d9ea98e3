"""Does the whole program work: over real UDP sockets, as a process of its own, and when it is started wrongly?"""

import hashlib
import json
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest
from pretend_vehicle import PretendVehicle

from companion import navigator
from companion.app import CompanionConfig, Summary, fly
from companion.app.command_line import main
from companion.app.logs import EVENTS, PACKETS, RECORDS, record_line
from companion.app.session import Session
from companion.app.signals import StopRequest
from companion.core import codec
from companion.core.mavlink import Connection
from companion.core.task import Task
from companion.core.udp import udp_out
from companion.link.replay import replay

TASK = Task(np.array([6.0, -1.0]), -3.0, 3.0)
ANSWER_S = 2.0  # a lockstep vehicle waits this long for the answer to a scan
PACE_S = 0.004  # a paced vehicle runs at ten times real time


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@contextmanager
def flying(port: int, lockstep: bool, offboard_at: int) -> Iterator[PretendVehicle]:
    """A vehicle in a thread of its own that gets OFFBOARD at scan number ``offboard_at``."""
    done = threading.Event()
    with closing(udp_out("127.0.0.1", port)) as transport:
        vehicle = PretendVehicle(Connection(transport, 1, 1))

        def live() -> None:
            while not done.is_set():
                if vehicle.k == offboard_at:
                    vehicle.custom_mode = codec.PX4_OFFBOARD
                vehicle.step()
                if lockstep:
                    await_answer(vehicle)
                else:
                    time.sleep(PACE_S)

        thread = threading.Thread(target=live)
        thread.start()
        try:
            yield vehicle
        finally:
            done.set()
            thread.join()


def await_answer(vehicle: PretendVehicle) -> None:
    """At the gate (nobody has answered yet) only a short while: the vehicle's first words may reach nobody."""
    deadline_s = time.monotonic() + (ANSWER_S if vehicle.setpoints else 0.02)
    while time.monotonic() < deadline_s:
        vehicle.listen()
        if vehicle.setpoints and vehicle.setpoints[-1].t_s == vehicle.t_s:
            return
        time.sleep(0.0002)
    if not vehicle.setpoints:
        vehicle.k -= 1  # the clock stands still until the companion is heard


def lockstep_flight(folder: Path) -> tuple[Summary, PretendVehicle]:
    port = free_port()
    config = CompanionConfig(TASK, folder, vehicle_url=f"udpin://127.0.0.1:{port}", connect_timeout_s=10.0)
    with flying(port, lockstep=True, offboard_at=10) as vehicle:
        return fly(config, stop=StopRequest(), say=lambda _text: None), vehicle


def test_two_lockstep_flights_over_udp_leave_the_same_records_and_so_does_a_replay(tmp_path: Path) -> None:
    summaries = []
    for name in ("first", "second"):
        summary, vehicle = lockstep_flight(tmp_path / name)
        assert (summary.exit_code, summary.reason) == (0, "landed and disarmed")
        assert np.linalg.norm(vehicle.pos_ned_m[:2] - TASK.goal_ned_m) < 0.5
        summaries.append(summary)
    records = (tmp_path / "first" / RECORDS).read_bytes()
    assert records == (tmp_path / "second" / RECORDS).read_bytes()
    assert summaries[0].record_sha256 == summaries[1].record_sha256 == hashlib.sha256(records).hexdigest()
    assert summaries[0].ticks == len(records.splitlines()) > 50
    session = Session(TASK, navigator.Params(), navigator)
    assert b"".join(record_line(session.tick(i).row) for i in replay(tmp_path / "first" / PACKETS)) == records


def started(port: int, log: Path, *extra: str) -> subprocess.Popen[str]:
    url = f"udpin://127.0.0.1:{port}"
    arguments = ["--vehicle", url, "--goal", "50", "0", "-3", "--log", str(log), "--json", "--status", *extra]
    return subprocess.Popen(
        [sys.executable, "-m", "companion", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.mark.parametrize(("number", "exit_code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_in_flight_leaves_the_vehicle_holding_and_the_logs_closed(
    tmp_path: Path, number: signal.Signals, exit_code: int
) -> None:
    port = free_port()
    with flying(port, lockstep=False, offboard_at=0) as vehicle, started(port, tmp_path / "log") as process:
        deadline_s = time.monotonic() + 20.0
        while vehicle.pos_ned_m[0] < 20.0 and time.monotonic() < deadline_s:
            time.sleep(0.02)
        process.send_signal(number)
        out, err = process.communicate(timeout=20.0)
    assert process.returncode == exit_code
    assert json.loads(out)["reason"] == "stopped, the autopilot holds"
    assert vehicle.custom_mode == codec.PX4_HOLD
    assert "stopping, holding" in err
    assert " travel " in err  # a status line
    records = (tmp_path / "log" / RECORDS).read_bytes()
    assert records.endswith(b"}\n")
    assert json.loads(out)["record_sha256"] == hashlib.sha256(records).hexdigest()
    events = [json.loads(line) for line in (tmp_path / "log" / EVENTS).read_text().splitlines()]
    assert (events[0]["event"], events[-1]["event"], events[-1]["exit_code"]) == ("start", "end", exit_code)
    assert events[0]["params"]["vehicle"]["radius_m"] == 0.33
    assert len(list(replay(tmp_path / "log" / PACKETS))) >= len(records.splitlines())


def one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What is printed for a wrong start; exit code 2 and one line."""
    try:
        exit_code = main(arguments)
    except SystemExit as ended:
        exit_code = ended.code
    captured = capsys.readouterr()
    assert exit_code == 2
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    return captured.err


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ([], "the following arguments are required: --goal"),
        (["--goal", "50"], "--goal wants NORTH EAST [DOWN], got 1 numbers"),
        (["--goal", "1", "2", "-3", "4"], "got 4 numbers"),
        (["--goal", "50", "nan"], "'nan' is not a finite number"),
        (["--goal", "50", "north"], "'north' is not a finite number"),
        (["--goal", "50", "0", "3"], "cruise altitude D = 3.0 must be negative"),
        (["--goal", "50", "0", "--cruise", "0"], "cruise = 0.0 m/s is outside (0, 20.0] m/s"),
        (["--goal", "50", "0", "--cruise", "99"], "cruise = 99.0 m/s is outside"),
        (["--goal", "50", "0", "--vehicle", "udpim://:1"], "did you mean 'udpin'"),
        (["--goal", "50", "0", "--lidar", "14540"], "'14540' is no connection URL"),
        (["--goal", "50", "0", "--lidar", "lds2d:LD19"], "'lds2d:LD19': expected lds2d:MODEL:/dev/DEVICE[:BAUD]"),
        (["--goal", "50", "0", "--lidar", "replay:no-such.jsonl"], "no-such.jsonl cannot be read: No such file"),
        (["--goal", "50", "0", "--engage", "now"], "argument --engage"),
        (["--goal", "50", "0", "--connect-timeout", "-1"], "connect_timeout_s = -1.0 must be a positive number"),
        (["--goal", "50", "0", "--params", "no-such.yaml"], "no-such.yaml cannot be read: No such file or directory"),
        (["--goal", "50", "0", "--altitude", "3"], "unrecognized arguments: --altitude 3"),
    ],
)
def test_a_wrong_start_is_one_line_and_nothing_is_written(
    arguments: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert says in one_line(arguments, capsys)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("vehicel:\n  radius_m: 0.4\n", "unknown parameter group 'vehicel'; did you mean 'vehicle'?"),
        ("vehicle:\n  radius: 0.4\n", "unknown parameter 'vehicle.radius'; did you mean 'radius_m'?"),
        ("vehicle:\n  radius_m: .nan\n", "parameter 'vehicle.radius_m' = nan m is outside"),
        ("vehicle:\n  radius_m: big\n", "parameter 'vehicle.radius_m' wants float, got 'big'"),
        ("- 1\n", "wants 'group:' with 'field: value' lines below, got list"),
        ("vehicle:\n  radius_m: [\n", "line 3: "),
    ],
)
def test_a_wrong_parameter_file_is_one_line(
    text: str, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "params.yaml"
    path.write_text(text)
    assert says in one_line(["--goal", "50", "0", "--params", str(path), "--log", str(tmp_path / "log")], capsys)
    assert not (tmp_path / "log").exists()


def test_a_port_in_use_is_one_line_and_nothing_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as squatter:
        squatter.bind(("0.0.0.0", 0))
        port = squatter.getsockname()[1]
        log = tmp_path / "log"
        arguments = ["--goal", "50", "0", "--vehicle", f"udpin://0.0.0.0:{port}", "--log", str(log)]
        assert f"udp port {port} is in use" in one_line(arguments, capsys)
        assert not log.exists()


def test_a_log_folder_that_cannot_be_written_is_one_line_before_anything_is_sent(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("in the way")
    listener_port = free_port()
    with closing(udp_out("127.0.0.1", 9, local_port=listener_port)) as listener:
        url = f"udpout://127.0.0.1:{listener_port}"
        log = tmp_path / "file" / "log"
        assert "cannot be written" in one_line(["--goal", "50", "0", "--vehicle", url, "--log", str(log)], capsys)
        time.sleep(0.05)
        assert listener.receive() == []


def test_the_default_url_moves_with_the_instance(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--goal", "50", "0", "--instance", "7", "--connect-timeout", "0.1", "--log", str(tmp_path), "--json"]
    assert main(arguments) == 3
    reason = json.loads(capsys.readouterr().out)["reason"]
    assert "no vehicle answered on udpin://127.0.0.1:14547 within 0.1 s" in reason


def test_help_shows_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0
    assert "python -m companion --vehicle udpin://127.0.0.1:14540 --goal 55 0 -3" in capsys.readouterr().out
