"""``swiftnav params``: which tunables does the companion have, and what do they mean?"""

from typing import Annotated, Any

import typer

from companion.core.params import ParamInfo, infos, nearest
from mission.cli_options import Json, print_json
from mission.errors import InputError

app = typer.Typer(help="The companion's parameters.")


@app.command("list", epilog="Example: swiftnav params list --json")
def list_params(json: Json = False) -> None:
    """Print every parameter with default and unit."""
    rows = _infos()
    if json:
        print_json([_as_dict(info) for info in rows])
        return
    for info in rows:
        typer.echo(f"{info.key:36} {info.name:16} {info.default!s:>12} {info.unit}")


@app.command(epilog="Example: swiftnav params show arbiter.d_enter_m")
def show(key: Annotated[str, typer.Argument(help="GROUP.FIELD or the UPPER_SNAKE name.")], json: Json = False) -> None:
    """Print one parameter: name, default, range, meaning."""
    rows = _infos()
    match = [info for info in rows if key in (info.key, info.name)]
    if not match:
        known = [info.key for info in rows] + [info.name for info in rows]
        close = nearest(key, known)
        raise InputError(f"unknown parameter '{key}'{close if 'did you mean' in close else ''}")
    if json:
        print_json(_as_dict(match[0]))
        return
    info = match[0]
    typer.echo(f"{info.key}  ({info.name})\n  {info.text}\n  default {info.default} {info.unit}, range {_range(info)}")


@app.command(epilog="Example: swiftnav params docs > PARAMETERS.md")
def docs(json: Json = False) -> None:
    """Print the parameter reference as Markdown."""
    rows = _infos()
    if json:
        print_json([_as_dict(info) for info in rows])
        return
    typer.echo("# Parameters of the companion\n\nPrinted by `swiftnav params docs`.")
    group = ""
    for info in rows:
        if info.key.split(".")[0] != group:
            group = info.key.split(".")[0]
            typer.echo(f"\n## {group}\n\n| key | name | default | unit | range | meaning |\n|---|---|---|---|---|---|")
        key = info.key.split(".")[1]
        typer.echo(f"| `{key}` | `{info.name}` | {info.default} | {info.unit} | {_range(info)} | {info.text} |")


def _infos() -> list[ParamInfo]:
    from companion.navigator.params import Params

    return list(infos(Params()))


def _range(info: ParamInfo) -> str:
    if info.low is None and info.high is None:
        return "any"
    low = "-inf" if info.low is None else f"{info.low:g}"
    high = "inf" if info.high is None else f"{info.high:g}"
    return f"{low} .. {high}"


def _as_dict(info: ParamInfo) -> dict[str, Any]:
    return {
        "key": info.key,
        "name": info.name,
        "default": info.default,
        "unit": info.unit,
        "low": info.low,
        "high": info.high,
        "text": info.text,
    }
