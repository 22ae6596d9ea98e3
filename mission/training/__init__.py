"""Environments, rewards and worlds that policies are trained in; training needs the extra ``train``, flying them not.

``gymnasium.make("mission.training:SwiftNav-v0", world="trajectory2", config=EnvConfig())``, the baseline is
``SwiftNavLowLevel-v0``.
"""

import importlib.util

ENVIRONMENTS = {
    "SwiftNav-v0": "mission.training.env:SwiftNavEnv",
    "SwiftNavLowLevel-v0": "mission.training.low_level:SwiftNavLowLevelEnv",
}

if importlib.util.find_spec("gymnasium") is not None:
    import gymnasium

    for _name, _entry in ENVIRONMENTS.items():
        if _name not in gymnasium.registry:
            gymnasium.register(id=_name, entry_point=_entry)
