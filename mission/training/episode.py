"""What happens between one RL decision and the next? A mission in-process that pauses where the policy is asked.

The navigator that flies is the one that trains: ``navigator.sense`` ends where a question is due, ``navigator.act``
goes on with the answer. Before the hand-over the vehicle climbs by itself. A flight ends with success when Landing
holds within half a metre of the goal (the descent is nobody's lesson), or, ``until="landed"``, when it stands there.
"""

import dataclasses
import math
from collections import Counter
from dataclasses import dataclass
from typing import Any, Literal

from companion import navigator
from companion.arbiter.arbiter import switch_bound
from companion.arbiter.facts import ArbiterParams
from companion.checker.checker import check, unchecked
from companion.core.codec import quantise_setpoint
from companion.core.inputs import Inputs
from companion.core.types import F64, NavMode
from companion.guidance import line
from companion.navigator.decide import question
from companion.navigator.memory import Engagement
from companion.policy.interface import Proposal, Query
from mission.training.flight import HANDOVER_S, Flight, FlightSpec
from mission.training.reward import TickFacts
from sitl.simulation import Observation

Until = Literal["above", "landed"]
ARRIVED_M = 0.5  # as the missions ask of a landing
STABLE = ArbiterParams()  # whose switch bound every flight is compared with
TIME_RESOLUTION_S = 1e-6


@dataclass(slots=True)
class ModeLog:
    """Who flew, and for how long."""

    decisions: int = 0
    verdicts: Counter[str] = dataclasses.field(default_factory=Counter)
    guarded: int = 0  # decisions in which the expert's path was flown instead
    rl_time_s: float = 0.0
    switches: int = 0
    aborts: int = 0
    hasty: int = 0  # switches sooner after the one before than dwell and debounce allow
    switched_t_s: float = -math.inf


class Episode:
    """One flight under the navigator. ``query`` is the question that waits for an answer; None once it is over."""

    def __init__(self, spec: FlightSpec, until: Until = "above", checked: bool = True) -> None:
        self.flight = Flight(spec)
        self.entered = False  # is the waiting question the first since RL was entered?
        self._until = until
        self._judge = check if checked else unchecked
        self._params = spec.plan.params
        self._modes = ModeLog()
        self._memory = navigator.start(self._params)
        self._endpoint: tuple[float, float] | None = None
        self._asked_in_rl = False
        self._engaged: Engagement | None = None
        self._pending = self._hover()
        self._advance()

    @property
    def query(self) -> Query | None:
        """The question that waits."""
        return None if self.flight.end is not None else self._pending.query

    @property
    def memory(self) -> F64 | None:
        """What the policy handed back last."""
        return self._pending.memory.policy

    def last_view(self) -> Query:
        """What would be asked at this instant: a decision after the last, to bootstrap from."""
        pending = self._pending
        engaged = pending.engaged or self._engaged  # disarmed: as it was in flight
        assert engaged is not None  # the flight has been handed over
        return question(engaged, pending.inputs.state, pending.percept, self.flight.spec.plan.task, self._params)

    def decide(self, proposal: Proposal | None, memory: F64 | None) -> None:
        """Answer the question and fly on to the next one, or to the end."""
        if self.query is None:
            raise RuntimeError("the flight is over: reset first")
        self._modes.decisions += 1
        self._act(navigator.Answer(proposal, memory))
        self._pending = self._sense()
        self._advance()

    def figures(self) -> dict[str, Any]:
        """What is said of a flight that is over."""
        modes, flight = self._modes, self.flight
        return flight.figures() | {
            "decisions": modes.decisions,
            "switches": modes.switches,
            "switches_bound": switch_bound(flight.time_s, STABLE, modes.aborts),
            "hasty_switches": modes.hasty,
            "kept": modes.verdicts["kept"],
            "next": modes.verdicts["next"],
            "modified": modes.verdicts["modified"],
            "escaped": modes.verdicts["escape"],
            "refused": modes.verdicts["refused"],
            "guarded": modes.guarded,
            "rl_time_s": round(modes.rl_time_s, 3),
        }

    def _hover(self) -> navigator.Pending:
        """Take off, look round, hand over; the first tick of the navigator's own flight."""
        flight = self.flight
        seen = flight.take_off()
        hover_s = flight.sim.t_s
        while True:
            self._pending = navigator.sense(self._memory, _inputs(seen), flight.spec.plan.task, self._params)
            self._act(None)
            if flight.sim.t_s - hover_s >= HANDOVER_S - TIME_RESOLUTION_S:
                break
            seen = flight.next_scan()
        flight.hand_over()
        return self._sense()

    def _advance(self) -> None:
        """To the next question or the end."""
        while self.flight.end is None and self._pending.query is None:
            self._act(None)
            self._pending = self._sense()

    def _sense(self) -> navigator.Pending:
        seen = self.flight.next_scan()
        pending = navigator.sense(self._memory, _inputs(seen), self.flight.spec.plan.task, self._params)
        self._count(pending)
        self.flight.judge(self._facts(pending), self._arrived(pending))
        self._endpoint = None
        return pending

    def _act(self, answer: navigator.Answer | None) -> None:
        self._memory, setpoint, record = navigator.act(self._pending, answer, self._judge)
        self.flight.answer(quantise_setpoint(setpoint))
        if record.decision is not None:
            verdict = record.decision.verdict
            self._modes.verdicts[str(verdict.kind)] += 1
            self._modes.guarded += record.decision.guarded
            if verdict.path_ned_m is not None:
                north_m, east_m = verdict.path_ned_m[-1].tolist()
                self._endpoint = (north_m, east_m)

    def _facts(self, pending: navigator.Pending) -> TickFacts:
        """``goal_distance_m`` and failures are the flight's to fill in: truth."""
        state, engaged = pending.inputs.state, pending.engaged
        north_m, east_m = state.pos_ned_m[:2].tolist()
        mode, off_m = "standby", None
        if engaged is not None:
            mode = "hold" if engaged.arbiter.hold else str(engaged.arbiter.mode)
            off_m = line.errors(engaged.line, state.pos_ned_m[:2], 0.0).cross_track_m
        return TickFacts(
            state.t_s,
            (north_m, east_m),
            pending.goal_m,
            pending.percept.d_min_m,
            mode,
            self._endpoint,
            cross_track_m=off_m,
        )

    def _arrived(self, pending: navigator.Pending) -> bool:
        near = self.flight.goal_m < ARRIVED_M
        if self._until == "landed":
            return near and self.flight.sim.finished
        return near and pending.engaged is not None and pending.engaged.arbiter.mode == NavMode.LANDING

    def _count(self, pending: navigator.Pending) -> None:
        engaged, modes = pending.engaged, self._modes
        if engaged is None:
            return
        self._engaged = engaged
        t_s, in_rl = pending.inputs.state.t_s, engaged.arbiter.mode == NavMode.RL
        if in_rl:
            modes.rl_time_s += t_s - self._memory.t_s
        if engaged.arbiter.switches > modes.switches:
            least_s = max(STABLE.dwell_s, STABLE.debounce_s) - TIME_RESOLUTION_S
            aborted = engaged.arbiter.aborts > modes.aborts  # a landing: the one exit that need not wait
            modes.hasty += t_s - modes.switched_t_s < least_s and not aborted
            modes.switched_t_s = t_s
        modes.switches, modes.aborts = engaged.arbiter.switches, engaged.arbiter.aborts
        self.entered = pending.query is not None and not self._asked_in_rl
        self._asked_in_rl = in_rl and (self._asked_in_rl or pending.query is not None)


def _inputs(seen: Observation) -> Inputs:
    return Inputs(seen.state, seen.scan, seen.status)
