"""Ports for flights in tests: no two workers share an instance."""

import contextlib
import os

import pytest

from mission.errors import InputError
from mission.runner import check_ports

WORKERS = 5


@pytest.fixture
def instance() -> int:
    """An instance whose ports nobody uses."""
    worker = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")) % WORKERS
    for number in (9 - worker, 4 - worker):
        with contextlib.suppress(InputError):
            check_ports(number)
            return number
    pytest.fail("the ports of both instances of this worker are taken")
