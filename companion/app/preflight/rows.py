"""What does the check before a flight say? A row for each thing looked at, and whether all of it is fit to fly."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class Grade(StrEnum):
    """How a thing was found."""

    OK = "ok"
    OPEN = "not seen"  # could not be judged; the advice says how it can be
    WARN = "warning"  # flies, but look at it
    FAIL = "fail"  # do not take off


@dataclass(frozen=True, slots=True)
class Row:
    """One thing: how it was found, and what to do about it."""

    name: str
    grade: Grade
    found: str
    advice: str = ""


@dataclass(frozen=True, slots=True)
class Report:
    """All rows."""

    rows: Sequence[Row]

    @property
    def fit(self) -> bool:
        """Nothing forbids the take-off."""
        return all(row.grade is not Grade.FAIL for row in self.rows)

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready."""
        rows = [{"name": r.name, "grade": str(r.grade), "found": r.found, "advice": r.advice} for r in self.rows]
        return {"fit": self.fit, "rows": rows}
