"""How sure is a rate that was counted in so many trials? Wilson's interval."""

import math

Z_95 = 1.959964  # two-sided 95 % of the normal distribution
Interval = tuple[float, float]


def wilson(successes: int, count: int) -> Interval:
    """95 % interval of a rate; (0, 1) without trials."""
    if count == 0:
        return 0.0, 1.0
    share, z2 = successes / count, Z_95**2
    centre = (share + z2 / (2 * count)) / (1 + z2 / count)
    half = Z_95 / (1 + z2 / count) * math.sqrt(share * (1 - share) / count + z2 / (4 * count**2))
    low, high = max(0.0, centre - half), min(1.0, centre + half)
    return (0.0 if successes == 0 else low), (1.0 if successes == count else high)
