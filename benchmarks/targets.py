"""Numbers beside their targets, one line each."""

from dataclasses import dataclass, field


@dataclass(slots=True)
class Targets:
    """What was measured and what was to be reached.

    Parameters
    ----------
    missed : labels of the targets that were not reached so far.
    """

    missed: list[str] = field(default_factory=list)

    def at_most(self, label: str, value: float, limit: float, unit: str = "%") -> None:
        """Print a value beside the largest that is good.

        Parameters
        ----------
        label : what it is.
        value : measured.
        limit : largest that is good.
        unit : of both.
        """
        self._print(label, value, f"<= {limit:g} {unit}", unit, value <= limit)

    def at_least(self, label: str, value: float, limit: float, unit: str = "%") -> None:
        """Print a value beside the smallest that is good.

        Parameters
        ----------
        label : what it is.
        value : measured.
        limit : smallest that is good.
        unit : of both.
        """
        self._print(label, value, f">= {limit:g} {unit}", unit, value >= limit)

    def _print(self, label: str, value: float, target: str, unit: str, good: bool) -> None:
        if not good:
            self.missed.append(label)
        verdict = "ok" if good else "MISSED"
        print(f"  {label:66} {value:8.2f} {unit:3} target {target}  {verdict}")


def show(label: str, text: str) -> None:
    """Print a value that has no target of its own.

    Parameters
    ----------
    label : what it is.
    text : the value.
    """
    print(f"  {label:66} {text}")
