"""What acts on the error dynamics from outside: bounds that hold on every declared drive."""

from dataclasses import dataclass

from identifier.stability.gain_limit import require_positive


@dataclass(frozen=True, slots=True, kw_only=True)
class Disturbance:
    """Bounds of the residual, of the noise, and of what a held input leaves out.

    Parameters
    ----------
    residual : sup|f|, the force the linear tire misses as the samples show it, with what sensors
        add to A_ξ ξ + B_ξ u [U].
    noise : sup of the sensors' error of ξ, which is in every measured ξ̃ [U s].
    rate : sup|ξ'| of the car [U]; RK4 adds dt (1 - φ) ξ' to the error.
    known : sup|A_ξ ξ + B_ξ u| as measured, which the observer is told [U].
    """

    residual: float
    noise: float = 0.0
    rate: float = 0.0
    known: float = 0.0

    def __post_init__(self) -> None:
        require_positive(residual=self.residual)
        for name in ("noise", "rate", "known"):
            value = getattr(self, name)
            if not 0.0 <= value < float("inf"):
                raise ValueError(f"{name} must not be negative, it is {value}")
