"""`tireid check`: what is certified of an identifier, and which gains would be better?"""

import argparse
import json
import math
import shlex
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from codegen.writing import write_file
from identifier.driving import BANDWIDTH, Driving, natural_driving
from identifier.frozen import vehicle_numbers
from identifier.methods import LIVE, REFERENCE, certify
from identifier.paper.design import (
    PHASE_MARGIN,
    VARIANTS,
    PaperIdentifier,
    design_for,
    design_text,
    with_keeping,
)
from identifier.paper.laws import LAWS, Gains
from identifier.run import identify
from identifier.stability import Certificate, DesignError, Operation
from identifier.stability.along import strongest_along
from identifier.stability.certificate import judged_loop
from identifier.stability.gain_design import DEFAULT_KEEPING, KEEPINGS
from identifier.stability.loop import direction_matrix
from identifier.stability.operation import proven_bounds
from models.files import write_atomically
from models.recordings import Recording
from models.vehicle import Vehicle
from tireid.commands import COMMANDS, DONE, FAILS
from tireid.commands import options as shared
from tireid.commands.certificate_table import (
    certificate_text,
    method_text,
    unit_text,
)
from tireid.commands.demo_story import drive_to_learn
from tireid.figures.paper import error_figure, locus_figure
from tireid.figures.style import save_figure
from tireid.output import output_folder, require_free, write_json
from tireid.progress import say, tell

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
    """Draw locus.png and bounds.png; return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    chosen = LAWS[design.law]
    law = chosen.error(design.gains.lead)
    D = direction_matrix(chosen, design.gains.matrix)
    kept = proven_bounds(design.gains, law, operation, D).W
    _, loop, _ = judged_loop(design.gains, law, operation, D, kept)
    history = identify(recording, vehicle, design)
    figures = (
        locus_figure(loop, integrator=design.integrator, dt=design.dt),
        error_figure(history, _error_bounds(certificate)),
    )
    paths = [folder / name for name in FIGURES]
    for path, figure in zip(paths, figures, strict=True):
        save_figure(figure, path)
    return paths


def _error_bounds(certificate: Certificate) -> dict[str, float]:
    """Return the bounds of the error norm that a certificate holds, by the name in a legend [U
    s].
    """
    known = {entry.name: entry.value for entry in certificate.properties}
    return {title: known[name] for name, title in BOUNDS.items() if name in known}


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
_OF_ALL = ("v_x", "friction")  # conditions of which not gains alone are judged
_OF_GAINS = tuple(option for field, option in CONDITIONS.items() if field not in _OF_ALL)
TEXT, NUMBERS = "certificate.txt", "certificate.json"


def add_parser(commands: Any) -> None:
    parser = commands.add_parser(
        "check",
        help=COMMANDS["check"],
        description="Certify an identifier; with no option the axle identifier, the default in "
        "a car: limits, curve, jumps, the time to follow a drop of friction; with --along LOG "
        "also the tires identified there: sector, and the largest force error. Gains of the "
        "paper's laws (--paper, --method NAME, --design FILE) are judged at the worst "
        "regressor: poles, sampling, gain and phase margin, damping, drift, proven bounds. Exit "
        "code 0: nothing fails, 1: something does, 2: bad input. With --tune, find gains and "
        "write them.",
    )
    shared.add_vehicle(parser)
    shared.add_method(parser, LIVE)
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
    parser.add_argument("--along", metavar="LOG[:RUN]", help="judge a recorded run too")
    shared.add_log_map(parser)
    parser.add_argument("--json", action="store_true", help="print the certificate as JSON")
    parser.add_argument(
        "--tune", type=Path, metavar="FILE", help="find gains and write them, for --design FILE"
    )
    parser.add_argument(
        "--phase-margin", type=float, metavar="DEG", help=f"for --tune ({PHASE_MARGIN:g} deg)"
    )
    parser.add_argument(
        "--keep",
        choices=KEEPINGS,
        help="for --tune: bound of the weights over hours: the paper's leakage (which forgets "
        f"them), a leakage with a dead zone, or a projection in its place ({DEFAULT_KEEPING})",
    )
    shared.add_output(parser, None)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 0, or 1 where the design fails."""
    _require_sense(options)
    _require_drive(options)
    vehicle = shared.read_vehicle(options)
    name, method = _method(options, vehicle)
    if isinstance(method, PaperIdentifier):
        return _judge_gains(options, vehicle, method)
    _refuse_gains(options, name)
    driving = replace(natural_driving(vehicle), **_overrides(options))
    certificate = certify(method, vehicle, driving)
    if options.along is not None:
        drive = shared.read_log(options.along, vehicle, shared.given_map(options), dt=method.dt)
        along = method.certify_along(identify(drive, vehicle, method))
        if not along.properties:
            raise ValueError(f"--along: nothing is proven of {name} along a drive")
        certificate = replace(certificate, properties=certificate.properties + along.properties)
    text = method_text(name, certificate, vehicle, driving)
    numbers = {
        "method": name,
        "conditions": {field: getattr(driving, field) for field in _OF_ALL},
        **certificate.to_dict(),
        "vehicle": vehicle_numbers(vehicle),
    }
    if options.out is not None:
        with output_folder(options.out, force=options.force) as folder:
            _write_certificate(folder, text, numbers)
    tell(json.dumps(numbers, indent=2) if options.json else text)
    _say_written(options)
    return FAILS if certificate.verdict == "fail" else DONE


def _require_drive(options: argparse.Namespace) -> None:
    """Refuse to be told how a log is read where none is."""
    told = {
        "--columns": options.columns,
        "--dbc": options.dbc,
        "--rate": options.rate is not None,
        "--cut-holes": options.cut_holes,
        "--mend-clock": options.mend_clock,
    }
    for option, value in told.items():
        if value and options.along is None:
            raise ValueError(f"{option} is for a drive: give one by --along LOG")


def _method(options: argparse.Namespace, vehicle: Vehicle) -> shared.Chosen:
    """Return what is judged; gains that are to be found are those of a law of the paper."""
    if options.tune is None:
        return shared.chosen_method(options, vehicle, online=True)
    if options.design is not None:
        raise ValueError("--tune finds gains: give no --design FILE to judge with it")
    law = options.method or REFERENCE
    if law not in VARIANTS:
        raise ValueError(f"--tune finds gains of {', '.join(VARIANTS)}, {law} has none")
    if VARIANTS[law].scaled:
        raise ValueError("--method instantaneous_scaled is a control, tune one of the others")
    driving = replace(natural_driving(vehicle), **_overrides(options))
    margin = options.phase_margin or PHASE_MARGIN
    found = design_for(vehicle, driving, law=law, phase_margin=margin)
    known = found.operation(vehicle, driving)
    return shared.Chosen(law, with_keeping(found, known, options.keep or DEFAULT_KEEPING))


def _refuse_gains(options: argparse.Namespace, name: str) -> None:
    for option in _OF_GAINS:
        if getattr(options, option) is not None:
            raise ValueError(
                f"--{option.replace('_', '-')} is for the gains of the paper's laws, which "
                f"{name} has not: add --paper, --method {'|'.join(VARIANTS)} or --design FILE"
            )


def _judge_gains(options: argparse.Namespace, vehicle: Vehicle, design: PaperIdentifier) -> int:
    """Judge the gains of a law of the paper, tell and write what is asked for."""
    driving = _driving(options, design, vehicle)
    if options.design is None:
        design = replace(design, driving=driving)
    certificate = certify(design, vehicle, driving)
    drive = None
    if options.along is not None:
        drive = shared.read_log(options.along, vehicle, shared.given_map(options), dt=design.dt)
    if options.tune is not None:
        require_free(options.tune, force=options.force)
    numbers = {
        "method": design.law,
        "conditions": asdict(driving),
        **certificate.to_dict(),
        "vehicle": vehicle_numbers(vehicle),
    }
    texts = [
        _conditions(design, vehicle, driving, _said(options, design, driving)),
        certificate_text(certificate, design.force_unit),
    ]
    if drive is not None:
        texts.append(_along(drive, vehicle, design))
    if certificate.verdict != "pass" and options.tune is None and not options.json:
        texts.append(_proposal(options, design, vehicle, driving))
    text = "\n".join(texts)
    with ExitStack() as stack:  # where a part fails, none is there
        if options.out is not None:
            folder = stack.enter_context(output_folder(options.out, force=options.force))
            _write_certificate(folder, text, numbers)
            learnt = drive or drive_to_learn()
            operation = design.operation(vehicle, driving)
            draw_check(folder, learnt, vehicle, design, operation, certificate)
        if options.tune is not None:
            write_atomically(options.tune, design_text(design))
    tell(json.dumps(numbers, indent=2) if options.json else text)
    _say_written(options)
    return FAILS if certificate.verdict == "fail" else DONE


def _write_certificate(folder: Path, text: str, numbers: Mapping[str, Any]) -> None:
    write_json(folder / NUMBERS, numbers)
    write_file(folder / TEXT, f"{text}\n")


def _say_written(options: argparse.Namespace) -> None:
    for what in (options.tune, None if options.out is None else f"{options.out}/"):
        if what is not None:
            say(f"wrote {what}")


def _require_sense(options: argparse.Namespace) -> None:
    shared.method_is_given(options)
    if options.tune is None:
        for name in ("phase_margin", "keep"):
            if getattr(options, name) is not None:
                raise ValueError("--phase-margin and --keep go with --tune FILE")
    for name in ("bandwidth", "speed", "slip", "friction", "phase_margin"):
        value = getattr(options, name)
        if value is not None and not 0.0 < value < float("inf"):
            raise ValueError(f"--{name.replace('_', '-')} must be positive, it is {value:g}")
    for name in ("noise_v_x", "noise_v_y", "noise_r", "noise_delta"):
        value = getattr(options, name)
        if value is not None and not 0.0 <= value < float("inf"):
            raise ValueError(f"--{name.replace('_', '-')} must not be negative, it is {value:g}")
    if options.slip is not None and options.slip > 1.0:
        raise ValueError(f"--slip must be in rad and below 1, it is {options.slip:g}")


def _driving(options: argparse.Namespace, design: PaperIdentifier, vehicle: Vehicle) -> Driving:
    """Return what the design declares, or what is natural for the car, with the options over it."""
    return replace(design.driving or natural_driving(vehicle), **_overrides(options))


def _overrides(options: argparse.Namespace) -> dict[str, float]:
    given = {field: getattr(options, option) for field, option in CONDITIONS.items()}
    return {field: value for field, value in given.items() if value is not None}


def _said(options: argparse.Namespace, design: PaperIdentifier, driving: Driving) -> str:
    """Return where the conditions come from."""
    changed = ", ".join(f"--{CONDITIONS[field].replace('_', '-')}" for field in _overrides(options))
    if options.design is None:
        return "conditions: of the car" + (f", but for {changed}" if changed else "")
    if design.driving is None:
        told = "conditions: none stored in the design, those of the car"
        return told + (f", but for {changed}" if changed else "")
    if driving == design.driving:
        return "conditions: as stored in the design"
    return f"conditions: as stored in the design, but for {changed}: not the verdict of the file"


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


def _along(recording: Recording, vehicle: Vehicle, design: PaperIdentifier) -> str:
    history = identify(recording, vehicle, design)
    if history.diverged_at is not None:
        return f"along {recording.name}: the law diverged at {history.diverged_at:g} s"
    at = strongest_along(history, design)
    return (
        f"along {recording.name}: largest loop gain {at.gain:.4g} at {at.t:g} s, "
        f"gain margin there {at.margin:.3g}"
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
        known = better.operation(vehicle, driving)
        better = with_keeping(better, known, DEFAULT_KEEPING)
    except DesignError as error:
        return f"no better gains at this bandwidth: {error}"
    gains, verdict = better.gains, certify(better, vehicle, driving).verdict
    return (
        f"proposal ({verdict}): A_d = -{-gains.A_d[0][0]:.4g} I, lambda {gains.forgetting:.4g}, "
        f"eta_W {gains.eta_W:.4g}, eta_V {gains.eta_V:.4g}, rho_W {gains.rho_W:.4g}, rho_V "
        f"{gains.rho_V:.4g}{_radii(gains)}{f', lead {gains.lead:.4g}' if gains.lead else ''}\n"
        f"write it with: tireid check --tune design.toml --method {design.law}{_given(options)}"
    )


def _given(options: argparse.Namespace) -> str:
    """Return the options that say which car drives how hard, as they were given."""
    names = ("vehicle", *CONDITIONS.values())
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    return "".join(
        f" --{name.replace('_', '-')} {shlex.quote(str(value))}" for name, value in given.items()
    )
