"""A stored tire as other programs read it: property files, g-g-v, a car of slipx, understeer."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import date
from os import PathLike
from pathlib import Path

import numpy as np

from codegen.writing import write_file
from identifier.export.ggv import ggv_text, limits
from identifier.export.slipx import slipx_files
from identifier.export.tir import tire_properties
from identifier.export.understeer import Understeer, understeer_gradient
from identifier.tire_model import AXLES, TireModel
from models.files import resolved, write_atomically
from models.vehicle import GRAVITY
from tireid.output import OutputError, output_folder, require_free, text_table
from tireid.run import Run

WANTED = "--tir FILE, --slipx DIR, --ggv FILE, --understeer"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Emitted:
    """What was written, and the understeer gradient where it was asked for.

    files : that were written, folders among them.
    """

    files: tuple[Path, ...]
    understeer: Understeer | None

    def __str__(self) -> str:
        return "" if self.understeer is None else _table(self.understeer)

    def __repr__(self) -> str:
        return f"<Emitted {', '.join(map(str, self.files))}>"


def emit(
    source: Run | TireModel,
    *,
    tir: str | PathLike[str] | None = None,
    slipx: str | PathLike[str] | None = None,
    ggv: str | PathLike[str] | None = None,
    understeer: bool | str | PathLike[str] = False,
    seed: int = 0,
    overwrite: bool = False,
) -> Emitted:
    """Write a tire as other programs read it: all that is asked for, or nothing.

    Parameters
    ----------
    source : a run, of which the tire at its end, or a tire model.
    tir : tire property files (PAC2002), of pure lateral slip, of one tire each: `car.tir` gives
        `car_front.tir` and `car_rear.tir`.
    slipx : folder of a car for slipx 0.2.0.
    ggv : table of speed and largest a_x and a_y, at the lower end of the band of 90 %.
    understeer : whether to compute the gradient; a path also writes it as CSV.
    seed : of the models that are drawn for standard deviations.
    overwrite : replace what is there.

    Raises
    ------
    ValueError
        Where nothing is asked for, or the model cannot tell what is.
    OutputError
        Where a file is there and not to be replaced, or two have one name.
    OSError
        Where something cannot be written.
    """
    if all(one is None for one in (tir, slipx, ggv)) and understeer is False:
        raise ValueError(f"nothing is asked for: add one or more of {WANTED}")
    model = source.tire if isinstance(source, Run) else source
    names: list[Path] = []
    if tir is not None:
        path = Path(tir)
        names += [path.with_name(f"{path.stem}_{axle}{path.suffix}") for axle in AXLES]
    names += [] if ggv is None else [Path(ggv)]
    names += [] if isinstance(understeer, bool) else [Path(understeer)]
    _require_places([*names, *([] if slipx is None else [Path(slipx)])], overwrite=overwrite)
    with ExitStack() as stack:
        if slipx is not None:
            folder = stack.enter_context(output_folder(Path(slipx), force=overwrite))
            drawn = np.random.default_rng(seed)
            for inner, text in slipx_files(model, drawn, date.today()).items():
                (folder / inner).parent.mkdir(parents=True, exist_ok=True)
                write_file(folder / inner, text)
        texts = [] if tir is None else [tire_properties(model, axle) for axle in AXLES]
        texts += [] if ggv is None else [ggv_text(model, limits(model))]
        found = None
        if understeer is not False:
            found = understeer_gradient(model, np.random.default_rng(seed))
            texts += [] if isinstance(understeer, bool) else [found.csv]
        for path, text in zip(names, texts, strict=True):
            write_atomically(path, text)
    return Emitted(files=(*names, *([] if slipx is None else [Path(slipx)])), understeer=found)


def _require_places(paths: Sequence[Path], *, overwrite: bool) -> None:
    """Refuse, before anything is computed, a file that cannot be written and two of one name."""
    for path in paths:
        if not path.parent.is_dir():
            raise OutputError(f"{path.parent} is no folder: create it first")
        require_free(path, force=overwrite)
    if len({resolved(path) for path in paths}) < len(paths):
        raise OutputError(f"two outputs have one name: {', '.join(map(str, paths))}")


def _table(found: Understeer) -> str:
    """Return the gradient as lines: a row for each a_y, a column for each speed."""
    unit, first = np.degrees(GRAVITY), found.gradient[:1]
    alike = np.array_equal(np.broadcast_to(first, found.gradient.shape), found.gradient, True)
    speeds = ["at any speed"] if alike else [f"at {v:.3g} m/s" for v in found.v_x]
    rows = [["a_y [m/s2]", *speeds]]
    for k, a_y in enumerate(found.a_y):
        cells = [
            f"{unit * K:.2f} +- {unit * sd:.2f}" if np.isfinite(K) else ""
            for K, sd in zip(found.gradient[: len(speeds), k], found.sd[:, k], strict=False)
        ]
        rows.append([f"{a_y:g}", *cells])
    return f"understeer gradient [deg/g], +- one standard deviation\n{text_table(rows, '>>>>')}"
