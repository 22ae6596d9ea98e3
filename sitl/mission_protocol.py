"""How do missions, fences and rally points travel over MAVLink? PX4's server side; pure: messages and time in, messages
out.

Each link has a transfer of its own; only one upload runs at a time over all links. Items are asked for with
MISSION_REQUEST_INT, never with the deprecated MISSION_REQUEST.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final

from pymavlink.dialects.v20 import common as mav

from sitl import mission_messages
from sitl.answers import CRITICAL, INFO, StatusText
from sitl.mission_items import MAX_ITEMS, MissionItem, MissionType, from_message, verdict
from sitl.mission_store import MissionStore

Message = Any  # a MAVLink_*_message object

RETRY_S: Final = 0.25  # MAVLINK_MISSION_RETRY_TIMEOUT_DEFAULT
TIMEOUT_S: Final = 5.0  # MAVLINK_MISSION_PROTOCOL_TIMEOUT_DEFAULT
ACCEPTED: Final = int(mav.MAV_MISSION_ACCEPTED)
ERROR: Final = int(mav.MAV_MISSION_ERROR)
INVALID_ITEM: Final = "IGN MISSION_ITEM: Invalid item"


class Phase(Enum):
    """What a link is doing."""

    IDLE = "idle"
    SENDING = "sending"  # a client downloads
    RECEIVING = "receiving"  # a client uploads


@dataclass(slots=True)
class Transfer:
    """The transfer of one link."""

    phase: Phase = Phase.IDLE
    partner: tuple[int, int] = (0, 0)  # system, component
    kind: int = 0
    seq: int = 0  # of the item that comes next
    count: int = 0
    items: list[MissionItem] = field(default_factory=list)
    current: int | None = None  # the item marked as current in an upload
    whole: bool = True  # MISSION_ITEM_INT, not MISSION_ITEM
    sent_s: float = 0.0
    heard_s: float = 0.0


class MissionProtocol:
    """Serves all links of one vehicle."""

    def __init__(self, store: Callable[[], MissionStore], say: Callable[[StatusText], None]) -> None:
        self._current_store = store
        self._say = say
        self._links: dict[str, Transfer] = {}
        self._uploading: str | None = None  # the link on which an upload runs
        self._handlers: Mapping[int, Callable[[str, Transfer, Message, float], list[Message]]] = {
            mav.MAVLINK_MSG_ID_MISSION_COUNT: self._count,
            mav.MAVLINK_MSG_ID_MISSION_ITEM_INT: self._item,
            mav.MAVLINK_MSG_ID_MISSION_ITEM: self._item,
            mav.MAVLINK_MSG_ID_MISSION_REQUEST_LIST: self._request_list,
            mav.MAVLINK_MSG_ID_MISSION_REQUEST_INT: self._request,
            mav.MAVLINK_MSG_ID_MISSION_REQUEST: self._request,
            mav.MAVLINK_MSG_ID_MISSION_ACK: self._ack,
            mav.MAVLINK_MSG_ID_MISSION_CLEAR_ALL: self._clear,
            mav.MAVLINK_MSG_ID_MISSION_SET_CURRENT: self._set_current,
        }

    @property
    def _store(self) -> MissionStore:
        return self._current_store()

    def understands(self, message_id: int) -> bool:
        """Is it a message of this protocol?"""
        return message_id in self._handlers

    def handle(self, link: str, message: Message, now_s: float) -> list[Message]:
        """The answers to a message addressed to us, to go out on the same link."""
        transfer = self._links.setdefault(link, Transfer())
        return self._handlers[message.get_msgId()](link, transfer, message, now_s)

    def tick(self, now_s: float) -> list[tuple[str, Message]]:
        """Repeat what was not answered and give up what is dead; (link, message)."""
        out: list[tuple[str, Message]] = []
        for link, transfer in self._links.items():
            if transfer.phase is Phase.IDLE:
                continue
            if now_s - transfer.heard_s > TIMEOUT_S:
                self._critical("Operation timeout")
                self._end(link, transfer)
            elif transfer.phase is Phase.RECEIVING and now_s - transfer.sent_s > RETRY_S:
                out.append((link, _request_next(transfer, now_s)))
        return out

    # --- upload -----------------------------------------------------------------------------------------------

    def _count(self, link: str, transfer: Transfer, message: Message, now_s: float) -> list[Message]:
        sender, kind = _sender(message), message.mission_type
        if transfer.phase is Phase.SENDING:
            self._critical("WPM: IGN MISSION_COUNT: Busy")
            return [mission_messages.ack(sender, ERROR, kind)]
        if transfer.phase is Phase.RECEIVING:
            return self._count_again(transfer, sender, kind, now_s)
        if self._uploading is not None:
            return [mission_messages.ack(sender, ERROR, kind)]
        if kind not in tuple(MissionType):
            return [mission_messages.ack(sender, int(mav.MAV_MISSION_INVALID), kind)]
        if message.count > MAX_ITEMS[MissionType(kind)]:
            return [mission_messages.ack(sender, int(mav.MAV_MISSION_NO_SPACE), kind)]
        if message.count == 0:
            self._store.replace(MissionType(kind), (), 0)
            return [mission_messages.ack(sender, ACCEPTED, kind)]
        self._uploading = link
        self._links[link] = transfer = Transfer(Phase.RECEIVING, sender, kind, count=message.count, heard_s=now_s)
        return [_request_next(transfer, now_s)]

    def _count_again(self, transfer: Transfer, sender: tuple[int, int], kind: int, now_s: float) -> list[Message]:
        if sender != transfer.partner:
            return [mission_messages.ack(sender, ERROR, kind)]
        transfer.heard_s = now_s
        if transfer.seq == 0:
            return [_request_next(transfer, now_s)]
        self._critical("WPM: REJ. CMD: Busy")
        return [mission_messages.ack(sender, ERROR, kind)]

    def _item(self, link: str, transfer: Transfer, message: Message, now_s: float) -> list[Message]:
        partner, kind = transfer.partner, transfer.kind
        if _sender(message) != partner:
            self._critical("REJ. MIS ITEM: partner id mismatch")
            return []
        if message.mission_type != kind:
            return [mission_messages.ack(partner, ERROR, kind)]
        if transfer.phase is not Phase.RECEIVING:
            return self._item_too_late(transfer, message)
        transfer.heard_s = now_s
        if message.seq != transfer.seq:
            return []
        result, item = _judged(message, MissionType(kind))
        if item is None:
            if result != ERROR:
                self._critical(INVALID_ITEM)
            self._end(link, transfer)
            return [mission_messages.ack(partner, result, kind)]
        transfer.items.append(item)
        transfer.current = message.seq if message.current else transfer.current
        transfer.seq += 1
        if transfer.seq < transfer.count:
            return [_request_next(transfer, now_s)]
        items = tuple(transfer.items)
        self._end(link, transfer)
        self._store.replace(MissionType(kind), items, transfer.current)
        return [mission_messages.ack(partner, ACCEPTED, kind, self._store.id_of(MissionType(kind)))]

    def _item_too_late(self, transfer: Transfer, message: Message) -> list[Message]:
        partner, kind = transfer.partner, transfer.kind
        if transfer.phase is Phase.IDLE and transfer.seq == message.seq + 1:  # the last ACK was lost
            return [mission_messages.ack(partner, ACCEPTED, kind, self._store.id_of(MissionType(kind)))]
        busy = transfer.phase is Phase.SENDING
        self._critical("IGN MISSION_ITEM: Busy" if busy else "IGN MISSION_ITEM: No transfer")
        return [mission_messages.ack(partner, ERROR, kind)]

    # --- download ---------------------------------------------------------------------------------------------

    def _request_list(self, link: str, transfer: Transfer, message: Message, now_s: float) -> list[Message]:
        sender, kind = _sender(message), message.mission_type
        all_sent = transfer.phase is Phase.SENDING and transfer.seq == transfer.count
        again = transfer.phase is Phase.SENDING and sender == transfer.partner and kind == transfer.kind
        if not (transfer.phase is Phase.IDLE or all_sent or again):
            self._say(StatusText(INFO, "Mission download request ignored, already active"))
            return []
        items, list_id = self._list(kind)
        self._links[link] = Transfer(Phase.SENDING, sender, kind, count=len(items), sent_s=now_s, heard_s=now_s)
        return [mission_messages.count(sender, len(items), kind, list_id)]

    def _request(self, link: str, transfer: Transfer, message: Message, now_s: float) -> list[Message]:
        if transfer.phase is Phase.IDLE:
            return []
        if _sender(message) != transfer.partner:
            self._critical("WPM: REJ. CMD: partner id mismatch")
            return []
        if transfer.phase is Phase.RECEIVING:
            self._critical("WPM: REJ. CMD: Busy")
            return []
        if message.mission_type != transfer.kind:
            return []
        transfer.heard_s = now_s
        items, seq = self._list(transfer.kind)[0], message.seq
        if seq not in (transfer.seq, transfer.seq - 1) or seq >= min(len(items), transfer.count):
            self._end(link, transfer)
            self._critical("WPM: REJ. CMD: Req. WP was unexpected")
            return [mission_messages.ack(transfer.partner, ERROR, transfer.kind)]
        transfer.seq = seq + 1
        whole = message.get_msgId() == mav.MAVLINK_MSG_ID_MISSION_REQUEST_INT
        marked = transfer.kind == MissionType.MISSION and seq == self._store.current
        return [mission_messages.item(transfer.partner, seq, items[seq], transfer.kind, marked, whole)]

    def _ack(self, link: str, transfer: Transfer, message: Message, now_s: float) -> list[Message]:
        if _sender(message) != transfer.partner:
            return []
        if transfer.phase is Phase.SENDING and message.mission_type == transfer.kind:
            self._end(link, transfer)
        elif transfer.phase is Phase.RECEIVING:
            if message.type == mav.MAV_MISSION_OPERATION_CANCELLED:
                self._end(link, transfer)
            elif message.type == mav.MAV_MISSION_UNSUPPORTED:
                return [_request_next(transfer, now_s)]
        return []

    # --- without transfer -------------------------------------------------------------------------------------

    def _clear(self, _link: str, transfer: Transfer, message: Message, _now_s: float) -> list[Message]:
        if transfer.phase is not Phase.IDLE:
            self._critical("WPM: IGN CLEAR CMD: Busy")
            return []
        kind = message.mission_type
        everything = kind == mav.MAV_MISSION_TYPE_ALL
        for each in MissionType:
            if everything or each == kind:
                self._store.replace(each, (), 0)
        return [mission_messages.ack(_sender(message), ACCEPTED, kind)]

    def _set_current(self, _link: str, transfer: Transfer, message: Message, _now_s: float) -> list[Message]:
        if transfer.phase is not Phase.IDLE:
            self._critical("WPM: IGN WP CURR CMD: Busy")
        elif not self._store.jump_to(message.seq):
            self._critical("WPM: WP CURR CMD: Not in list")
        return []

    def _list(self, kind: int) -> tuple[tuple[MissionItem, ...], int]:
        if kind not in tuple(MissionType):
            return (), 0
        return self._store.items(MissionType(kind)), self._store.id_of(MissionType(kind))

    def _end(self, link: str, transfer: Transfer) -> None:
        transfer.phase = Phase.IDLE
        if self._uploading == link:
            self._uploading = None

    def _critical(self, text: str) -> None:
        self._say(StatusText(CRITICAL, text))


def _judged(message: Message, kind: MissionType) -> tuple[int, MissionItem | None]:
    """MAV_MISSION_RESULT and, when it is good, the item."""
    try:
        item = from_message(message)
    except ValueError:
        return int(mav.MAV_MISSION_INVALID), None
    result = verdict(item, kind)
    return result, item if result == ACCEPTED else None


def _request_next(transfer: Transfer, now_s: float) -> Message:
    transfer.sent_s = now_s
    return mission_messages.request(transfer.partner, transfer.seq, transfer.kind)


def _sender(message: Message) -> tuple[int, int]:
    return message.get_srcSystem(), message.get_srcComponent()
