"""Which tests need the machine for themselves? Those with real ports, processes and clocks: marked ``live``.

They run one after another, after the rest has run side by side, and get another try where a busy machine made a real
clock run out (see ``make test``).
"""

import os

import pytest
from hypothesis import settings

settings.register_profile("desk", deadline=None)  # a busy machine is no fault of the code
settings.register_profile("ci", deadline=None, derandomize=True)  # the same examples every time
settings.load_profile("ci" if os.environ.get("CI") else "desk")

LIVE = {
    "test_attack",
    "test_bad_radio",
    "test_cli",
    "test_client_steering",
    "test_client_system",
    "test_companion_app_process",
    "test_companion_junk",
    "test_companion_serial",
    "test_conversations",
    "test_disturbed",
    "test_fleet",
    "test_lidar",
    "test_mavproxy",
    "test_mavproxy_talk",
    "test_mission_mavsdk",
    "test_mission_server",
    "test_operator",
    "test_preflight_vehicle",
    "test_px4_bridge",
    "test_px4_bridge_fuzz",
    "test_px4_suite",
    "test_reconnect",
    "test_runner",
    "test_same_record",
    "test_server",
    "test_server_fuzz",
    "test_server_process",
    "test_server_setpoints",
    "test_server_time",
    "test_ten_rules",
    "test_transport",
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark by file: what opens ports in one of its tests does so in most."""
    for item in items:
        if item.path.stem in LIVE:
            item.add_marker(pytest.mark.live)
