"""What does the paper say came out, and where?  Each claim with its rule and the arms that are asked.

``default`` is our preset, ``paper`` the settings as printed.
"""

from mission.reproduce import claim_rules as rules
from mission.reproduce.claims import Claim

T1 = {"default": ("t1",), "paper": ("t1_paper",)}
T2 = {"default": ("t2",), "paper": ("t2_paper",)}
BASELINE = {"default": ("vanilla", "t1"), "paper": ("vanilla_paper", "t1_paper")}
NO_STABILITY = {"default": ("no_stability", "t2")}
NO_CHECKER = {"default": ("no_checker", "t2")}

INTRO = "Results, introduction"
CURVES = "Results, Steps and Rewards"
PATHS = "Results, Trajectories"
ABLATIONS = "Results, Ablation Studies"
DISCUSSION = "Results, Discussion"

CLAIMS = (
    Claim(
        "reaches_t1",
        INTRO,
        "Trajectory 1 is trained until 100 successful episodes have been achieved",
        "four seeds in five get there within the limit of episodes",
        T1,
        rules.reaches,
    ),
    Claim("reaches_t2", INTRO, "... and Trajectory 2", "the same", T2, rules.reaches),
    Claim(
        "vanilla_fails",
        INTRO,
        "vanilla TD3 exhibits non-convergent learning on Trajectory 1 under an equal budget",
        "four seeds in five have neither 100 successes within the ticks of SWIFT-Nav nor half of the last 50 episodes",
        BASELINE,
        rules.never_converges,
    ),
    Claim(
        "vanilla_longer",
        f"{PATHS}; Fig. traj1_compare",
        "the baseline takes a noticeably longer route with multiple detours",
        "greedy, it flies 20 % more metres for a metre nearer to the goal",
        BASELINE,
        rules.longer,
    ),
    Claim(
        "vanilla_oscillates",
        f"{PATHS}; Abstract",
        "... and local oscillations; SWIFT-Nav outperforms it in smoothness",
        "greedy, it turns 20 % more degrees a metre",
        BASELINE,
        rules.oscillates,
    ),
    Claim(
        "t1_straight",
        PATHS,
        "SWIFT-Nav follows a short, near-straight path on Trajectory 1",
        "greedy path ratio at most 1.15 at a success of at least 0.95",
        T1,
        rules.near_straight,
    ),
    Claim(
        "t1_switches",
        DISCUSSION,
        "... with only a few, sustained mode switches",
        "greedy, at most 6 switches a flight and none sooner than dwell and debounce allow",
        T1,
        rules.few_switches,
    ),
    Claim(
        "t1_tight",
        f"{CURVES}; Conclusions",
        "within a few dozen episodes the averages of steps and return on Trajectory 1 collapse into a tight band",
        "from episode 50 on each curve stays within 20 % of its level, in four seeds of five",
        T1,
        rules.tight_band,
    ),
    Claim(
        "t2_return",
        f"{CURVES}; Discussion",
        "on Trajectory 2 the smoothed return rises by roughly ten to the fourth",
        "last minus first 15 episodes rounds to that power of ten",
        T2,
        rules.return_rises,
    ),
    Claim(
        "t2_steps",
        f"{CURVES}; {ABLATIONS} (baseline)",
        "... while the step count stays bounded and trends downward",
        "the last 15 episodes are shorter than the first, the curve never at the time limit, in four seeds of five",
        T2,
        rules.steps_fall,
    ),
    Claim(
        "t2_ripples",
        CURVES,
        "brief mid-training ripples fade as the policy stabilizes",
        "the smooth return wobbles less in its last third than in its middle one",
        T2,
        rules.ripples_fade,
    ),
    Claim(
        "t2_detours",
        "Results, Trajectory 2 trend",
        "early episodes exhibit large detours; paths become progressively shorter",
        "a tenth fewer metres for a metre gained, last 15 episodes against first, in four seeds of five",
        T2,
        rules.detours_shrink,
    ),
    Claim(
        "joint_t1",
        CURVES,
        "steps down and reward up with shrinking variance, on Trajectory 1",
        "mean and spread of the last 15 episodes against the first, all four better, in four seeds of five",
        T1,
        rules.joint_trend,
    ),
    Claim("joint_t2", CURVES, "... and on Trajectory 2", "the same", T2, rules.joint_trend),
    Claim(
        "rl_rare",
        "Experimental Setup",
        "RL is rarely invoked on Trajectory 1, longer and more often on Trajectory 2",
        "RL flies at most half of the time on Trajectory 1, and less than on 2",
        {"default": ("t1", "t2"), "paper": ("t1_paper", "t2_paper")},
        rules.less_rl,
    ),
    Claim(
        "no_stability_return",
        ABLATIONS,
        "No-Stability: the return curve exhibits a downward trend with large oscillations",
        "it ends below its beginning in four seeds of five, and wobbles more than with stability",
        NO_STABILITY,
        rules.return_declines,
    ),
    Claim(
        "no_stability_steps",
        ABLATIONS,
        "No-Stability: the step count fluctuates heavily",
        "the smooth steps wobble half again as much",
        NO_STABILITY,
        rules.steps_fluctuate,
    ),
    Claim(
        "no_stability_switches",
        ABLATIONS,
        "No-Stability causes unstable switching between modes",
        "twice the switches an episode, and episodes beyond the bound that stability guarantees",
        NO_STABILITY,
        rules.chatters,
    ),
    Claim(
        "no_checker_flat",
        ABLATIONS,
        "No-Checker: almost flat return and step curves, learning stagnates early",
        "both change by at most a quarter of what they change with the checker",
        NO_CHECKER,
        rules.stagnates,
    ),
    Claim(
        "no_checker_paths",
        ABLATIONS,
        "No-Checker: safe but overly conservative trajectories",
        "contact in at most 5 % of the episodes, successful paths of the last 50 a fifth longer",
        NO_CHECKER,
        rules.conservative,
    ),
    Claim(
        "both_essential",
        ABLATIONS,
        "stability logic and checker are both essential",
        "without either: 10 points less success in the last 50 episodes, or a fifth fewer successes in the first 100",
        {"default": ("no_stability", "no_checker", "t2")},
        rules.essential,
    ),
    Claim(
        "per_quicker",
        DISCUSSION,
        "prioritized replay accelerates learning",
        "more successes in the first 100 episodes than with uniform replay, the intervals over seeds apart",
        {"default": ("replay_per", "replay_uniform")},
        rules.quicker,
    ),
    Claim(
        "generalises",
        "Abstract",
        "outperforms baselines in generalization to unseen layouts",
        "trained and flown in different forests: greedy success of at least 0.9, its interval above the baseline's",
        {"default": ("world_forest", "vanilla_forest")},
        rules.generalises,
    ),
    Claim(
        "real_time",
        "Abstract",
        "preserving real-time responsiveness",
        "99 % of the ticks with a decision take less wall time than a scan takes to come, 40 ms",
        T2,
        rules.real_time,
    ),
)
