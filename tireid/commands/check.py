"""`tireid check`: what is certified of an identifier, and which gains would be better?"""

import argparse
import json
import math
import shlex
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from codegen.writing import write_file
from identifier.driving import BANDWIDTH, Driving, natural_driving
from identifier.frozen import vehicle_numbers
from identifier.method import Method
from identifier.methods import LIVE, REFERENCE, certify
from identifier.paper.chosen import CHOSEN as PAPER_CHOSEN
from identifier.paper.design import VARIANTS, PaperIdentifier, design_for, design_text, with_keeping
from identifier.paper.laws import LAWS, Gains
from identifier.run import History, identify
from identifier.stability import Certificate, DesignError, Operation
from identifier.stability.along import strongest_along
from identifier.stability.certificate import judged_loop
from identifier.stability.gain_design import DEFAULT_KEEPING, KEEPINGS
from identifier.stability.loop import direction_matrix
from identifier.stability.operation import proven_bounds
from models.files import write_atomically
from models.vehicle import Vehicle
from tireid.commands import COMMANDS, DONE, FAILS
from tireid.commands import options as shared
from tireid.commands.certificate_table import certificate_text, method_text, unit_text
from tireid.commands.demo_story import drive_to_learn
from tireid.figures.paper import error_figure, locus_figure
from tireid.figures.style import paper_design, save_figures
from tireid.output import output_folder, require_free, write_json
from tireid.progress import say, tell

_BOUNDS = {
    "error_bound": "proven bound, leakage",
    "projection_bound": "proven bound, projection",
    "trivial_bound": "no network",
    "printed_bound": "(14) as printed",
}


def draw_check(
    folder: Path, history: History, operation: Operation, certificate: Certificate
) -> None:
    design = paper_design(history)
    chosen = LAWS[design.law]
    law = chosen.error(design.gains.lead)
    D = direction_matrix(chosen, design.gains.matrix)
    kept = proven_bounds(design.gains, law, operation, D).W
    _, loop, _ = judged_loop(design.gains, law, operation, D, kept)
    figures = {
        "locus": locus_figure(loop, integrator=design.integrator, dt=design.dt),
        "bounds": error_figure(history, _error_bounds(certificate)),
    }
    save_figures(folder, figures)


def _error_bounds(certificate: Certificate) -> dict[str, float]:
    """Return the bounds of the error norm [U s] in a certificate, by the name in a legend."""
    known = {entry.name: entry.value for entry in certificate.properties}
    return {title: known[name] for name, title in _BOUNDS.items() if name in known}


_CONDITIONS = {"v_x": "speed"} | {  # field of the declared driving, and the option of it
    name: name
    for name in (
        "slip",
        "friction",
        "bandwidth",
        "noise_v_x",
        "noise_v_y",
        "noise_r",
        "noise_delta",
    )
}
_OF_ALL = ("v_x", "friction")  # conditions of which not gains alone are judged
_OF_GAINS = tuple(option for field, option in _CONDITIONS.items() if field not in _OF_ALL)
_TEXT, _NUMBERS = "certificate.txt", "certificate.json"


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
    numbers = {
        "--bandwidth HZ": f"of the steering ({BANDWIDTH:g} Hz)",
        "--speed M/S": "(4 sqrt(g wheelbase))",
        "--slip RAD": "largest (twice sliding)",
        "--friction MU": "of the road (1)",
        "--noise-v-x M/S": "largest error of v-x",
        "--noise-v-y M/S": "largest error of v-y",
        "--noise-r RAD/S": "largest error of r",
        "--noise-delta RAD": "largest error of delta",
        "--phase-margin DEG": f"for --tune ({PAPER_CHOSEN.phase_margin:g} deg)",
    }
    shared.add_options(parser, float, numbers)
    parser.add_argument("--along", metavar="LOG[:RUN]", help="judge a recorded run too")
    shared.add_log_map(parser)
    shared.add_options(parser, bool, {"--json": "print the certificate as JSON"})
    text = "find gains and write them, for --design FILE"
    shared.add_options(parser, Path, {"--tune FILE": text})
    text = (
        "for --tune: bound of the weights over hours: the paper's leakage (which forgets them), "
        f"a leakage with a dead zone, or a projection in its place ({DEFAULT_KEEPING})"
    )
    parser.add_argument("--keep", choices=KEEPINGS, help=text)
    shared.add_output(parser, None)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 0, or 1 where the design fails."""
    _require_sense(options)
    vehicle = shared.read_vehicle(options)
    name, method = _method(options, vehicle)
    paper = method if isinstance(method, PaperIdentifier) else None
    if paper is None:
        _refuse_gains(options, name)
    declared = None if paper is None else paper.driving
    driving = replace(declared or natural_driving(vehicle), **_overrides(options))
    if paper is not None and options.design is None:
        method = paper = replace(paper, driving=driving)
    certificate = certify(method, vehicle, driving)
    history = None
    if options.along is not None:
        drive = shared.read_log(options.along, vehicle, shared.given_map(options), dt=method.dt)
        history = identify(drive, vehicle, method)
    if options.tune is not None:
        require_free(options.tune, force=options.force)
    if paper is not None:
        text = _gains_text(options, paper, vehicle, driving, certificate, history)
    else:
        if history is not None:
            along = method.certify_along(history).properties
            if not along:
                raise ValueError(f"--along: nothing is proven of {name} along a drive")
            certificate = replace(certificate, properties=certificate.properties + along)
        text = method_text(name, certificate, vehicle, driving)
    conditions = asdict(driving)
    numbers = {
        "method": name,
        "conditions": {one: conditions[one] for one in (conditions if paper else _OF_ALL)},
        **certificate.to_dict(),
        "vehicle": vehicle_numbers(vehicle),
    }
    with ExitStack() as stack:  # where a part fails, none is there
        if options.out is not None:
            folder = stack.enter_context(output_folder(options.out, force=options.force))
            write_json(folder / _NUMBERS, numbers)
            write_file(folder / _TEXT, f"{text}\n")
            if paper is not None:
                learnt = history or identify(drive_to_learn(), vehicle, paper)
                draw_check(folder, learnt, paper.operation(vehicle, driving), certificate)
        if paper is not None and options.tune is not None:
            write_atomically(options.tune, design_text(paper))
    tell(json.dumps(numbers, indent=2) if options.json else text)
    for what in (options.tune, None if options.out is None else f"{options.out}/"):
        if what is not None:
            say(f"wrote {what}")
    return FAILS if certificate.verdict == "fail" else DONE


def _method(options: argparse.Namespace, vehicle: Vehicle) -> tuple[str, Method]:
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
    margin = options.phase_margin or PAPER_CHOSEN.phase_margin
    found = design_for(vehicle, driving, law=law, phase_margin=margin)
    known = found.operation(vehicle, driving)
    return law, with_keeping(found, known, options.keep or DEFAULT_KEEPING)


def _refuse_gains(options: argparse.Namespace, name: str) -> None:
    for option in _OF_GAINS:
        if getattr(options, option) is not None:
            raise ValueError(
                f"--{option.replace('_', '-')} is for the gains of the paper's laws, which "
                f"{name} has not: add --paper, --method {'|'.join(VARIANTS)} or --design FILE"
            )


def _gains_text(
    options: argparse.Namespace,
    design: PaperIdentifier,
    vehicle: Vehicle,
    driving: Driving,
    certificate: Certificate,
    history: History | None,
) -> str:
    """Return what is said of the gains of a law of the paper, and better ones where it helps."""
    texts = [
        _conditions(design, vehicle, driving, _said(options, design, driving)),
        certificate_text(certificate, design.force_unit),
    ]
    if history is not None:
        texts.append(_along(history, design))
    if certificate.verdict != "pass" and options.tune is None and not options.json:
        texts.append(_proposal(options, design, vehicle, driving))
    return "\n".join(texts)


def _require_sense(options: argparse.Namespace) -> None:
    shared.method_is_given(options)
    for word in ("columns", "dbc", "rate", "cut_holes", "mend_clock"):  # of how a log is read
        value = getattr(options, word)
        if options.along is None and value is not None and value is not False and value != []:
            option = f"--{word.replace('_', '-')}"
            raise ValueError(f"{option} is for a drive: give one by --along LOG")
    if options.tune is None:
        for name in ("phase_margin", "keep"):
            if getattr(options, name) is not None:
                raise ValueError("--phase-margin and --keep go with --tune FILE")
    for name in (*_CONDITIONS.values(), "phase_margin"):
        value, noise = getattr(options, name), name.startswith("noise")
        if value is not None and not (0.0 < value < math.inf or (noise and value == 0.0)):
            rule = "not be negative" if noise else "be positive"
            raise ValueError(f"--{name.replace('_', '-')} must {rule}, it is {value:g}")
    if options.slip is not None and options.slip > 1.0:
        raise ValueError(f"--slip must be in rad and below 1, it is {options.slip:g}")


def _overrides(options: argparse.Namespace) -> dict[str, float]:
    given = {field: getattr(options, option) for field, option in _CONDITIONS.items()}
    return {field: value for field, value in given.items() if value is not None}


def _said(options: argparse.Namespace, design: PaperIdentifier, driving: Driving) -> str:
    changed = ", ".join(
        f"--{_CONDITIONS[field].replace('_', '-')}" for field in _overrides(options)
    )
    stored = options.design is not None and design.driving is not None
    origin = "none stored in the design, those of the car" if options.design else "of the car"
    said = f"conditions: {'as stored in the design' if stored else origin}"
    if not changed or (stored and driving == design.driving):
        return said
    return f"{said}, but for {changed}" + (": not the verdict of the file" if stored else "")


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
        f"{1e3 * design.dt:g} ms, forces in {unit}: A_d {rows}, {_rates(gains)}\n"
    )


def _rates(gains: Gains) -> str:
    """Return the rates of a law, and the radii that its weights are kept in, if any."""
    names = ("W_free", "V_free", "W_max", "V_max")
    radii = {name: r for name in names if 0.0 < (r := getattr(gains, name)) < math.inf}
    rates = {name: getattr(gains, name) for name in ("eta_W", "eta_V", "rho_W", "rho_V")}
    numbers = {"lambda": gains.forgetting, **rates, **radii}
    return ", ".join(f"{name} {value:.4g}" for name, value in numbers.items())


def _along(history: History, design: PaperIdentifier) -> str:
    recording = history.recording
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
        f"proposal ({verdict}): A_d = -{-gains.A_d[0][0]:.4g} I, {_rates(gains)}"
        f"{f', lead {gains.lead:.4g}' if gains.lead else ''}\n"
        f"write it with: tireid check --tune design.toml --method {design.law}{_given(options)}"
    )


def _given(options: argparse.Namespace) -> str:
    """Return the options that say which car drives how hard, as they were given."""
    names = ("vehicle", *_CONDITIONS.values())
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    return "".join(
        f" --{name.replace('_', '-')} {shlex.quote(str(value))}" for name, value in given.items()
    )
