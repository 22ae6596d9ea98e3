"""Is everything there for a flight? What was heard, judged row by row; the shell that listens and shows the table."""

from companion.app.preflight.listen import check
from companion.app.preflight.rows import Grade, Report, Row

__all__ = ["Grade", "Report", "Row", "check"]
