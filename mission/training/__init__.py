"""Environments, rewards and worlds that policies are trained in; needs the extra ``train``.

``gymnasium.make("mission.training:SwiftNav-v0", world="trajectory2", config=EnvConfig())``, the baseline is
``SwiftNavLowLevel-v0``.
"""

import gymnasium

for _name, _entry in (
    ("SwiftNav-v0", "mission.training.env:SwiftNavEnv"),
    ("SwiftNavLowLevel-v0", "mission.training.low_level:SwiftNavLowLevelEnv"),
):
    if _name not in gymnasium.registry:
        gymnasium.register(id=_name, entry_point=_entry)
