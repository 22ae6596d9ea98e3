"""Who is told about missions, and when? The mission protocol on all links, and the news that clients wait for.

MISSION_CURRENT goes out every second and at every change; MISSION_ITEM_REACHED at once and ten times more.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from sitl import mission_messages
from sitl.answers import StatusText
from sitl.link import COMPONENT, Link
from sitl.mission_items import MissionType
from sitl.mission_protocol import MissionProtocol
from sitl.simulation import Simulation

Message = Any  # a MAVLink_*_message object

PERIOD_S: Final = 1.0
REPEATS: Final = 10
TARGETS: Final = (0, COMPONENT, mav.MAV_COMP_ID_MISSIONPLANNER)


class MissionService:
    """Missions of one vehicle on all its links."""

    def __init__(self, sim: Simulation, system_id: int) -> None:
        self._sim = sim
        self._system_id = system_id
        self._protocol = MissionProtocol(lambda: sim.autopilot.plans, self._say)
        self._now_s = 0.0
        self._due_s = -math.inf
        self._told: tuple[int, ...] = ()
        self._reached: int | None = None
        self._repeats = 0

    def handle(self, link: Link, message: Message) -> bool:
        """Act on a message of the mission protocol. False: it is none."""
        if not self._protocol.understands(message.get_msgId()):
            return False
        if message.target_system == self._system_id and message.target_component in TARGETS:
            link.connection.send(*self._protocol.handle(link.name, message, self._now_s))
        return True

    def tick(self, links: Sequence[Link], now_s: float) -> None:
        """Wall time has passed."""
        self._now_s = now_s
        for name, message in self._protocol.tick(now_s):
            for link in links:
                if link.name == name:
                    link.connection.send(message)
        news = self._news(now_s)
        if news:
            for link in links:
                link.connection.send(*news)

    def _say(self, text: StatusText) -> None:
        self._sim.autopilot.texts.append(text)

    def _news(self, now_s: float) -> list[Message]:
        plans, reached = self._sim.autopilot.plans, self._sim.autopilot.mission.reached
        told = (plans.current, len(plans.mission), *(plans.id_of(kind) for kind in MissionType))
        due, fresh = now_s >= self._due_s, reached is not None and reached != self._reached
        if reached != self._reached:
            self._reached, self._repeats = reached, 0
        if not (due or fresh or told != self._told):
            return []
        news = [mission_current(self._sim)] if due or told != self._told else []
        if reached is not None and (fresh or (due and self._repeats < REPEATS)):
            self._repeats += 0 if fresh else 1
            news.append(mission_messages.reached(reached))
        self._told = told
        self._due_s = max(self._due_s + PERIOD_S, now_s) if due else self._due_s
        return news


def mission_current(sim: Simulation) -> Message:
    """MISSION_CURRENT."""
    plans = sim.autopilot.plans
    mission, fence, rally = (plans.id_of(kind) for kind in MissionType)
    return mission_messages.current(plans.current, len(plans.mission), (mission, fence, rally))
