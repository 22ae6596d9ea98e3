"""How does the check look? A table for a person, one JSON object for a machine."""

import json

from rich.console import Console
from rich.table import Table
from rich.text import Text

from companion.app.preflight.rows import Grade, Report

STYLES = {Grade.OK: "green", Grade.OPEN: "cyan", Grade.WARN: "yellow", Grade.FAIL: "bold red"}
WIDTH_UNSEEN = 140  # columns where nobody looks: a file, a pipe, a journal


def print_table(report: Report) -> None:
    """The table, and a last line with the answer."""
    console = Console()
    if not console.is_terminal:
        console = Console(width=WIDTH_UNSEEN)
    table = Table(show_edge=False, pad_edge=False)
    for heading in ("", "check", "found", "do"):
        table.add_column(heading, overflow="fold")
    for row in report.rows:
        table.add_row(Text(str(row.grade), STYLES[row.grade]), Text(row.name), Text(row.found), Text(row.advice))
    console.print(table)
    console.print(_answer(report))


def print_json(report: Report) -> None:
    """One object."""
    print(json.dumps(report.as_dict()))


def _answer(report: Report) -> Text:
    counts = {grade: sum(row.grade is grade for row in report.rows) for grade in Grade}
    rest = ", ".join(f"{counts[grade]} {grade}" for grade in (Grade.WARN, Grade.OPEN) if counts[grade])
    rest = f" ({rest})" if rest else ""
    if report.fit:
        return Text(f"fit to fly{rest}", STYLES[Grade.OK])
    return Text(f"NOT fit to fly: {counts[Grade.FAIL]} to be seen to{rest}", STYLES[Grade.FAIL])
