"""Is a tick a pure function? Same memory and inputs: the same bytes, and nothing that went in has changed."""

import ast
import importlib
import random
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from scene import CLUTTER, DT_S, HOVERING, PARAMS, Eye, Pilot, bytes_of, flight, ring, world

from companion import navigator
from companion.core.inputs import Inputs
from companion.core.task import Task
from companion.core.types import NavMode
from companion.navigator import Memory, Record

CLOCKS_AND_DICE = {"time", "datetime", "random", "secrets", "uuid", "os", "socket", "threading", "logging"}
GOAL = Task(np.array([30.0, 0.0]), None, 3.0)


def assert_pure(before: Memory, inputs: Inputs, flown: Record, task: Task) -> None:
    """Tick twice more from where a tick began: same bytes each time, memory and inputs as they were."""
    given = bytes_of(before) + bytes_of(inputs)
    for _ in range(2):
        after, setpoint, record = navigator.tick(before, inputs, task, PARAMS)
        assert bytes_of(setpoint) == bytes_of(flown.setpoint)
        assert bytes_of(after) == bytes_of(flown.memory)
        assert bytes_of(record) == bytes_of(flown)
        assert bytes_of(before) + bytes_of(inputs) == given


def test_two_ticks_from_one_memory_are_equal_to_the_last_bit_throughout_a_flight() -> None:
    flown = flight("trajectory2", 1)
    assert flown.plan.params == PARAMS
    for before, record in flown.samples:
        assert_pure(before, record.inputs, record, flown.plan.task)
    modes = {record.mode for _, record in flown.samples}
    assert modes == {"standby", NavMode.TRAVEL, NavMode.RL, NavMode.LANDING}
    assert sum(record.decision is not None for _, record in flown.samples) > 10


@pytest.mark.parametrize(
    ("circles", "given"),
    [
        (CLUTTER, {}),
        (CLUTTER, {"fresh": False}),
        (CLUTTER, {"status": HOVERING}),
        (ring(0.45), {}),
        (CLUTTER, {"pos_ned_m": (np.nan, 0.0, -2.5)}),
        (CLUTTER, {"vel_ned_m_s": (2.0, 1.0, 0.0)}),
    ],
)
def test_two_ticks_from_one_memory_are_equal_to_the_last_bit_in_every_way_of_answering(circles, given) -> None:
    pilot = Pilot(Eye(world(circles), sigma_m=0.01), GOAL)
    for count in (30, 1, 5, 1):
        pilot.ticks(count)
        before, inputs = pilot.memory, pilot.eye.inputs(pilot.t_s + DT_S, **given)
        assert_pure(before, inputs, pilot.take(inputs), GOAL)


def test_a_tick_neither_draws_from_nor_seeds_global_random_numbers() -> None:
    np.random.seed(7)
    random.seed(7)
    drawn = (repr(np.random.get_state()), random.getstate())
    first = Pilot(Eye(world(CLUTTER)), GOAL).ticks(40)[-1]
    assert (repr(np.random.get_state()), random.getstate()) == drawn
    np.random.seed(8)
    assert bytes_of(Pilot(Eye(world(CLUTTER)), GOAL).ticks(40)[-1]) == bytes_of(first)


def test_nothing_under_the_navigator_imports_a_clock_dice_or_the_outside() -> None:
    program = "import sys, companion.navigator; print(*[m for m in sys.modules if m.startswith('companion.')])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    modules = done.stdout.split()
    assert len(modules) > 25
    for name in set(modules) - {"companion.policy.store"}:  # reads a policy's weights, once, before take-off
        path = importlib.import_module(name).__file__
        assert path is not None
        tree = ast.parse(Path(path).read_text(encoding="utf-8"))
        imported = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
        imported |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
        assert not {module.partition(".")[0] for module in imported} & CLOCKS_AND_DICE, name
        dice = [n for n in ast.walk(tree) if isinstance(n, ast.Attribute) and n.attr in ("random", "environ")]
        assert not dice, name
