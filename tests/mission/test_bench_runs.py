import json

import numpy as np
import pytest
from bench_rows import row

from companion.core import params as core_params
from companion.core.params import ParamError
from companion.core.types import Scan, Setpoint
from companion.navigator import Params
from companion.navigator.profiles import profile_named, profile_names
from mission.bench import run
from mission.bench.course import Course, Rules
from mission.bench.document import write_document
from mission.bench.entry import Entry, Run, row_of, run_seed
from mission.bench.flight import End, fly
from mission.bench.rows import append, read
from mission.bench.run import SuiteSpec, entry_folder, fly_missing, missing, read_entry
from mission.bench.stress import STRESSES, stress_named
from mission.bench.suites import Cell, Suite
from mission.cli import main
from mission.errors import InputError
from mission.pilots.interface import PilotNote
from sitl.world import Mover, World


def open_course(_run=0, circles=(), movers=(), **rules):
    given = {"speed_m_s": 2.0, "radius_m": 0.33, "time_limit_s": 8.0, "goal_radius_m": 1.0, **rules}
    world = World(
        "open", np.zeros(2), np.array([6.0, 0.0]), (-60.0, -20.0, 60.0, 20.0),
        np.array(circles, dtype=float).reshape(-1, 4), np.empty((0, 6)), tuple(movers),
    )  # fmt: skip
    return Course("cell", "open_1", world, Rules(**given))


class Straight:
    """Flies north whatever stands there; or stands where it is."""

    name, source = "straight", "this test"

    def __init__(self, speed_m_s=1.5):
        self.speed_m_s = speed_m_s

    def start(self, params):
        return 0

    def tick(self, memory, inputs, task, params):
        pos = inputs.state.pos_ned_m
        velocity = np.array([self.speed_m_s, 0.0, 0.0])
        setpoint = Setpoint(inputs.state.t_s, np.array([pos[0], 0.0, task.down_m]), velocity, None, 0.0)
        return memory + 1, setpoint, PilotNote("straight", decided=memory % 5 == 0)


def test_a_flight_that_reaches_its_goal_is_a_success_with_its_figures():
    course = open_course()
    flown = fly(course, Straight(), Params(), 1)
    figures = row_of(course, 0, 1, flown, "abc")
    assert flown.end is End.GOAL and figures.success
    assert figures.path_m == pytest.approx(5.0, abs=0.2)
    assert figures.shortest_m == pytest.approx(5.0)
    assert 2.5 < figures.time_s < 6.0
    assert figures.min_clearance_m is None  # nothing stands there


def test_flying_into_something_is_a_contact_and_being_run_into_is_told_apart():
    struck_by = Mover((0.0, 15.0), (0.0, -15.0), 0.4, np.inf, 1.0, 1.0, 0.05)
    assert fly(open_course(circles=[[3.0, 0.0, 0.3, np.inf]]), Straight(), Params(), 1).end is End.CONTACT
    assert fly(open_course(movers=[struck_by], time_limit_s=30.0), Straight(0.0), Params(), 1).end is End.STRUCK


def test_time_and_bounds_end_a_flight():
    assert fly(open_course(time_limit_s=1.0), Straight(), Params(), 1).end is End.TIMEOUT
    far = open_course(goal_radius_m=None, finish_north_m=90.0, time_limit_s=60.0)
    assert fly(far, Straight(9.0), Params(), 1).end is End.OUT_OF_BOUNDS


@pytest.mark.parametrize("speed_m_s", [3.0, 7.0])
def test_a_start_at_speed_is_one(speed_m_s):
    course = open_course(at_speed=True, speed_m_s=speed_m_s, goal_radius_m=None, finish_north_m=3.0)
    flown = fly(course, Straight(speed_m_s), Params(), 1)
    assert flown.start_speed_m_s == pytest.approx(speed_m_s, rel=0.1)
    assert abs(flown.track[0, 1]) < 0.6  # where the course begins


def test_the_same_seed_gives_the_same_flight_and_another_one_another():
    course = open_course(circles=[[3.0, 1.2, 0.3, np.inf]])
    first, again, other = (fly(course, Straight(), Params(), seed) for seed in (1, 1, 2))
    assert np.array_equal(first.track, again.track)
    assert not np.array_equal(first.track, other.track)
    assert run_seed("cell", 3) == run_seed("cell", 3) != run_seed("cell", 4)


def test_half_of_the_sectors_can_be_blind():
    scan = Scan(0.0, np.ones(72), 0.0, np.radians(5.0), 0.1, 30.0)
    seen = stress_named("blind").seen(scan).range_m
    assert np.isnan(seen[19:54]).all()
    assert np.isfinite(seen[:19]).all() and np.isfinite(seen[54:]).all()
    with pytest.raises(InputError, match="did you mean 'noise'"):
        stress_named("noize")
    assert len(STRESSES) == 7


def test_rows_come_back_as_they_were_and_a_torn_line_does_not(tmp_path):
    path = tmp_path / "runs.csv"
    rows = [row(0), row(1, success=False, reference_m=None, switches_bound=None, decision_ms="")]
    for one in rows:
        append(path, one)
    assert read(path) == rows
    with path.open("ab") as file:
        file.write(b"barn,2,barn_1,7,goal,1,0")  # the machine died here
    assert read(path) == rows
    append(path, row(2))
    assert read(path) == [*rows, row(2)]


@pytest.mark.parametrize("cut", [10, -1, -4])  # in the names of the columns, before the end of the line, in the commit
def test_wherever_the_first_write_was_torn_the_run_is_flown_again(tmp_path, cut):
    path = tmp_path / "runs.csv"
    append(path, row(0))
    path.write_bytes(path.read_bytes()[:cut])
    assert read(path) == []
    append(path, row(1))
    assert read(path) == [row(1)]


def counting_suite(flown):
    def course(run_number):
        flown.append(run_number)
        return open_course(time_limit_s=0.2)

    return Suite("gap", "", (Cell("cell", course),), 3)


def test_what_is_there_is_not_flown_again(tmp_path, monkeypatch):
    monkeypatch.setattr(run, "fly_run", lambda course, number, entry, commit: Run(row(number, cell="cell"), None))
    flown = []
    suite, spec, entry = counting_suite(flown), SuiteSpec("gap"), Entry()
    first = fly_missing(spec, suite, entry, tmp_path / "x")
    next(first)
    first.close()  # killed after one run
    assert len(missing(suite, None, read_entry(tmp_path / "x"))) == 2
    list(fly_missing(spec, suite, entry, tmp_path / "x"))
    assert flown == [0, 1, 2]
    list(fly_missing(spec, suite, entry, tmp_path / "x", runs=4))
    assert flown == [0, 1, 2, 3]
    assert not (tmp_path / "x" / "failures").exists()


def test_runs_of_other_settings_are_never_mixed_in(tmp_path):
    suite, spec = Suite("gap", "", (), 1), SuiteSpec("gap")
    list(fly_missing(spec, suite, Entry(), tmp_path / "x"))
    other = Entry(overrides={"limits": {"tau_s": 0.3}})
    with pytest.raises(InputError, match="holds runs with params"):
        list(fly_missing(spec, suite, other, tmp_path / "x"))


@pytest.mark.parametrize("text", ["{", "[1]", "\ud800"])
def test_settings_that_cannot_be_read_are_one_line(tmp_path, text):
    (tmp_path / "setup.json").write_text(text, encoding="utf-8", errors="surrogatepass")
    with pytest.raises(InputError, match=r"setup\.json .*choose another --out"):
        list(fly_missing(SuiteSpec("gap"), Suite("gap", "", (), 1), Entry(), tmp_path))


def test_a_folder_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "mine").touch()
    with pytest.raises(InputError, match=r"--out: .*mine/x: Not a directory"):
        list(fly_missing(SuiteSpec("gap"), Suite("gap", "", (), 1), Entry(), tmp_path / "mine" / "x"))


def test_a_failed_run_leaves_a_picture(tmp_path):
    suite = Suite("gap", "", (Cell("a/cell", lambda run_number: open_course(time_limit_s=0.5)),), 1)
    (failed,) = fly_missing(SuiteSpec("gap"), suite, Entry(), tmp_path)
    assert failed.timeout
    assert (tmp_path / "failures" / "cell_0000.png").stat().st_size > 5000


@pytest.mark.slow
def test_a_local_ray_flies_the_same_runs_as_this_process(tmp_path):
    pytest.importorskip("ray")
    spec = SuiteSpec("tracks")
    suite = spec.load()

    def rows_of(folder, cluster):
        flown = fly_missing(spec, suite, Entry("brake"), folder, runs=1, jobs=2, cluster=cluster)
        return sorted((row.cell, row.run, row.end, row.time_s, row.path_m) for row in flown)

    assert rows_of(tmp_path / "ray", "local") == rows_of(tmp_path / "here", None)


def test_entries_have_folders_of_their_own(tmp_path):
    spec = SuiteSpec("barn", tmp_path, "kept")
    folders = {
        entry_folder(tmp_path, spec, entry)
        for entry in (
            Entry(),
            Entry(profile="tight"),
            Entry(stress="noise"),
            Entry(px4_params={"MPC_XY_P": 1.5}),
            Entry("forest"),
            Entry("forest", guard=False),
            Entry(overrides={"limits": {"clamp": False}}),
            Entry(overrides={"limits": {"tau_s": 0.3}}),
        )
    }
    assert len(folders) == 8
    assert {folder.parent.name for folder in folders} == {"barn_kept"}


def test_every_profile_holds_known_parameters_within_their_ranges():
    assert {"outdoor", "tight", "adaptive"} <= set(profile_names())
    for name in profile_names():
        core_params.update(Params(), profile_named(name))
    with pytest.raises(ParamError, match="did you mean 'tight'"):
        profile_named("tigth")


def test_one_object_a_suite_for_machines_and_a_document_from_what_was_flown(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(run, "fly_run", lambda course, number, entry, commit: Run(row(number, cell=course.cell), None))
    assert main(["bench", "pole", "--runs", "2", "--out", str(tmp_path), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    asked = ("runs", "success", "collision", "timeout", "spl", "mean_time_s", "score_05", "score_025")
    assert all(name in figures for name in asked)
    assert figures["runs"] == 8
    assert list(figures["cells"]) == ["3 m/s", "5 m/s", "7 m/s", "10 m/s"]
    write_document(tmp_path, tmp_path / "docs" / "benchmarks.md")
    text = (tmp_path / "docs" / "benchmarks.md").read_text(encoding="utf-8")
    assert "swiftnav bench pole --pilot geometric --runs 2" in text
    assert "| Loquercio et al. |" in text
    assert (tmp_path / "docs" / "benchmarks" / "pole.png").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["pole", "--pilot", "geometrik"], "did you mean 'geometric'"),
        (["pole", "--stress", "rain"], "unknown stress"),
        (["pole", "--profile", "tigth"], "did you mean 'tight'"),
        (["pole", "--param", "limits.tua_s=1"], "unknown parameter"),
        (["barn", "nowhere"], "is no folder"),
        (["all", "--worlds", "nowhere"], "is no folder"),
    ],
)
def test_mistakes_are_one_line_and_nothing_is_flown(words, said, tmp_path, capsys):
    assert main(["bench", *words, "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
