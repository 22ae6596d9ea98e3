import numpy as np
import pytest

from mission.bench.barn import CELL_M, load_barn, reference_length_m
from mission.bench.sdf import read_sdf
from mission.errors import InputError
from mission.world_check import WorldError

CYLINDER = "<cylinder><radius>0.075</radius><length>1</length></cylinder>"


def model(name, pose, geometry):
    shape = f"<collision name='c'><geometry>{geometry}</geometry></collision>"
    return f"<model name='{name}'><pose>{pose}</pose><link name='l'>{shape}</link></model>"


def sdf(*models):
    return f"<sdf version='1.6'><world name='default'>{''.join(models)}<state><model name='x'/></state></world></sdf>"


def barn_folder(folder, text, number=7, path=True):
    (folder / f"world_{number}.world").write_text(text, encoding="utf-8")
    if path:
        np.save(folder / f"path_{number}.npy", np.array([[15, 0], [15, 29]]))
    return folder


def test_barns_x_is_our_east_and_its_y_our_north(tmp_path):
    barn = load_barn(barn_folder(tmp_path, sdf(model("a", "-1.5 6.0 0 0 0 0", CYLINDER))))
    world = barn.courses[0].world
    assert world.circles[0, :3].tolist() == [6.0, -1.5, 0.075]
    assert world.start_ned_m.tolist() == [3.0, -2.25]
    assert barn.courses[0].name == "barn_7"


def test_the_reference_path_runs_from_the_start_through_the_middles_of_its_cells_to_the_goal():
    cells = np.array([[15, 0], [15, 29]])  # x = -2.325: 0.075 m beside the line from start to goal
    along = 29 * CELL_M
    ends = np.hypot(0.075, 5.075 - 3.0) + np.hypot(0.075, 13.0 - 9.425)
    assert reference_length_m(cells) == pytest.approx(along + ends)


def test_a_folder_that_is_none_or_without_worlds_is_refused_by_name(tmp_path):
    with pytest.raises(InputError, match="is no folder"):
        load_barn(tmp_path / "nowhere")
    with pytest.raises(InputError, match=r"no world_<number>\.world below"):
        load_barn(tmp_path)


def test_worlds_that_cannot_be_flown_are_skipped_named_and_counted(tmp_path):
    wall = [model(f"w{i}", f"{-4.425 + 0.15 * i} 7.0 0 0 0 0", CYLINDER) for i in range(-10, 40)]
    barn_folder(tmp_path, sdf(model("a", "-1.5 6.0 0 0 0 0", CYLINDER)), 1)
    barn_folder(tmp_path, "<sdf version='1.6'><world>", 2)
    mesh = model("rock", "0 7 0 0 0 0", "<mesh><uri>model://rock.dae</uri></mesh>")
    barn_folder(tmp_path, sdf(mesh), 3)
    barn_folder(tmp_path, sdf(*wall), 4)
    barn_folder(tmp_path, sdf(model("a", "-1.5 6.0 0 0 0 0", CYLINDER)), 5, path=False)
    barn_folder(tmp_path, sdf(model("a", "-1.5 6.0 0 0 0 0", CYLINDER)), 6)
    np.save(tmp_path / "path_6.npy", np.full((2, 2), np.nan))
    barn = load_barn(tmp_path)
    assert [course.name for course in barn.courses] == ["barn_1"]
    reasons = {skipped.name: skipped.reason for skipped in barn.skipped}
    assert list(reasons) == [f"world_{n}.world" for n in (2, 3, 4, 5, 6)]
    assert "world_2.world is no SDF" in reasons["world_2.world"]
    assert "model 'rock' is a <mesh> (model://rock.dae)" in reasons["world_3.world"]
    assert "goal is not reachable" in reasons["world_4.world"]
    assert "path_5.npy is missing" in reasons["world_5.world"]
    assert "path_6.npy holds a number that is not finite" in reasons["world_6.world"]


def test_where_no_world_can_be_flown_the_first_reason_is_said(tmp_path):
    barn_folder(tmp_path, "no xml at all")
    with pytest.raises(InputError, match=r"none of 1 worlds can be flown; the first: world_7\.world is no SDF"):
        load_barn(tmp_path)


@pytest.mark.parametrize(
    ("models", "said"),
    [
        (model("a", "0 0 0 0.5 0 0", CYLINDER), "is tilted"),
        (model("a", "0 0", CYLINDER), "pose wants 6 numbers"),
        (model("a", "0 0 nan 0 0 0", CYLINDER), "pose wants 6 numbers"),
        (model("a", "0 0 0 0 0 0", "<cylinder><radius>-1</radius></cylinder>"), "radius -1 is not above 0"),
        ("<include><uri>model://tree</uri></include>", "<include> of 'model://tree'"),
    ],
)
def test_what_would_leave_a_hole_in_the_world_is_refused(tmp_path, models, said):
    path = tmp_path / "world_1.world"
    path.write_text(sdf(models), encoding="utf-8")
    with pytest.raises(WorldError, match=said):
        read_sdf(path)


def test_a_box_keeps_its_sides_whatever_its_yaw(tmp_path):
    path = tmp_path / "world_1.world"
    box = "<box><size>2 1 1</size></box>"
    path.write_text(sdf(model("a", "3 4 0 0 0 0", box), model("b", "0 0 0 0 0 1.5707963", box)), encoding="utf-8")
    boxes = read_sdf(path).boxes
    assert boxes[0, :2].tolist() == [4.0, 3.0]
    assert boxes[0, 2] == pytest.approx(np.pi / 2)  # its length lies along x: east
    assert boxes[1, 2] == pytest.approx(0.0, abs=1e-6)  # and now along y: north
    assert boxes[:, 3:5].tolist() == [[1.0, 0.5], [1.0, 0.5]]
