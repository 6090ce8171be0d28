"""Rules that set one factor of one entity -> source: the most specific one wins, equally specific ones must agree."""

from dataclasses import dataclass

from segar.engine.compiler.emit import Writer


@dataclass(frozen=True)
class FactorSetting:
    """Writes the local names that hold which rule sets a factor, and to which value.

    Args:
        entity: the variable that holds the entity.
        column: first column of the factor; it has ``width`` columns.
        may_conflict: whether rules of equal priority can set the factor; otherwise no conflict is looked for.
    """

    entity: str
    column: int
    width: int
    may_conflict: bool = True

    @property
    def place(self) -> str:
        """What the local names end with."""
        return f"{self.entity}_{self.column}"

    @property
    def is_set(self) -> str:
        """Source of the test whether some rule sets the factor."""
        return f"set_{self.place} >= 0"

    @property
    def values(self) -> list[str]:
        """Local names that hold the value's components."""
        return [f"sx_{self.place}_{c}" for c in range(self.width)]

    def begin(self, w: Writer) -> None:
        """No rule sets the factor yet."""
        w.line(f"set_{self.place} = -1")
        if self.may_conflict:
            w.line(f"by_{self.place} = rival_{self.place} = -1")
        for name in self.values:
            w.line(f"{name} = 0.0")

    def add(self, w: Writer, number: int, priority: int, values: list[str]) -> None:
        """Rule ``number`` sets the factor to these values."""
        with w.block(f"if set_{self.place} < {priority}:"):
            w.line(f"set_{self.place} = {priority}")
            for name, value in zip(self.values, values, strict=True):
                w.line(f"{name} = {value}")
            if self.may_conflict:
                w.line(f"by_{self.place}, rival_{self.place} = {number}, -1")
        if self.may_conflict:
            differs = " or ".join(f"{name} != {value}" for name, value in zip(self.values, values, strict=True))
            with w.block(f"elif set_{self.place} == {priority} and ({differs}):"):
                w.line(f"rival_{self.place} = {number}")

    def report_conflict(self, w: Writer) -> None:
        """Write to ``err`` which two rules conflict: 1, the entity, the column, and the numbers of the rules."""
        if self.may_conflict:
            with w.block(f"if rival_{self.place} >= 0:"):
                w.line(f"err[0], err[1], err[2] = 1, {self.entity}, {self.column}")
                w.line(f"err[3], err[4] = by_{self.place}, rival_{self.place}")

    def store(self, w: Writer, state: str = "V") -> None:
        """Write the value to the state; the surroundings test :attr:`is_set`."""
        for c, name in enumerate(self.values):
            w.line(f"{state}[{self.entity}, {self.column + c}] = {name}")
