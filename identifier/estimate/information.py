"""What drives tell of tires and sensors as numbers that add up: Gauss-Newton's matrix and vector.

The balance is linear in the forces of the curves, but not in the numbers of the Magic Formula. So
the loss of drives about their optimum p*, without any prior, is written over

    u(p) = [φ_f, φ_r, ρ]:  ½ u'Λu - η'u,   Λ = C'HC,   η = Λ u(p*) - C'g

φ the forces of an axle at the slips `GRID` [static loads], ρ the parameters that are none of
the curve; g and H slope and curvature of the loss over p; C takes forces to the numbers of the
curve that make them, by least squares over the slips that were driven. Λ and η of drives add up,
those of the blocks of a long log and those of the logs of a car alike; `Priors.after` takes them
in.
"""

import math
from dataclasses import dataclass, replace
from functools import cache

import casadi as ca
import numpy as np

from codegen.arrays import Array
from identifier.motion.model import curve_function
from identifier.motion.parameters import INDEX, NAMES, curve_index

GRID = (0.004, 0.008, 0.015, 0.025, 0.04, 0.06, 0.09, 0.13, 0.19, 0.28)  # [rad]
_LEAST_REACH = 0.01  # [rad], up to which the curve is always asked
_BEYOND = 0.02  # weight of a slip that no drive reached
_RIDGE = 1e-6  # of the least squares, in prior variances of the curve's numbers

OF_CURVE = {axle: curve_index(axle)[:-1] for axle in "fr"}  # without the road
BESIDE = tuple(
    name for k, name in enumerate(NAMES) if k not in (*curve_index("f"), *curve_index("r"))
)
FORCES = 2 * len(GRID)
PLACE = {name: FORCES + k for k, name in enumerate(BESIDE)}  # in u
SIZE = FORCES + len(BESIDE)
CHANGES = ("steering_zero", "v_y_bias", "v_y_angle")  # of sensors, from day to day


def coordinates(p: Array) -> tuple[Array, Array]:
    """Return u (m,), and its slopes over the parameters (m, p).

    The road moves the forces, so that its slopes are those of another friction.
    p : parameters (p,).
    """
    u, slopes = np.zeros(SIZE), np.zeros((SIZE, len(NAMES)))
    for i, axle in enumerate("fr"):
        index, rows = curve_index(axle), slice(i * len(GRID), (i + 1) * len(GRID))
        phi, J = _on_grid()(p[index])
        u[rows], slopes[rows, index] = np.array(phi).ravel(), np.array(J).T
    for name, k in PLACE.items():
        u[k], slopes[k, INDEX[name]] = p[INDEX[name]], 1.0
    return u, slopes


@cache
def _on_grid() -> ca.Function:
    """Return (numbers (9,)) -> φ (1, k) and ∂φ/∂numbers (9, k) at the slips of the grid."""
    numbers = ca.SX.sym("numbers", 9)
    many = ca.repmat(numbers, 1, len(GRID))
    phi, _, J = curve_function().map(len(GRID))(many, ca.DM(GRID).T)
    return ca.Function("on_grid", [numbers], [phi, J])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Information:
    """What drives tell.
    matrix : Λ, zero of what was held (m, m).
    vector : η (m,).   seconds : of driving that counts [s].
    """

    matrix: Array
    vector: Array
    seconds: float

    def __post_init__(self) -> None:
        for name, shape in (("matrix", (SIZE, SIZE)), ("vector", (SIZE,))):
            value = getattr(self, name)
            if value.shape != shape:
                raise ValueError(f"{name} must have shape {shape}, it has {value.shape}")
            if not np.isfinite(value).all():
                raise ValueError(f"{name} holds a number that is not finite")
        if not 0.0 <= self.seconds < math.inf:
            raise ValueError(f"seconds must not be negative, it is {self.seconds}")

    @classmethod
    def nothing(cls) -> "Information":
        """Return what no drive tells."""
        return cls(matrix=np.zeros((SIZE, SIZE)), vector=np.zeros(SIZE), seconds=0.0)

    @classmethod
    def about(
        cls, p: Array, slope: Array, curvature: Array, sd: Array, driven: Array, seconds: float
    ) -> "Information":
        """Return what drives tell by their loss about their optimum.
        p : the optimum (p,).   slope, curvature : of the loss there (p,), (p, p).
        sd : standard deviations of the prior (p,).
        driven : largest slip of each axle [rad], (2,).
        """
        u, slopes = coordinates(p)
        C = np.zeros((len(NAMES), SIZE))
        for i, axle in enumerate("fr"):
            index, rows = OF_CURVE[axle], slice(i * len(GRID), (i + 1) * len(GRID))
            T = slopes[rows, index] * sd[index]
            reached = np.array(GRID) <= max(driven[i], _LEAST_REACH)
            weighted = T.T * np.where(reached, 1.0, _BEYOND) ** 2
            inverse = np.linalg.solve(weighted @ T + _RIDGE * np.eye(len(index)), weighted)
            C[index, rows] = sd[index][:, None] * inverse
        for name, k in PLACE.items():
            C[INDEX[name], k] = 1.0
        matrix = C.T @ curvature @ C
        return cls(matrix=0.5 * (matrix + matrix.T), vector=matrix @ u - C.T @ slope,
                   seconds=seconds)  # fmt: skip

    def __add__(self, other: "Information") -> "Information":
        """Return what both tell together."""
        return Information(
            matrix=self.matrix + other.matrix,
            vector=self.vector + other.vector,
            seconds=self.seconds + other.seconds,
        )

    def counted(self, share: float) -> "Information":
        """Return the same where a second counts for that share of one."""
        return replace(self, matrix=share * self.matrix, vector=share * self.vector)

    def around(self, p: Array) -> tuple[float, Array, Array]:
        """Return the loss [nats] but for a constant, its slope (p,) and curvature (p, p)."""
        u, slopes = coordinates(p)
        toward = self.matrix @ u - self.vector
        loss = 0.5 * float(u @ (toward - self.vector))
        return loss, slopes.T @ toward, slopes.T @ self.matrix @ slopes

    def of_one_day(self, sd: Array) -> "Information":
        """Return the same where this drive's sensors were off by errors of their own.
        sd : of `CHANGES` (3,).
        """
        along = np.zeros((SIZE, len(CHANGES)))
        along[[PLACE[name] for name in CHANGES], range(len(CHANGES))] = 1.0
        return self.loosened(along, sd)

    def loosened(self, along: Array, sd: Array) -> "Information":
        """Return the same where u was off by errors of these drives alone.

        Their errors d ~ N(0, D) along A: Λ - ΛA (D⁻¹ + A'ΛA)⁻¹ A'Λ.
        along : A (m, k).   sd : root of D (k,).
        """
        moved = self.matrix @ along
        gain = np.linalg.solve(np.diag(sd**-2.0) + along.T @ moved, moved.T).T
        matrix = self.matrix - gain @ moved.T
        vector = self.vector - gain @ (along.T @ self.vector)
        return replace(self, matrix=0.5 * (matrix + matrix.T), vector=vector)
