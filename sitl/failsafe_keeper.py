"""Which failsafe action is in force? PX4's bookkeeping: worst first, a delay in Hold, and a person who takes over.

Memory: the actions that still stand and the time left in Hold; time comes with the facts.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from sitl.failsafe import Action, Cause, Clears, Facts, Response, Takeover, possible, responses
from sitl.modes import FlightMode
from sitl.px4_params import ParamStore


@dataclass(slots=True)
class _Standing:
    """One action, and whether its trouble is still there."""

    response: Response
    present: bool = True


class FailsafeKeeper:
    """``update`` at every control tick; ``action`` is in force, ``text`` has to be said."""

    def __init__(self, params: ParamStore) -> None:
        self.action = Action.NONE
        self.text: str | None = None  # news of the last update
        self._params = params
        self._standing: dict[Cause, _Standing] = {}
        self._hold_until_s = -math.inf  # the delay before an action
        self._taken_over = False
        self._armed = False

    def update(self, facts: Facts) -> Action:
        """Judge one instant."""
        self.text = None
        if facts.armed is not self._armed:
            self._armed = facts.armed
            self._taken_over = False
            self._drop(Clears.ON_MODE_CHANGE)
        if facts.mode_changed or self._taken_over:
            self._drop(Clears.ON_MODE_CHANGE)
        found = responses(facts, self._params)
        if not (found or self._standing or self._taken_over or self.action):
            return self.action  # nothing is wrong, nothing was
        warned = self._merge(found, facts.t_s)
        before, delayed = self.action, False
        if before > Action.HOLD or self._taken_over:
            self._hold_until_s = -math.inf
        action = self._worst(facts)
        if facts.user_mode is FlightMode.LAND and action is Action.RETURN:
            action = Action.WARN  # already landing: no turning back
        if self._delayable(action, facts):
            action, delayed = Action.HOLD, True
        elif self._take_over(action, facts):
            fallback = found.get(Cause.FALLBACK, Response(Action.WARN)).action
            action = max(Action.WARN, possible(fallback, facts))
        self.action = possible(action, facts) if facts.armed else Action.NONE
        if self.action > before or (warned and self.action is not Action.NONE):
            self.text = self._news(delayed)
        return self.action

    def _merge(self, found: Mapping[Cause, Response], now_s: float) -> bool:
        """Bring the standing actions up to date. True when a new one only warns."""
        warned = False
        for cause, response in found.items():
            standing = self._standing.get(cause)
            if standing is not None:  # the action may get worse, the rest stays
                kept = standing.response
                standing.response = Response(response.action, kept.takeover, kept.clears)
                standing.present = True
                continue
            self._standing[cause] = _Standing(response)
            warned = warned or response.action is Action.WARN
            if response.action >= Action.HOLD:
                self._taken_over = False
            delay_s = float(self._params["COM_FAIL_ACT_T"])
            if response.takeover is Takeover.AFTER_DELAY and response.action > Action.WARN and delay_s > 0.0:
                self._hold_until_s = max(self._hold_until_s, now_s + delay_s)
        for cause in [c for c in self._standing if c not in found]:
            self._standing[cause].present = False
            if self._standing[cause].response.clears is Clears.WITH_CONDITION:
                del self._standing[cause]
        return warned

    def _worst(self, facts: Facts) -> Action:
        if self.action is Action.TERMINATE and facts.armed:
            return Action.TERMINATE
        return max((s.response.action for s in self._standing.values()), default=Action.NONE)

    def _delayable(self, action: Action, facts: Facts) -> bool:
        waits = facts.t_s < self._hold_until_s and not self._taken_over and facts.position_ok
        return waits and Action.WARN < action < Action.DISARM and self._strictest() < Takeover.NEVER

    def _take_over(self, action: Action, facts: Facts) -> bool:
        """Has a person chosen a mode against the action in force?"""
        steers = Action.HOLD <= possible(action, facts) <= Action.DESCEND
        wanted = facts.mode_changed and self.action == possible(action, facts)
        self._taken_over = steers and self._strictest() < Takeover.NEVER and (self._taken_over or wanted)
        return self._taken_over

    def _strictest(self) -> Takeover:
        return max((s.response.takeover for s in self._standing.values()), default=Takeover.ALWAYS)

    def _drop(self, clears: Clears) -> None:
        for cause in [c for c, s in self._standing.items() if s.response.clears is clears and not s.present]:
            del self._standing[cause]

    def _news(self, delayed: bool) -> str:
        if delayed:
            return f"Failsafe activated, entering Hold for {self._params['COM_FAIL_ACT_T']:.0f} seconds"
        return "Failsafe activated"
