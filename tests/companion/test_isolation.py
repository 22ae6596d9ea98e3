"""Does the companion import and run where the simulator's and the trainer's libraries are not installed?"""

import subprocess
import sys

BLOCKED = ("jsbsim", "torch", "gymnasium", "numba", "mavsdk", "matplotlib", "sitl", "mission")

PROGRAM = f"""
import importlib
import importlib.abc
import pkgutil
import sys

BLOCKED = {BLOCKED!r}


class Missing(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in BLOCKED:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)


sys.meta_path.insert(0, Missing())
for name in BLOCKED:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        continue
    sys.exit(f"{{name}} is not blocked")

import companion

modules = [info.name for info in pkgutil.walk_packages(companion.__path__, "companion.")]
for name in modules:
    importlib.import_module(name)
loaded = [name for name in BLOCKED if name in sys.modules]
if loaded:
    sys.exit(f"loaded: {{loaded}}")

from companion.app.command_line import main

exit_code = main(["--goal", "50", "0", "--vehicle", "udpin://127.0.0.1:" + sys.argv[1],
                  "--connect-timeout", "0.1", "--log", sys.argv[2]])
print(len(modules), exit_code)
"""


def test_every_module_imports_and_the_app_runs_without_the_other_houses(tmp_path) -> None:
    program = [sys.executable, "-c", PROGRAM, "14539", str(tmp_path / "log")]
    done = subprocess.run(program, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    modules, exit_code = map(int, done.stdout.split())
    assert modules > 40
    assert exit_code == 3  # it ran, and no vehicle answered
