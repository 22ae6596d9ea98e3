"""Which pilots are there, and which one has this name?"""

from collections.abc import Callable
from importlib import import_module

from companion.core.params import nearest
from mission.errors import InputError
from mission.pilots.interface import Pilot

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
    return [name for name in PILOTS if name not in grounded()]


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
    """The pilot of that name. Raises InputError with the nearest name, or with what it lacks."""
    if name not in PILOTS:
        raise InputError(f"unknown pilot '{name}'{nearest(name, list(PILOTS))}")
    module, factory = PILOTS[name]
    make: Callable[[], Pilot] = getattr(import_module(module), factory)
    return make()
