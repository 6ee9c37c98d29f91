"""The figures of `tireid check`: root locus with its margin, bounds against a real error."""

from pathlib import Path

from identifier.design import Design
from identifier.identify import identify
from identifier.laws import DRIVING_ERRORS
from identifier.stability import Certificate, Operation
from identifier.stability.certificate import judged_loop
from identifier.stability.loop import direction_matrix, linear_law
from identifier.stability.operation import proven_bounds
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid.figures import error_figure, locus_figure, save_figure

FIGURES = ("locus.png", "bounds.png")
BOUNDS = {
    "error_bound": "proven bound, leakage",
    "projection_bound": "proven bound, projection",
    "trivial_bound": "no network",
    "printed_bound": "(14) as printed",
}


def draw_check(
    folder: Path,
    recording: Recording,
    vehicle: Vehicle,
    design: Design,
    operation: Operation,
    certificate: Certificate,
) -> list[Path]:
    """Draw locus.png and bounds.png; return their paths.

    Parameters
    ----------
    folder : where to, made if missing.
    recording : a drive, for the error to compare the bounds with.
    vehicle : the car.
    design : the design.
    operation : what its certificate knows.
    certificate : its certificate.
    """
    folder.mkdir(parents=True, exist_ok=True)
    driving_error = DRIVING_ERRORS[design.law]
    law = linear_law(driving_error, design.gains.lead)
    D = direction_matrix(driving_error, design.gains.matrix)
    kept = proven_bounds(design.gains, law, operation, D).W
    _, loop, _ = judged_loop(design.gains, law, operation, D, kept)
    history = identify(recording, vehicle, design)
    figures = (
        locus_figure(loop, integrator=design.integrator, dt=design.dt),
        error_figure(history, error_bounds(certificate)),
    )
    paths = [folder / name for name in FIGURES]
    for path, figure in zip(paths, figures, strict=True):
        save_figure(figure, path)
    return paths


def error_bounds(certificate: Certificate) -> dict[str, float]:
    """Return the bounds of the error norm that a certificate holds, by the name in a legend [U s].

    Parameters
    ----------
    certificate : the properties.
    """
    known = {entry.name: entry.value for entry in certificate.properties}
    return {title: known[name] for name, title in BOUNDS.items() if name in known}
