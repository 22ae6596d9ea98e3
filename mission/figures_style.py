"""Which colours and words do the pictures of a flight share?"""

MODE_COLOURS = {
    "standby": "#9aa0a6",
    "travel": "#2b6cb0",
    "rl": "#d9580d",
    "landing": "#2f9e44",
    "hold": "#c92a2a",
}
MODE_LABELS = {"standby": "take-off", "travel": "Travel", "rl": "RL", "landing": "Landing", "hold": "Hold"}
PROPOSAL_COLOUR = "#8a63d2"
GOOD_COLOUR, BAD_COLOUR = "#2f9e44", "#c92a2a"
INK = "#22252a"
MUTED = "#7a7f87"
GRID_COLOUR = "#e4e1da"
