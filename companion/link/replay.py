"""What did the navigator see in a past flight? The inputs again, from the telemetry log that the companion wrote."""

from collections.abc import Iterator
from pathlib import Path

from companion.core.inputs import Inputs
from companion.core.mavlink import PacketParser
from companion.core.tlog import read_tlog
from companion.link.assembler import Assembler
from companion.link.params import LinkParams


def replay(tlog_path: Path, params: LinkParams | None = None) -> Iterator[Inputs]:
    """The inputs of every tick, in order; equal to the live ones when the link parameters are.

    Raises TlogError when the file is no telemetry log.
    """
    assembler = Assembler(params or LinkParams())
    parser = PacketParser()
    for _, packet in read_tlog(tlog_path):
        for message in parser.feed(packet):
            inputs = assembler.feed(message)
            if inputs is not None:
                yield inputs
