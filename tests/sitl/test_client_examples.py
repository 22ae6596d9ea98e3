"""MAVSDK's own example scripts, unchanged, against a vehicle at real time; slow, and only where they are.

``SWIFTNAV_EXAMPLES`` names the folder (``examples`` of a clone of MAVSDK-Python), ``SWIFTNAV_EXAMPLES_PYTHON`` a Python
that has ``mavsdk==3.17.4``; ``SWIFTNAV_EXAMPLES_4`` the folder of the native ones (``py/mavsdk/examples`` of MAVSDK).
See ``mission.client_examples``. The ports are PX4's own: nothing else may use them.
"""

import os
import sys
from pathlib import Path

import pytest

from mission.client_example_table import MAVSDK_3, MAVSDK_4, Example
from mission.client_examples import Clone, run_example

FOLDER = os.environ.get("SWIFTNAV_EXAMPLES")
PYTHON = os.environ.get("SWIFTNAV_EXAMPLES_PYTHON")
NATIVE = os.environ.get("SWIFTNAV_EXAMPLES_4")
WORLDS = ("trajectory1", "trajectory2")
pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.mark.skipif(not (FOLDER and PYTHON), reason="SWIFTNAV_EXAMPLES and SWIFTNAV_EXAMPLES_PYTHON are not set")
@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("example", MAVSDK_3, ids=lambda example: example.script)
def test_an_example_of_mavsdk_3_does_what_it_should(example: Example, world: str, tmp_path: Path) -> None:
    assert FOLDER is not None
    assert PYTHON is not None
    outcome = run_example(example, Clone(Path(FOLDER).resolve(), PYTHON), world, tmp_path)
    assert outcome.fine, outcome.said
    if example.before:
        assert next(tmp_path.glob("*.ulog")).read_bytes().startswith(b"ULog")


@pytest.mark.skipif(not NATIVE, reason="SWIFTNAV_EXAMPLES_4 is not set")
@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("example", MAVSDK_4, ids=lambda example: example.script)
def test_an_example_of_mavsdk_4_does_what_it_should(example: Example, world: str, tmp_path: Path) -> None:
    assert NATIVE is not None
    outcome = run_example(example, Clone(Path(NATIVE).resolve(), sys.executable), world, tmp_path)
    assert outcome.fine, outcome.said
