"""Which pilots are there, and which one has this name? A shipped policy is one as well, with the navigator round it."""

from collections.abc import Callable
from importlib import import_module

from companion.core.gridmap import MapParams
from companion.core.params import nearest
from companion.policy.store import load_policy, shipped
from mission.errors import InputError
from mission.pilots.interface import Pilot
from mission.pilots.swiftnav import SwiftNav

# Name, then module and factory: a pilot is imported when it is asked for.
PILOTS: dict[str, tuple[str, str]] = {
    "brake": ("mission.pilots.brake", "Brake"),
    "dwa": ("mission.pilots.dwa", "Dwa"),
    "vfh": ("mission.pilots.vfh", "Vfh"),
    "astar": ("mission.pilots.astar", "Astar"),
    "ompl": ("mission.pilots.ompl", "Ompl"),
    "td3_vanilla": ("mission.pilots.td3_vanilla", "Td3Vanilla"),
    "geometric": ("mission.pilots.swiftnav", "SwiftNav"),
}


def pilot_names() -> list[str]:
    """The pilots that can fly here, in the order of the tables."""
    lacking = grounded()
    return [name for name in (*PILOTS, *shipped()) if name not in lacking]


def grounded() -> dict[str, str]:
    """The pilots that cannot fly here, and why: a package or a trained policy is missing."""
    reasons = {}
    for name in PILOTS:
        try:
            pilot_named(name)
        except InputError as error:
            reasons[name] = str(error)
    return reasons


def pilot_named(name: str) -> Pilot:
    """The pilot of that name. Raises InputError with the nearest name, or with what it lacks; PolicyError."""
    if name not in PILOTS:
        known = shipped()
        if name not in known:
            raise InputError(f"unknown pilot '{name}'{nearest(name, [*PILOTS, *known])}")
        load_policy(name, MapParams())  # what may not fly is told before anything does
        return SwiftNav(name)
    module, factory = PILOTS[name]
    make: Callable[[], Pilot] = getattr(import_module(module), factory)
    return make()
