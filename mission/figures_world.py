"""What does a world look like from above? Draws into a matplotlib axes: east right, north up, metres."""

from typing import Any

from matplotlib.collections import PatchCollection
from matplotlib.patches import Circle, FancyArrowPatch, Polygon, Rectangle

from sitl.world import World, box_corners

TREE_COLOUR = "#4f7f57"
WALL_COLOUR = "#6b6157"
MOVER_COLOUR = "#c2703d"
START_COLOUR = "#2b6cb0"
GOAL_COLOUR = "#b83280"
GROUND_COLOUR = "#faf8f3"
EDGE_COLOUR = "#c9c3b6"


def draw_world(ax: Any, world: World, t_s: float = 0.0) -> None:
    """Obstacles, start, goal and bounds; movers where they are at ``t_s``, with the way they go to and fro."""
    n_min, e_min, n_max, e_max = world.bounds_m
    ax.add_patch(Rectangle((e_min, n_min), e_max - e_min, n_max - n_min, fc=GROUND_COLOUR, ec=EDGE_COLOUR, zorder=0))
    trees = [Circle((east, north), radius) for north, east, radius, _ in world.circles]
    walls = [Polygon(corners[:, ::-1]) for corners in box_corners(world.boxes)]
    ax.add_collection(PatchCollection(trees, fc=TREE_COLOUR, ec="none", zorder=2))
    ax.add_collection(PatchCollection(walls, fc=WALL_COLOUR, ec=WALL_COLOUR, lw=0.8, zorder=2))
    _draw_movers(ax, world, t_s)
    _draw_place(ax, world.start_ned_m, "o", START_COLOUR, "start")
    _draw_place(ax, world.goal_ned_m, "*", GOAL_COLOUR, "goal")
    ax.set_aspect("equal")
    ax.set_xlim(e_min - 1.0, e_max + 1.0)
    ax.set_ylim(n_min - 1.0, n_max + 1.0)
    ax.set_xlabel("east [m]")
    ax.set_ylabel("north [m]")
    ax.tick_params(direction="out", length=3)
    for side in ax.spines.values():
        side.set_visible(False)


def _draw_movers(ax: Any, world: World, t_s: float) -> None:
    for mover in world.movers:
        north, east = mover.position_ned_m(t_s)
        a, b = mover.a_ned_m[::-1], mover.b_ned_m[::-1]
        ax.add_patch(FancyArrowPatch(a, b, arrowstyle="<->", mutation_scale=8, color=MOVER_COLOUR, lw=0.9, ls="--"))
        ax.add_patch(Circle((east, north), mover.radius_m, fc=MOVER_COLOUR, ec="none", zorder=3))


def _draw_place(ax: Any, place_ned_m: Any, marker: str, colour: str, label: str) -> None:
    north, east = place_ned_m
    size = 60 if marker == "o" else 160
    ax.scatter([east], [north], marker=marker, s=size, c=colour, ec="white", lw=0.8, zorder=5, label=label)
