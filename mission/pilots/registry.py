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
    "geometric": ("mission.pilots.swiftnav", "SwiftNav"),
}


def pilot_names() -> list[str]:
    """Every name that ``pilot_named`` knows, in the order of the tables."""
    return list(PILOTS)


def pilot_named(name: str) -> Pilot:
    """The pilot of that name. Raises InputError with the nearest name."""
    if name not in PILOTS:
        raise InputError(f"unknown pilot '{name}'{nearest(name, pilot_names())}")
    module, factory = PILOTS[name]
    make: Callable[[], Pilot] = getattr(import_module(module), factory)
    return make()
