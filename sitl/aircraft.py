"""Where is the aircraft, and how does JSBSim load it? Feet and pounds end here and in ``vehicle``."""

from pathlib import Path

import jsbsim

FT_M = 0.3048
IN_M = 0.0254
LB_N = 4.4482216152605

MASS_KG = 0.907  # mavic2pro.xml
GRAVITY_M_S2 = 9.80665  # planet.xml
REST_HEIGHT_M = 0.06 - MASS_KG * GRAVITY_M_S2 / (4 * 400.0)  # legs of 0.06 m on four springs of 400 N/m
FULL_THRUST_N = 4 * 4.9  # rotors.xml

MODELS = Path(__file__).resolve().parent.parent / "models" / "aircraft"  # beside sitl, in a checkout as in a wheel
NAME = "mavic2pro"

AXES = "ned"
ROTORS = ("fr", "rl", "fl", "rr")  # front right, rear left, front left, rear right: PX4's quad x
# Properties that ``vehicle`` reads for its truth, in that order, and those that it writes.
TURBULENCE = "atmosphere/turbulence/milspec"
READ = (
    "position/ecef-z-ft",
    "position/ecef-y-ft",
    "position/h-sl-ft",
    "velocities/v-north-fps",
    "velocities/v-east-fps",
    "velocities/v-down-fps",
    "attitude/phi-rad",
    "attitude/theta-rad",
    "attitude/psi-rad",
    "velocities/p-rad_sec",
    "velocities/q-rad_sec",
    "velocities/r-rad_sec",
    "forces/fbx-total-lbs",
    "forces/fby-total-lbs",
    "forces/fbz-total-lbs",
    "rotor/thrust-lbs",
)
# What the control loops do, for telemetry: tilt wanted (body down axis in ned), thrust, body rates, rotor speeds.
LOOPS = (
    *(f"att/z-{axis}" for axis in AXES),
    "mix/thrust",
    *(f"rsp/{axis}" for axis in "pqr"),
    *(f"rotor/speed-{rotor}-norm" for rotor in ROTORS),
)
CONTACTS = tuple(f"contact/unit[{i}]/WOW" for i in range(8))
WRITTEN = (
    "simulation/randomseed",
    "ap/armed",
    "ap/mode",
    "ap/rest-height-m",
    *(f"{group}-{axis}" for group in ("sp/pos", "sp/vel", "sp/acc", "sp/z", "use/pos", "use/vel") for axis in AXES),
    *(f"sp/{axis}-rad_s" for axis in "pqr"),
    "sp/yaw-rad",
    "sp/yaw-rate-rad_s",
    "use/yaw",
    "sp/thrust",
    *(f"sp/motor-{rotor}" for rotor in ROTORS),
    *(f"rotor/effectiveness-{rotor}" for rotor in ROTORS),
    *(f"external_reactions/rotor_{rotor}/location-{axis}-in" for rotor in ROTORS for axis in "xy"),
    *(f"atmosphere/wind-{axis}-fps" for axis in ("north", "east", "down")),
    "atmosphere/turb-type",
    f"{TURBULENCE}/windspeed_at_20ft_AGL-fps",
    f"{TURBULENCE}/severity",
)


def load(dt_s: float) -> jsbsim.FGFDMExec:
    """A silent JSBSim with the aircraft on its flat planet. Raises RuntimeError naming the folder."""
    base = jsbsim.FGJSBBase()  # type: ignore[no-untyped-call]
    base.debug_lvl = 0  # static in JSBSim: silences the banner of the next constructor too
    fdm = jsbsim.FGFDMExec(str(MODELS.parent))
    fdm.set_debug_level(0)
    fdm.set_dt(dt_s)
    fdm.set_aircraft_path(MODELS.name)
    # The planet comes first: the model's initial conditions are taken on it.
    if not fdm.load_planet(str(MODELS / NAME / "planet.xml"), False) or not fdm.load_model(NAME):
        raise RuntimeError(f"JSBSim cannot load {NAME} from {MODELS}")
    fdm.run_ic()
    return fdm


def node(fdm: jsbsim.FGFDMExec, name: str) -> jsbsim.FGPropertyNode:
    """A property that must exist; its bound get and set methods are ten times quicker than access by name."""
    found = fdm.get_property_manager().get_node(name)
    if found is None:
        raise KeyError(f"the aircraft has no property '{name}'")
    return found
