"""The state of what chooses levels, as checkpoints hold it."""

from collections.abc import Mapping
from copy import copy
from typing import Any, ClassVar


class SavedState:
    """What has a state: the attributes that ``saved`` names, and with them those of the parts that ``parts`` names."""

    saved: ClassVar[tuple[str, ...]]
    parts: ClassVar[tuple[str, ...]] = ()

    def state_dict(self) -> dict[str, Any]:
        """The state, which goes into the checkpoint."""
        own = {name: getattr(self, name) for name in self.saved}
        return own | {key: value for part in self.parts for key, value in getattr(self, part).state_dict().items()}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Continues from ``state``."""
        for name in self.saved:
            setattr(self, name, copy(state[name]))
        for part in self.parts:
            getattr(self, part).load_state_dict(state)
