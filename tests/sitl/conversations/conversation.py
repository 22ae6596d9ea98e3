"""What is a conversation? Something told to a vehicle through either client."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from conversations.client import Vehicle


@dataclass(frozen=True, slots=True)
class Conversation:
    """One conversation, and the scripts of MAVSDK's that hold it."""

    tell: Callable[[Vehicle], Awaitable[None]]
    scripts: tuple[str, ...]

    @property
    def name(self) -> str:
        """What happens."""
        return self.tell.__name__
