"""How is a flight set up that is going to be disturbed?  Vehicle and companions as processes, a pilot who steers.

The companion can be killed and started again; its link can run through a bad radio.
"""

import dataclasses
import json
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from mission.flight_folder import write_inputs
from mission.flight_plan import FlightPlan
from mission.pilot import Pilot
from mission.processes import Child, Children
from mission.runner import FlySettings, companion_arguments, vehicle_config


class Rig:
    """One flight in ``folder``; everything ends with the context."""

    def __init__(self, plan: FlightPlan, settings: FlySettings, folder: Path, companion_url: str | None = None) -> None:
        """``companion_url``: where the companion listens instead of the vehicle's own port."""
        self.plan, self.settings, self.folder = plan, settings, folder
        self._companion_url = companion_url
        self._stack = ExitStack()
        self._companions = 0

    def __enter__(self) -> Self:
        """The vehicle stands ready, without a companion."""
        self.folder.mkdir(parents=True, exist_ok=True)
        write_inputs(self.plan, self.folder, self.settings.as_dict())
        self.children = self._stack.enter_context(Children())
        self.pilot = Pilot(self.settings.instance)
        self._stack.callback(self.pilot.close)
        told = vehicle_config(self.plan, self.settings, self.folder)
        told = dataclasses.replace(told, run=dataclasses.replace(told.run, gates=False))
        config = self.folder / "vehicle.json"
        config.write_text(json.dumps(told.to_json()), encoding="utf-8")
        self.vehicle = self.children.start("vehicle", "sitl", [str(config)], self.folder / "vehicle.log")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End all processes."""
        self._stack.close()

    def start_companion(self) -> Child:
        """One more companion, with a folder of its own below the flight's; the task is the plan's."""
        self._companions += 1
        folder = self.folder / f"companion_{self._companions}"
        folder.mkdir()
        words = companion_arguments(self.plan, self.settings, folder)
        words[words.index("--params") + 1] = str(self.folder / "params.yaml")
        if self._companion_url is not None:
            words[words.index("--vehicle") + 1] = self._companion_url
        return self.children.start(folder.name, "companion", words, folder / "companion.log")

    def end(self) -> None:
        """End the vehicle, so that its logs are whole."""
        self.children.end(self.vehicle)


def paced(speed: float, instance: int) -> FlySettings:
    """Settings of a flight whose time goes on whether somebody answers or not."""
    return FlySettings(speed, lockstep=False, instance=instance)
