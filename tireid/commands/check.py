"""`tireid check [design.toml]`: is a set of gains safe to drive with, and which would be better?"""

import argparse
import json
import math
import shlex
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from identifier.defaults import (
    BANDWIDTH,
    LAWS,
    PHASE_MARGIN,
    design_for,
    natural_driving,
    natural_operation,
    paper_identifier,
)
from identifier.methods import DEFAULT
from identifier.paper.design import Driving, PaperIdentifier, design_text, read_design
from identifier.paper.laws import DRIVING_ERRORS, Gains
from identifier.run import identify
from identifier.stability import Certificate, DesignError, Operation
from identifier.stability.certificate import judged_loop
from identifier.stability.gain_design import DEFAULT_KEEPING, KEEPINGS, with_keeping
from identifier.stability.loop import direction_matrix, linear_law
from identifier.stability.monte_carlo import Beginning, Observed, monte_carlo
from identifier.stability.operation import proven_bounds
from models.files import write_atomically
from models.recordings import Recording
from models.schema import require_few
from models.vehicle import Vehicle, sedan
from tireid.commands import COMMANDS
from tireid.commands.certificate_table import (
    bound_rows,
    certificate_of,
    certificate_text,
    monte_carlo_numbers,
    monte_carlo_text,
    unit_text,
)
from tireid.commands.options import read_log
from tireid.figures import error_figure, locus_figure, save_figure
from tireid.output import OutputError
from tireid.progress import Stopwatch, say, tell

# The figures of `tireid check`: root locus with its margin, bounds against a real error.

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
    design: PaperIdentifier,
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


FAILS = 1
CONDITIONS = {  # field of the declared driving, and the option that says otherwise
    "v_x": "speed",
    "slip": "slip",
    "friction": "friction",
    "bandwidth": "bandwidth",
    "noise_v_x": "noise_v_x",
    "noise_v_y": "noise_v_y",
    "noise_r": "noise_r",
    "noise_delta": "noise_delta",
}


def add_parser(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : subparsers of `tireid`.
    """
    parser = commands.add_parser(
        "check",
        help=COMMANDS["check"],
        description="Judge the gains of DESIGN at the worst regressor: poles, sampling, gain and "
        "phase margin, damping, drift, proven bounds. Exit code 0: pass or warn, 1: fails, 2: bad "
        "input. With --design, find gains instead and write them.",
    )
    parser.add_argument(
        "file", nargs="?", type=Path, metavar="DESIGN", help="design.toml (the default design)"
    )
    parser.add_argument("--vehicle", type=Path, metavar="FILE", help="car as TOML (the sedan)")
    parser.add_argument("--law", choices=LAWS, help="law of the default design or of --design")
    parser.add_argument(
        "--bandwidth", type=float, metavar="HZ", help=f"of the steering ({BANDWIDTH:g} Hz)"
    )
    parser.add_argument("--speed", type=float, metavar="M/S", help="(4 sqrt(g wheelbase))")
    parser.add_argument("--slip", type=float, metavar="RAD", help="largest (twice sliding)")
    parser.add_argument("--friction", type=float, metavar="MU", help="of the road (1)")
    for signal, unit in (("v-x", "M/S"), ("v-y", "M/S"), ("r", "RAD/S"), ("delta", "RAD")):
        parser.add_argument(
            f"--noise-{signal}", type=float, metavar=unit, help=f"largest error of {signal}"
        )
    parser.add_argument("--log", metavar="LOG[:RUN]", help="judge the loop along a recording too")
    parser.add_argument(
        "--monte-carlo",
        type=int,
        metavar="N",
        help="run N random drives within what is judged: is a proven bound ever passed?",
    )
    parser.add_argument("--seed", type=int, metavar="N", help="of --monte-carlo (0)")
    parser.add_argument("--json", action="store_true", help="print the certificate as JSON")
    parser.add_argument("--figures", type=Path, metavar="DIR", help="draw root locus and bounds")
    parser.add_argument("--design", action="store_true", help="find gains and write them")
    parser.add_argument(
        "--phase-margin", type=float, metavar="DEG", help=f"for --design ({PHASE_MARGIN:g} deg)"
    )
    parser.add_argument(
        "--keep",
        choices=KEEPINGS,
        help="for --design: what keeps the weights over hours, the paper's leakage (which forgets "
        "them), a leakage with a dead zone, or a projection in its place "
        f"({DEFAULT_KEEPING})",
    )
    parser.add_argument(
        "--out", type=Path, metavar="FILE", help="for --design: file to write (design.toml)"
    )
    parser.add_argument("--force", action="store_true", help="replace the files if they exist")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 0, or 1 where the design fails.

    Parameters
    ----------
    options : parsed arguments.
    """
    _require_sense(options)
    vehicle = sedan() if options.vehicle is None else Vehicle.from_toml(options.vehicle)
    stored = None if options.file is None else read_design(options.file)
    driving = _driving(options, stored, vehicle)
    design = _design(options, vehicle, driving) if stored is None else stored
    certificate = certificate_of(design, vehicle, driving)
    drive = _read(options.log, vehicle, design)
    _require_free(options)
    observed = _drive(options, vehicle, driving, design, certificate)
    rows = [] if observed is None else bound_rows(certificate, observed)
    passed = any(row.passed for row in rows) or (observed is not None and observed.diverged > 0)
    seed = options.seed or 0
    if options.json:
        numbers = {"conditions": asdict(driving), **certificate.to_dict()}
        if observed is not None:
            numbers["monte_carlo"] = monte_carlo_numbers(rows, observed, seed)
        told = [json.dumps(numbers, indent=2)]
    else:
        told = []
        if options.file is None:
            law = f"{DEFAULT}, the default of tireid identify: not certified"
            told.append(f"judged is the paper's law; {law}")
        told.append(_conditions(design, vehicle, driving, _said(options, design, driving)))
        told.append(certificate_text(certificate, design.force_unit))
        if drive is not None:
            told.append(_along(drive, vehicle, design))
        if observed is not None:
            told.append(monte_carlo_text(rows, observed, seed, design.force_unit))
        if certificate.verdict != "pass" and not options.design:
            told.append(_proposal(options, design, vehicle, driving))
    status = _finish(options, vehicle, driving, design, certificate, drive)
    for text in told:  # once nothing can fail any more
        tell(text)
    return status or FAILS * passed


def _finish(
    options: argparse.Namespace,
    vehicle: Vehicle,
    driving: Driving,
    design: PaperIdentifier,
    certificate: Certificate,
    drive: Recording | None,
) -> int:
    """Write what was asked for; return the exit code. Where a part fails, none is there."""
    with ExitStack() as stack:
        drawn = None
        if options.figures:
            options.figures.mkdir(parents=True, exist_ok=True)
            scratch = TemporaryDirectory(prefix=".tireid-", dir=options.figures)
            drawn = Path(stack.enter_context(scratch))
            _draw(drawn, vehicle, driving, design, certificate, drive)
        if options.design:
            _write(options, design)
        if drawn is not None:
            for name in FIGURES:
                (drawn / name).replace(options.figures / name)
                say(f"wrote {options.figures / name}")
    return FAILS if certificate.verdict == "fail" else 0


def _require_sense(options: argparse.Namespace) -> None:
    if options.design and options.file is not None:
        raise ValueError("--design finds gains: give no DESIGN file to judge with it")
    if options.file is not None and options.law is not None:
        raise ValueError("--law is for the default design: the law stands in the DESIGN file")
    if not options.design:
        for name in ("phase_margin", "keep", "out"):
            if getattr(options, name) is not None:
                raise ValueError("--phase-margin, --keep and --out go with --design")
    for name in ("bandwidth", "speed", "slip", "friction", "phase_margin"):
        value = getattr(options, name)
        if value is not None and not 0.0 < value < float("inf"):
            raise ValueError(f"--{name.replace('_', '-')} must be positive, it is {value:g}")
    for name in ("noise_v_x", "noise_v_y", "noise_r", "noise_delta"):
        value = getattr(options, name)
        if value is not None and not 0.0 <= value < float("inf"):
            raise ValueError(f"--{name.replace('_', '-')} must not be negative, it is {value:g}")
    if options.seed is not None and (options.monte_carlo is None or options.seed < 0):
        raise ValueError("--seed, not negative, goes with --monte-carlo")
    if options.monte_carlo is not None and options.monte_carlo < 1:
        raise ValueError(f"--monte-carlo must be at least 1, it is {options.monte_carlo}")
    require_few(ValueError, "--monte-carlo", options.monte_carlo or 0, "runs", "runs")
    if options.slip is not None and options.slip > 1.0:
        raise ValueError(f"--slip must be in rad and below 1, it is {options.slip:g}")


def _driving(
    options: argparse.Namespace, design: PaperIdentifier | None, vehicle: Vehicle
) -> Driving:
    """Return what the design declares, or what is natural for the car, with the options over it."""
    declared = None if design is None else design.driving
    return replace(declared or natural_driving(vehicle), **_overrides(options))


def _overrides(options: argparse.Namespace) -> dict[str, float]:
    given = {field: getattr(options, option) for field, option in CONDITIONS.items()}
    return {field: value for field, value in given.items() if value is not None}


def _said(options: argparse.Namespace, design: PaperIdentifier, driving: Driving) -> str:
    """Return where the conditions come from."""
    changed = ", ".join(f"--{CONDITIONS[field].replace('_', '-')}" for field in _overrides(options))
    if options.file is None:
        return "conditions: of the car" + (f", but for {changed}" if changed else "")
    if design.driving is None:
        told = "conditions: none stored in the design, those of the car"
        return told + (f", but for {changed}" if changed else "")
    if driving == design.driving:
        return "conditions: as stored in the design"
    return f"conditions: as stored in the design, but for {changed}: not the file's own verdict"


def _design(options: argparse.Namespace, vehicle: Vehicle, driving: Driving) -> PaperIdentifier:
    law = options.law or "integral"
    if options.design:
        if law == "instantaneous_scaled":
            raise ValueError("--law instantaneous_scaled is a control, design one of the others")
        margin = options.phase_margin or PHASE_MARGIN
        found = design_for(vehicle, driving, law=law, phase_margin=margin)
        known = natural_operation(found, vehicle, driving)
        return with_keeping(found, known, options.keep or DEFAULT_KEEPING)
    return replace(paper_identifier(vehicle, law=law), driving=driving)


def _drive(
    options: argparse.Namespace,
    vehicle: Vehicle,
    driving: Driving,
    design: PaperIdentifier,
    certificate: Certificate,
) -> Observed | None:
    """Run the random drives of --monte-carlo; None where there are none."""
    if options.monte_carlo is None:
        return None
    watch, count = Stopwatch(), options.monte_carlo
    known = {entry.name: entry.value for entry in certificate.properties}
    kept = min(known.get("weight_bound", math.inf), design.gains.W_max)
    return monte_carlo(
        design,
        vehicle,
        driving,
        count,
        beginning=Beginning(
            W=kept if math.isfinite(kept) else 0.0,
            V=min(natural_operation(design, vehicle, driving).V_start, design.gains.V_max),
        ),
        rng=np.random.default_rng(options.seed or 0),
        progress=lambda done: say(f"{done} of {count} random drives, {watch.seconds:.1f} s"),
    )


def _conditions(design: PaperIdentifier, vehicle: Vehicle, driving: Driving, said: str) -> str:
    gains = design.gains
    unit = unit_text("U", design.force_unit)
    rows = "; ".join(" ".join(f"{value:.4g}" for value in row) for row in gains.A_d)
    return (
        f"{vehicle.name} at {driving.v_x:.3g} m/s, slip up to {driving.slip:.3g} rad, friction "
        f"{driving.friction:g}, steering up to {driving.bandwidth:g} Hz; sensors err by up to "
        f"{driving.noise_v_x:.3g} and {driving.noise_v_y:.3g} m/s, {driving.noise_r:.3g} rad/s, "
        f"{driving.noise_delta:.3g} rad\n{said}\n"
        f"{design.law} law, {design.network.hidden} units, {design.integrator} at "
        f"{1e3 * design.dt:g} ms, forces in {unit}: A_d {rows}, lambda "
        f"{gains.forgetting:.4g}, eta_W {gains.eta_W:.4g}, eta_V {gains.eta_V:.4g}, rho_W "
        f"{gains.rho_W:.4g}, rho_V {gains.rho_V:.4g}{_radii(gains)}\n"
    )


def _radii(gains: Gains) -> str:
    """Return the balls that the weights are kept in, as far as there are any."""
    radii = {name: getattr(gains, name) for name in ("W_free", "V_free", "W_max", "V_max")}
    return "".join(f", {name} {r:.4g}" for name, r in radii.items() if 0.0 < r < math.inf)


def _read(log: str | None, vehicle: Vehicle, design: PaperIdentifier) -> Recording | None:
    return None if log is None else read_log(log, vehicle, dt=design.dt)


def _along(recording: Recording, vehicle: Vehicle, design: PaperIdentifier) -> str:
    from identifier.stability.certificate import loop_along

    history = identify(recording, vehicle, design)
    if history.diverged_at is not None:
        return f"along {recording.name}: the law diverged at {history.diverged_at:g} s"
    along = loop_along(history, design)
    at = along.strongest
    return (
        f"along {recording.name}: largest loop gain {along.gain[at]:.4g} at {along.t[at]:g} s, "
        f"gain margin there {along.margin:.3g}"
    )


def _proposal(
    options: argparse.Namespace, design: PaperIdentifier, vehicle: Vehicle, driving: Driving
) -> str:
    try:
        better = design_for(
            vehicle,
            driving,
            law=design.law,
            network=design.network,
            input_source=design.input_source,
            integrator=design.integrator,
            dt=design.dt,
        )
        known = natural_operation(better, vehicle, driving)
        better = with_keeping(better, known, DEFAULT_KEEPING)
    except DesignError as error:
        return f"no better gains at this bandwidth: {error}"
    gains, verdict = better.gains, certificate_of(better, vehicle, driving).verdict
    return (
        f"proposal ({verdict}): A_d = -{-gains.A_d[0][0]:.4g} I, lambda {gains.forgetting:.4g}, "
        f"eta_W {gains.eta_W:.4g}, eta_V {gains.eta_V:.4g}, rho_W {gains.rho_W:.4g}, rho_V "
        f"{gains.rho_V:.4g}{_radii(gains)}{f', lead {gains.lead:.4g}' if gains.lead else ''}\n"
        f"write it with: tireid check --design --law {design.law}{_given(options)}"
    )


def _given(options: argparse.Namespace) -> str:
    """Return the options that say which car drives how hard, as they were given."""
    names = ("vehicle", *CONDITIONS.values())
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    return "".join(
        f" --{name.replace('_', '-')} {shlex.quote(str(value))}" for name, value in given.items()
    )


def _draw(
    folder: Path,
    vehicle: Vehicle,
    driving: Driving,
    design: PaperIdentifier,
    certificate: Certificate,
    drive: Recording | None,
) -> None:
    from tireid.commands.demo_story import drive_to_learn

    recording = drive_to_learn() if drive is None else drive
    operation = natural_operation(design, vehicle, driving)
    draw_check(folder, recording, vehicle, design, operation, certificate)


def _require_free(options: argparse.Namespace) -> None:
    targets = [options.figures / name for name in FIGURES] if options.figures else []
    if options.design:
        targets.append(_target(options))
    for target in targets:
        if target.exists() and not options.force:
            raise OutputError(f"{target} exists: choose another, or add --force to replace it")


def _target(options: argparse.Namespace) -> Path:
    return options.out or Path("design.toml")


def _write(options: argparse.Namespace, design: PaperIdentifier) -> None:
    target = _target(options)
    write_atomically(target, design_text(design))
    say(f"wrote {target}")
