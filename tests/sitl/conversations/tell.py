"""Hold the conversations of a chapter, in order, with one vehicle: ``python -m conversations.tell CHAPTER URL``.

Says which one begins, and "all held" at the end; the first that goes wrong ends it. Files lie where it is started.
"""

import asyncio
import importlib
import sys

from conversations.client import connected

ALL_HELD = "all held"


async def chapter(name: str, url: str) -> None:
    """Connect once."""
    async with connected(url) as vehicle:
        if vehicle.armed:  # a chapter that went wrong left it in the air
            await vehicle.down()
        for conversation in importlib.import_module(f"conversations.{name}").CONVERSATIONS:
            print(conversation.name, flush=True)
            await conversation.tell(vehicle)
    print(ALL_HELD, flush=True)


if __name__ == "__main__":
    asyncio.run(chapter(*sys.argv[1:]))
