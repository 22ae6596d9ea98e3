"""Which mission, fence and rally points does the vehicle hold? Three lists with their ids, as they were uploaded."""

from collections.abc import Callable

from sitl.mission_items import MissionItem, MissionType, opaque_id


class MissionStore:
    """The lists; ``changed`` is called with the kind of every list that was replaced."""

    def __init__(self, changed: Callable[[MissionType], None] = lambda _kind: None) -> None:
        self.current = 0  # index in the mission
        self.jumped = False  # was ``current`` set by a client since it was last looked at?
        self._changed = changed
        self._items: dict[MissionType, tuple[MissionItem, ...]] = dict.fromkeys(MissionType, ())
        self._ids: dict[MissionType, int] = dict.fromkeys(MissionType, 0)

    def items(self, kind: MissionType) -> tuple[MissionItem, ...]:
        """One list."""
        return self._items[kind]

    def id_of(self, kind: MissionType) -> int:
        """Its opaque id; 0 when it is empty."""
        return self._ids[kind]

    @property
    def mission(self) -> tuple[MissionItem, ...]:
        """The items of the mission itself."""
        return self._items[MissionType.MISSION]

    def replace(self, kind: MissionType, items: tuple[MissionItem, ...], current: int | None = None) -> None:
        """Take a new list. The same list again changes nothing, as in PX4: a mission goes on where it was."""
        new_id = opaque_id(items)
        if items and new_id == self._ids[kind]:
            return
        self._items[kind], self._ids[kind] = items, new_id
        if kind is MissionType.MISSION:
            kept = self.current if self.current < len(items) else 0
            self.current = kept if current is None else current
        self._changed(kind)

    def jump_to(self, seq: int) -> bool:
        """Make another item the current one. False when there is none of that number."""
        if not 0 <= seq < len(self.mission):
            return False
        self.current = seq
        self.jumped = True
        return True
