"""By which rule is each claim of the paper tested?  One function a claim: does it hold, and the figures for people."""

from mission.reproduce.claims import Measured, Seeds, UnmeasuredError, agree, decimals, mean, told, value
from mission.reproduce.measures import Figures, interval_of

TEN_THOUSAND = (3162.0, 31623.0)  # what rounds to ten to the fourth
LIMIT_STEPS = 900.0  # the time limit of 90 s
SCAN_MS = 40.0


def reaches(seeds: Seeds) -> Measured:
    """100 successes."""
    done = f"{told(seeds, 'successes', 0)} successes in {told(seeds, 'episodes', 0)} episodes"
    return agree(seeds, lambda s: value(s, "reached") > 0), done


def never_converges(vanilla: Seeds, swift: Seeds) -> Measured:
    """The baseline under equal ticks."""
    failed = agree(vanilla, lambda s: value(s, "reached") == 0 and value(s, "success_last50") < 0.5)
    late = f"success of the last 50 episodes {told(vanilla, 'success_last50')} against {told(swift, 'success_last50')}"
    return failed, f"{told(vanilla, 'successes', 0)} successes; {late}"


def longer(vanilla: Seeds, swift: Seeds) -> Measured:
    """The baseline's way."""
    metres = f"{told(vanilla, 'greedy_detour')} against {told(swift, 'greedy_detour')} m flown a metre gained"
    return mean(vanilla, "greedy_detour") >= 1.2 * mean(swift, "greedy_detour"), metres


def oscillates(vanilla: Seeds, swift: Seeds) -> Measured:
    """The baseline's turning."""
    turning = f"{told(vanilla, 'greedy_turning', 1)} against {told(swift, 'greedy_turning', 1)} deg of turning a metre"
    return mean(vanilla, "greedy_turning") >= 1.2 * mean(swift, "greedy_turning"), turning


def near_straight(seeds: Seeds) -> Measured:
    """Short."""
    good = mean(seeds, "greedy_path_ratio") <= 1.15 and mean(seeds, "greedy_success") >= 0.95
    return good, f"path ratio {told(seeds, 'greedy_path_ratio')}, success {told(seeds, 'greedy_success')}"


def few_switches(seeds: Seeds) -> Measured:
    """Sustained modes."""
    good = mean(seeds, "greedy_switches") <= 6.0 and mean(seeds, "greedy_hasty") == 0.0
    hasty = f"{told(seeds, 'greedy_hasty')} of them sooner than the dwell"
    return good, f"{told(seeds, 'greedy_switches', 1)} switches a flight, {hasty}"


def tight_band(seeds: Seeds) -> Measured:
    """After fifty episodes."""
    tight = agree(seeds, lambda s: max(value(s, "steps_tail_width"), value(s, "return_tail_width")) <= 0.2)
    widths = f"steps {told(seeds, 'steps_tail_width')}, return {told(seeds, 'return_tail_width')}"
    return tight, f"width of the curve from episode 50 on, as a share of its level: {widths}"


def joint_trend(seeds: Seeds) -> Measured:
    """Steps down, return up, spreads smaller."""

    def shows(s: Figures) -> bool:
        better = value(s, "steps_last") < value(s, "steps_first") and value(s, "return_last") > value(s, "return_first")
        calmer = value(s, "steps_sd_last") < value(s, "steps_sd_first")
        return better and calmer and value(s, "return_sd_last") < value(s, "return_sd_first")

    return agree(seeds, shows), f"{_change(seeds, 'steps')}; {_change(seeds, 'return')}; {_spreads(seeds)}"


def return_rises(seeds: Seeds) -> Measured:
    """By ten to the fourth."""
    rise = mean(seeds, "return_last") - mean(seeds, "return_first")
    return TEN_THOUSAND[0] <= rise < TEN_THOUSAND[1], f"{_change(seeds, 'return')}, a rise of {rise:.{decimals(rise)}f}"


def steps_fall(seeds: Seeds) -> Measured:
    """Bounded and downward."""
    falls = agree(seeds, lambda s: value(s, "steps_last") < value(s, "steps_first"))
    bounded = agree(seeds, lambda s: value(s, "steps_highest") < LIMIT_STEPS)
    return falls and bounded, f"{_change(seeds, 'steps')}; highest {told(seeds, 'steps_highest', 0)}"


def ripples_fade(seeds: Seeds) -> Measured:
    """Late against middle."""
    fade = mean(seeds, "return_wobble_late") < mean(seeds, "return_wobble_mid")
    mid, late = told(seeds, "return_wobble_mid", None), told(seeds, "return_wobble_late", None)
    ripples = f"{mid} in the middle third, {late} late"
    return fade, f"wobble of the smooth return {ripples}"


def detours_shrink(seeds: Seeds) -> Measured:
    """First to last."""
    shrink = agree(seeds, lambda s: value(s, "detour_last") <= 0.9 * value(s, "detour_first"))
    return shrink, f"m flown a metre gained {told(seeds, 'detour_first')} -> {told(seeds, 'detour_last')}"


def less_rl(first: Seeds, second: Seeds) -> Measured:
    """RL's share of the flight."""
    rare = mean(first, "rl_share") <= 0.5 and mean(first, "rl_share") < mean(second, "rl_share")
    return rare, f"RL flies {told(first, 'rl_share')} of the time on Trajectory 1, {told(second, 'rl_share')} on 2"


def return_declines(without: Seeds, full: Seeds) -> Measured:
    """Downward with large oscillations."""
    down = agree(without, lambda s: value(s, "return_last") < value(s, "return_first"))
    wobbles = mean(without, "return_wobble") > mean(full, "return_wobble")
    wobble = f"wobble {told(without, 'return_wobble', None)} against {told(full, 'return_wobble', None)}"
    return down and wobbles, f"{_change(without, 'return')}; {wobble}"


def steps_fluctuate(without: Seeds, full: Seeds) -> Measured:
    """Half again as much."""
    wobble = f"{told(without, 'steps_wobble', 1)} against {told(full, 'steps_wobble', 1)}"
    return mean(without, "steps_wobble") >= 1.5 * mean(full, "steps_wobble"), f"wobble of the smooth steps {wobble}"


def chatters(without: Seeds, full: Seeds) -> Measured:
    """Switches doubled, bound broken."""
    more = mean(without, "switches") >= 2.0 * mean(full, "switches")
    broken = mean(without, "above_bound") > 0.0
    episodes = f"bound broken in {told(without, 'above_bound', 1)} against {told(full, 'above_bound', 1)} episodes"
    return more and broken, f"{told(without, 'switches', 1)} against {told(full, 'switches', 1)} an episode; {episodes}"


def stagnates(without: Seeds, full: Seeds) -> Measured:
    """Less than a quarter of the full system's change."""
    flat = all(abs(_gain(without, name)) <= 0.25 * abs(_gain(full, name)) for name in ("steps", "return"))
    changes = f"{_change(without, 'steps')}; {_change(without, 'return')}"
    return flat, f"{changes}; with the checker {_change(full, 'steps')}; {_change(full, 'return')}"


def conservative(without: Seeds, full: Seeds) -> Measured:
    """Safe and long."""
    safe = mean(without, "contact") <= 0.05
    long = mean(without, "path_ratio_last50") >= 1.2 * mean(full, "path_ratio_last50")
    ratios = f"{told(without, 'path_ratio_last50')} against {told(full, 'path_ratio_last50')}"
    return safe and long, f"contact in {told(without, 'contact')} of the episodes; path ratio of the last 50 {ratios}"


def essential(no_stability: Seeds, no_checker: Seeds, full: Seeds) -> Measured:
    """Worse without either."""

    def worse(without: Seeds) -> bool:
        fewer = mean(without, "success_last50") <= mean(full, "success_last50") - 0.1
        return fewer or mean(without, "successes_first100") <= 0.8 * mean(full, "successes_first100")

    def line(seeds: Seeds) -> str:
        return f"{told(seeds, 'success_last50')}, {told(seeds, 'successes_first100', 0)}"

    lines = f"{line(no_stability)} without stability; {line(no_checker)} without checker; {line(full)} with both"
    both = worse(no_stability) and worse(no_checker)
    return both, f"success of the last 50, successes of the first 100: {lines}"


def quicker(prioritized: Seeds, uniform: Seeds) -> Measured:
    """More successes from as many episodes, beyond the seeds' noise."""
    name = "successes_first100"
    successes = f"{told(prioritized, name, 0)} against {told(uniform, name, 0)}"
    return _lower(prioritized, name) > _upper(uniform, name), f"successes of the first 100 episodes {successes}"


def generalises(swift: Seeds, vanilla: Seeds) -> Measured:
    """Unseen forests."""
    better = mean(swift, "greedy_success") >= 0.9 and _lower(swift, "greedy_success") > _upper(
        vanilla, "greedy_success"
    )
    success = f"{told(swift, 'greedy_success')} against {told(vanilla, 'greedy_success')}"
    return better, f"greedy success in forests never seen {success}"


def real_time(seeds: Seeds) -> Measured:
    """Within a scan."""
    return mean(
        seeds, "decision_p99_ms"
    ) <= SCAN_MS, f"p99 of a tick with a decision {told(seeds, 'decision_p99_ms')} ms"


def _gain(seeds: Seeds, name: str) -> float:
    return mean(seeds, f"{name}_last") - mean(seeds, f"{name}_first")


def _change(seeds: Seeds, name: str) -> str:
    return f"{name} {told(seeds, f'{name}_first', None)} -> {told(seeds, f'{name}_last', None)}"


def _spreads(seeds: Seeds) -> str:
    pairs = [(name, mean(seeds, f"{name}_sd_first"), mean(seeds, f"{name}_sd_last")) for name in ("steps", "return")]
    return ", ".join(
        f"sd of {name} {first:.{decimals(first)}f} -> {last:.{decimals(last)}f}" for name, first, last in pairs
    )


def _lower(seeds: Seeds, name: str) -> float:
    """Of the interval over seeds."""
    return _ends(seeds, name)[0]


def _upper(seeds: Seeds, name: str) -> float:
    return _ends(seeds, name)[1]


def _ends(seeds: Seeds, name: str) -> tuple[float, float]:
    """Raises UnmeasuredError where there is no interval, as of one seed."""
    interval = interval_of(seeds, name)
    if interval is None or interval.low is None or interval.high is None:
        raise UnmeasuredError(f"the interval of {name} over seeds")
    return interval.low, interval.high
