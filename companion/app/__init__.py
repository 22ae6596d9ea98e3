"""The process: sockets, clock and logs around the navigator."""

from companion.app.config import CompanionConfig, ConfigError, Engage
from companion.app.run import fly, run
from companion.app.status import ExitCode, StatusLine, Summary

__all__ = ["CompanionConfig", "ConfigError", "Engage", "ExitCode", "StatusLine", "Summary", "fly", "run"]
