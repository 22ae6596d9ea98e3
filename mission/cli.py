"""What can a person type?  The console script ``swiftnav``: parses, hands over, turns every mistake into one line.

Importing this module must stay quick: each command imports what it needs when it runs.
"""

import sys
from collections.abc import Sequence

import typer

from companion.core.params import ParamError
from mission.cli_bench import app as bench_app
from mission.cli_clone import clone
from mission.cli_eval import evaluate, export
from mission.cli_fly import fly
from mission.cli_params import app as params_app
from mission.cli_reproduce import reproduce
from mission.cli_ship import ship
from mission.cli_ship_clone import ship_clone
from mission.cli_sitl import sitl
from mission.cli_train import train
from mission.cli_worlds import app as worlds_app
from mission.errors import FlightError, InputError

PROG = "swiftnav"
GROUPS: tuple[list[str], ...] = ([], ["worlds"], ["params"], ["bench"])  # nothing to do: help
EXIT_FAILED = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130  # 128 + SIGINT, as shells have it

app = typer.Typer(
    help="SWIFT-Nav: a companion app that flies PX4-class vehicles through clutter, and a vehicle to fly it against.",
    epilog="Example: swiftnav fly trajectory2 --seed 1",
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command(epilog="Example: swiftnav fly trajectory2 --seed 7 --json")(fly)
app.command(epilog="Example: swiftnav sitl --world trajectory1 --speed 1")(sitl)
app.command(epilog="Example: swiftnav train --world trajectory1 --seeds 5 --until-successes 100")(train)
app.command(epilog="Example: swiftnav clone --world mixed:train --seed 1 --out runs/forest")(clone)
app.command(epilog="Example: swiftnav reproduce --only t1,t2 --seeds 5 --jobs 2 --out reproduce")(reproduce)
app.command("eval", epilog="Example: swiftnav eval geometric --world barrier --episodes 60 --json")(evaluate)
app.command(epilog="Example: swiftnav ship runs/RUN --seed 3 --name trajectory2")(ship)
app.command("ship-clone", epilog="Example: swiftnav ship-clone runs/forest --name forest --episodes 20")(ship_clone)
app.command(epilog="Example: swiftnav export trajectory2 --onnx trajectory2.onnx")(export)
app.add_typer(worlds_app, name="worlds")
app.add_typer(params_app, name="params")
app.add_typer(bench_app, name="bench")


@app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []},
    epilog="Example: swiftnav companion --goal 55 0 -3",
)
def companion() -> None:
    """The app alone, as on the drone: the same door as 'python -m companion'."""
    raise AssertionError("main() takes this command before typer does")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code; one line on stderr for whatever went wrong."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given in GROUPS:
        given.append("--help")
    try:
        if given[:1] == ["companion"]:
            from mission.cli_companion import companion as run_companion

            return run_companion(given[1:])
        code = app(given, prog_name=PROG, standalone_mode=False)
        if code == EXIT_INTERRUPTED:  # typer has caught Ctrl-C
            raise KeyboardInterrupt
        return code if isinstance(code, int) else 0
    except typer.TyperException as error:
        return _complain(error.format_message(), EXIT_BAD_INPUT)
    except (InputError, ParamError) as error:
        return _complain(str(error), EXIT_BAD_INPUT)
    except FlightError as error:
        return _complain(str(error), EXIT_FAILED)
    except OSError as error:  # a disk that is full, a folder that may not be written
        text = error.strerror or str(error)
        return _complain(f"{error.filename}: {text}" if error.filename else text, EXIT_FAILED)
    except KeyboardInterrupt:
        return _complain("interrupted", EXIT_INTERRUPTED)


def _complain(text: str, code: int) -> int:
    print(f"{PROG}: {' '.join(text.split())}", file=sys.stderr)
    return code
