"""The floors of a comparison: each structure, fitted offline to the true forces of one recording.

No method gets below the floor of its structure where it learns; elsewhere the floor is what its
structure makes of all that the one recording tells.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from identifier.baselines import fit_floor, structure_of
from identifier.compare.course import Course
from identifier.compare.work import spread
from identifier.methods import LIVE, REFERENCE, REGRESSIONS, make_method
from identifier.paper.design import VARIANTS
from identifier.reproducibility import AxleRmse

STRUCTURES: Mapping[str, str] = {  # name of the structure to a method that has it
    "axle units": LIVE,
    "network": REFERENCE,
    "Magic Formula": "magic_formula_ekf",
    "Dugoff": "dugoff_ekf",
    "linear tire": "linear",
    "lagged linear tire": "stiffness_rls",
}
FLOOR_OF: Mapping[str, str] = {
    LIVE: "axle units",
    **dict.fromkeys((*VARIANTS, *REGRESSIONS), "network"),
    "magic_formula_ekf": "Magic Formula",
    "dugoff_ekf": "Dugoff",
    "linear": "linear tire",
    "stiffness_rls": "lagged linear tire",
}


def fit(course: Course, starts: int, seed: int, task: tuple[str, int]) -> dict[str, AxleRmse]:
    """Fit a structure to one recording; return its errors on all.

    Parameters
    ----------
    task : name of the structure, number of the recording.
    """
    name, number = task
    structure = structure_of(make_method(STRUCTURES[name], course.vehicle, seed), course.vehicle)
    rng = np.random.default_rng(seed)
    model = fit_floor(structure, [course.recordings[number]], rng=rng, starts=starts)
    return course.replays(model)


def fit_floors(
    methods: Sequence[str],
    course: Course,
    *,
    starts: int,
    seed: int,
    workers: int = 2,
    progress: Callable[[str], None] | None = None,
) -> dict[str, dict[str, dict[str, AxleRmse]]]:
    """Return by structure and recording fitted to, the errors on every recording [N].

    Parameters
    ----------
    workers : processes; 1 stays in this one.
    """
    needed = {FLOOR_OF[name] for name in methods if name in FLOOR_OF}
    tasks = [(s, i) for s in STRUCTURES if s in needed for i in range(len(course.recordings))]
    floors: dict[str, dict[str, dict[str, AxleRmse]]] = {}
    with spread(workers) as spread_map:
        results = spread_map(partial(fit, course, starts, seed), tasks)
        for (name, number), replays in zip(tasks, results, strict=True):
            recording = course.recordings[number].name
            floors.setdefault(name, {})[recording] = replays
            if progress:
                progress(f"floor of {name}: fitted to the true forces of {recording}")
    return floors
