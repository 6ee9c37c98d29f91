"""`tireid check`: what is certified of an identifier?"""

import argparse
import json
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from codegen.writing import write_file
from identifier.certificate import Certificate
from identifier.driving import BANDWIDTH, Driving, natural_driving
from identifier.frozen import vehicle_numbers
from identifier.methods import LIVE, certify
from identifier.paper.design import VARIANTS, PaperIdentifier, design_text
from identifier.paper.laws import LAWS
from identifier.run import History, identify
from identifier.stability.certificate import judged_loop
from identifier.stability.loop import direction_matrix
from identifier.stability.operation import Operation, proven_bounds
from models.rules import require_not_negative, require_positive
from models.vehicle import Vehicle
from tireid.commands import DONE, FAILS
from tireid.commands import options as shared
from tireid.commands.certificate_table import certificate_text, method_text, unit_text
from tireid.commands.demo_story import drive_to_learn
from tireid.figures.paper import error_figure, locus_figure
from tireid.figures.style import paper_design, save_figures
from tireid.output import write_json
from tireid.progress import say, tell

_BOUNDS = {
    "error_bound": "proven bound, leakage",
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
    known = {entry.name: entry.value for entry in certificate.properties}
    bounds = {title: known[name] for name, title in _BOUNDS.items() if name in known}  # [U s]
    save_figures(
        folder,
        {"locus": locus_figure(loop, design.dt), "bounds": error_figure(history, bounds)},
    )


_CONDITIONS = {  # by field of the declared driving: its option, and what that says
    "bandwidth": ("--bandwidth HZ", f"of the steering ({BANDWIDTH:g} Hz)"),
    "v_x": ("--speed M/S", "(4 sqrt(g wheelbase))"),
    "slip": ("--slip RAD", "largest (twice sliding)"),
    "friction": ("--friction MU", "of the road (1)"),
    "noise_v_x": ("--noise-v-x M/S", "largest error of v-x"),
    "noise_v_y": ("--noise-v-y M/S", "largest error of v-y"),
    "noise_r": ("--noise-r RAD/S", "largest error of r"),
    "noise_delta": ("--noise-delta RAD", "largest error of delta"),
}
_OF_ALL = ("v_x", "friction")  # conditions of which not gains alone are judged


def declare(new: Any) -> None:
    parser = new(
        description="Certify an identifier; with no option the axle identifier, the default in "
        "a car: limits, curve, jumps, the time to follow a drop of friction. Gains of the paper's "
        "laws (--paper, --method NAME, --design FILE) are judged at the worst regressor: poles, "
        "sampling, gain and phase margin, damping, drift, proven bounds. Exit code 0: nothing "
        "fails, 1: something does, 2: bad input.",
    )
    shared.add_vehicle(parser)
    shared.add_method(parser, LIVE)
    shared.add_options(parser, float, dict(_CONDITIONS.values()))
    shared.add_options(parser, bool, {"--json": "print the certificate as JSON"})
    shared.add_output(parser, None)


def run(options: argparse.Namespace) -> int:
    """Run the command; return 0, or 1 where the design fails."""
    given = _overrides(options)
    vehicle = shared.read_vehicle(options)
    name, method = shared.chosen_method(options, vehicle, online=True)
    paper = method if isinstance(method, PaperIdentifier) else None
    for field in given if paper is None else ():
        if field not in _OF_ALL:
            raise ValueError(
                f"{_option(field)} is for the gains of the paper's laws, which {name} has not: "
                f"add --paper, --method {'|'.join(VARIANTS)} or --design FILE"
            )
    declared = None if paper is None else paper.driving
    driving = replace(declared or natural_driving(vehicle), **given)
    if paper is not None and options.design is None:
        method = paper = replace(paper, driving=driving)
    certificate = certify(method, vehicle, driving)
    if paper is None:
        text = method_text(name, certificate, vehicle, driving)
    else:
        text = (
            f"{_conditions(paper, vehicle, driving, _said(options, paper, driving))}\n"
            f"{certificate_text(certificate, paper.force_unit)}"
        )
    conditions = asdict(driving)
    numbers = {
        "method": name,
        "conditions": {one: conditions[one] for one in (conditions if paper else _OF_ALL)},
        **certificate.to_dict(),
        "vehicle": vehicle_numbers(vehicle),
    }
    with ExitStack() as stack:  # where a part fails, none is there
        if options.out is not None:
            folder = stack.enter_context(shared.folder_of(options))
            write_json(folder / "certificate.json", numbers)
            write_file(folder / "certificate.txt", f"{text}\n")
            if paper is not None:
                write_file(folder / "design.toml", design_text(paper))
                learnt = identify(drive_to_learn(), vehicle, paper)
                draw_check(folder, learnt, paper.operation(vehicle, driving), certificate)
    tell(json.dumps(numbers, indent=2) if options.json else text)
    if options.out is not None:
        say(f"wrote {options.out}/")
    return FAILS if certificate.verdict == "fail" else DONE


def _option(field: str) -> str:
    return _CONDITIONS[field][0].split()[0]


def _overrides(options: argparse.Namespace) -> dict[str, float]:
    """Return the given conditions by their field."""
    every = {f: getattr(options, _option(f)[2:].replace("-", "_")) for f in _CONDITIONS}
    given = {field: value for field, value in every.items() if value is not None}
    for field, value in given.items():
        require = require_not_negative if field.startswith("noise") else require_positive
        require(ValueError, **{_option(field): value})
    if given.get("slip", 0.0) > 1.0:
        raise ValueError(f"--slip must be in rad and below 1, it is {options.slip:g}")
    return given


def _said(options: argparse.Namespace, design: PaperIdentifier, driving: Driving) -> str:
    changed = ", ".join(map(_option, _overrides(options)))
    stored = options.design is not None and design.driving is not None
    origin = "none stored in the design, those of the car" if options.design else "of the car"
    said = f"conditions: {'as stored in the design' if stored else origin}"
    if not changed or (stored and driving == design.driving):
        return said
    return f"{said}, but for {changed}" + (": not the verdict of the file" if stored else "")


def _conditions(design: PaperIdentifier, vehicle: Vehicle, driving: Driving, said: str) -> str:
    gains = design.gains
    unit = unit_text("U", design.force_unit)
    rates = f"lambda {gains.forgetting:.4g}" + "".join(
        f", {name} {getattr(gains, name):.4g}" for name in ("eta_W", "eta_V", "rho_W", "rho_V")
    )
    rows = "; ".join(" ".join(f"{value:.4g}" for value in row) for row in gains.A_d)
    return (
        f"{vehicle.name} at {driving.v_x:.3g} m/s, slip up to {driving.slip:.3g} rad, friction "
        f"{driving.friction:g}, steering up to {driving.bandwidth:g} Hz; sensors err by up to "
        f"{driving.noise_v_x:.3g} and {driving.noise_v_y:.3g} m/s, {driving.noise_r:.3g} rad/s, "
        f"{driving.noise_delta:.3g} rad\n{said}\n"
        f"{design.law} law, {design.network.hidden} units, euler at "
        f"{1e3 * design.dt:g} ms, forces in {unit}: A_d {rows}, {rates}\n"
    )
