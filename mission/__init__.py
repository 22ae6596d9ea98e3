"""What needs both houses: worlds, missions, operator, runner, reports, command line."""
