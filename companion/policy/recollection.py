"""What does a learned policy remember of its flight? One float array of fixed size; pure; local NED.

Ranges alone do not lead out of a trap: what matters there is what the vehicle did. Kept are where it was during the
last twelve seconds, how long it has been in RL mode, how near to the goal it has been, and what was decided last.
"""

import numpy as np

from companion.core.types import F64
from companion.policy.goal_frame import GoalFrame
from companion.policy.interface import Query

T, RL_TIME, BEST, DECIDED, COURSE, TURN = range(6)  # place of each number
PLACES = 25  # time, north, east: oldest first
PLACE_EVERY_S = 0.5
SIZE = 6 + 3 * PLACES
PAUSE_S = 1.0  # between two decisions counts at most so much as time in RL mode
WINDOWS_S = (4.0, 12.0)  # net displacement over these

FEATURES = 14
# What changes sign in the mirror: right-hand components, the turn.
MIRROR = np.array([1.0, -1.0, 1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0])

SPEED_M_S, TIME_S, LOST_M, LATERAL_M, GOAL_M, LAST_M = 3.0, 30.0, 10.0, 10.0, 20.0, 5.0  # scales of the features


def entered(query: Query, memory: F64 | None) -> F64:
    """The memory (81,) with the present moment in it; None: nothing is remembered yet."""
    state = query.state
    here = np.array([state.t_s, state.pos_ned_m[0], state.pos_ned_m[1]])
    goal_m = float(np.hypot(*(query.goal_ne_m - state.pos_ned_m[:2])))
    if memory is None or not here[0] >= memory[T]:
        return np.concatenate([[here[0], 0.0, goal_m, 0.0, 0.0, 0.0], np.tile(here, PLACES)])
    memory = memory.copy()
    memory[RL_TIME] += min(here[0] - memory[T], PAUSE_S)
    memory[T] = here[0]
    memory[BEST] = min(memory[BEST], goal_m)
    places = memory[SIZE - 3 * PLACES :].reshape(PLACES, 3)
    if here[0] - places[-1, 0] >= PLACE_EVERY_S - 1e-6:
        places[:-1] = places[1:].copy()
        places[-1] = here
    return memory


def decided(memory: F64, course_rad: float, turn: float) -> F64:
    """The memory with what was chosen: course over ground and turn in [-1, 1]."""
    memory = memory.copy()
    memory[[DECIDED, COURSE, TURN]] = 1.0, course_rad, turn
    return memory


def flown(memory: F64, course_rad: float) -> F64:
    """The memory with the course that is flown in place of what was chosen: the checker may have taken another."""
    memory = memory.copy()
    memory[COURSE] = course_rad
    return memory


def last_course_rad(memory: F64) -> float | None:
    """Course over ground that was decided last; None before the first decision."""
    return float(memory[COURSE]) if memory[DECIDED] else None


def features(query: Query, memory: F64, frame: GoalFrame) -> F64:
    """(14,) numbers of order one in the goal frame.

    Velocity (2), last heading off the goal bearing as cosine and sine, its turn, time in RL mode, net displacement over
    4 s and 12 s (2 each), distance lost against the best, offset right of the line from start to goal, goal distance
    and, for the last metres, how much of 5 m is flown.

    Args:
        query: the present moment.
        memory: as ``entered`` returns it for this query.
        frame: of the query.
    """
    state = query.state
    heading = memory[COURSE] - frame.course_rad
    goal_m = float(np.hypot(*(query.goal_ne_m - state.pos_ned_m[:2])))
    out = np.empty(FEATURES)
    out[0:2] = frame.turned(state.vel_ned_m_s[:2]) / SPEED_M_S
    out[2:5] = np.array([np.cos(heading), np.sin(heading), memory[TURN]]) * memory[DECIDED]
    out[5] = memory[RL_TIME] / TIME_S
    for k, window_s in enumerate(WINDOWS_S):
        out[6 + 2 * k : 8 + 2 * k] = frame.turned(_displacement(memory, state.pos_ned_m[:2], window_s)) / (
            SPEED_M_S * window_s
        )
    out[10] = (goal_m - memory[BEST]) / LOST_M
    out[11] = _lateral(query) / LATERAL_M
    out[12] = goal_m / GOAL_M
    out[13] = 1.0 - min(goal_m / (LAST_M), 1.0)
    return np.clip(out, -2.0, 2.0)


def _displacement(memory: F64, pos_ne_m: F64, window_s: float) -> F64:
    """From where the vehicle was a while ago, or as long ago as is remembered, to where it is."""
    places = memory[SIZE - 3 * PLACES :].reshape(PLACES, 3)
    index = int(np.searchsorted(places[:, 0], memory[T] - window_s + 1e-6, side="right")) - 1
    moved: F64 = pos_ne_m - places[max(index, 0), 1:]
    return moved


def _lateral(query: Query) -> float:
    """How far right of the line from start to goal the vehicle is."""
    line = query.goal_ne_m - query.start_ne_m
    away = query.state.pos_ned_m[:2] - query.start_ne_m
    length_m = float(np.hypot(line[0], line[1]))
    return float(line[0] * away[1] - line[1] * away[0]) / length_m if length_m > 0.0 else 0.0
