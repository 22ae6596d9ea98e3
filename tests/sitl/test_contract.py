"""The page about the MAVLink contract is the vehicle's own tables, and every entry says what it does."""

from pathlib import Path

from sitl import contract

PAGE = Path(__file__).parents[2] / "docs" / "mavlink.md"


def test_the_page_is_up_to_date() -> None:
    assert PAGE.read_text(encoding="utf-8") == contract.page(), "run `make docs`"


def test_no_cell_of_commands_and_messages_is_empty() -> None:
    for table in (contract._commands(), contract._understood(), contract._modes()):
        assert all(all(row) for row in table)
