"""A tire as other programs read it: property files, g-g-v, a car of slipx, understeer gradient."""

from contextlib import ExitStack
from datetime import date
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np

from codegen.writing import write_file
from identifier.export.ggv import ggv_text
from identifier.export.slipx import slipx_files
from identifier.export.steady import Understeer, steady_text, understeer_gradient
from identifier.export.tir import tire_properties
from identifier.tire_model import AXLES, TireModel, load_model, stored_verdict
from models.files import resolved, write_atomically
from tireid.output import OutputError, output_folder, require_free
from tireid.run import Run

WANTED = "--tir FILE, --slipx DIR, --ggv FILE, --steady FILE, --understeer"
_WORDS = {True: "valid", False: "NOT valid", None: "not judged"}
_Where = str | PathLike[str] | None


class Emitted(NamedTuple):
    """Files and folders that were written, and the understeer gradient where it was asked for."""

    files: tuple[Path, ...]
    understeer: Understeer | None


def emit(
    source: Run | TireModel | str | PathLike[str],
    *,
    tir: _Where = None,
    slipx: _Where = None,
    ggv: _Where = None,
    steady: _Where = None,
    understeer: bool | str | PathLike[str] = False,
    overwrite: bool = False,
) -> Emitted:
    """Write a tire as other programs read it: all that is asked for, or nothing.

    Parameters
    ----------
    source : a run, of which the tire at its end, a tire model, or its file.
    tir : tire property files (PAC2002), of pure lateral slip, of one tire each: `car.tir` gives
        `car_front.tir` and `car_rear.tir`.
    slipx : folder of a car for slipx 0.2.0.
    ggv : table of speed and largest a_x and a_y, at the lower end of the band of 90 %.
    steady : table of a_y of steady turning over steering angle and speed.
    understeer : whether to compute the gradient; a path also writes it as CSV.
    overwrite : replace what is there.

    Raises
    ------
    ValueError
        Where nothing is asked for, or the model does not know it.
    OutputError, OSError
        Where a file is there and not to be replaced, two have one name, or one cannot be written.
    """
    if understeer is False and tir is slipx is ggv is steady is None:
        raise ValueError(
            "nothing is asked for: give one or more of tir, slipx, ggv, steady, understeer"
        )
    if isinstance(source, Run):
        model = source.tire
        verdict = f"{source.verdict.word}, identified from {source.recording.name}"
    elif isinstance(source, TireModel):
        model, verdict = source, ""
    else:
        model, word = load_model(source), _WORDS[stored_verdict(source)]
        verdict = f"{word} on its identification drive, model {source}"
    if tir is not None and not Path(tir).name:
        raise OutputError(f"tir must name a file, it is {str(tir)!r}")
    table = None if isinstance(understeer, bool) else Path(understeer)
    files = [] if tir is None else [Path(tir).with_stem(f"{Path(tir).stem}_{a}") for a in AXLES]
    files += [Path(one) for one in (ggv, steady, table) if one is not None]
    for path in files:
        if not path.parent.is_dir() or (path.exists() and not path.is_file()):
            raise OutputError(f"{path} cannot be a file: name one in a folder that is there")
        require_free(path, force=overwrite)
    paths = (*files, *([] if slipx is None else [Path(slipx)]))
    if len({resolved(path) for path in paths}) < len(paths):
        raise OutputError(f"two outputs have one name: {', '.join(map(str, paths))}")
    rng, new = np.random.default_rng(0), [path for path in files if not path.exists()]
    with ExitStack() as stack:
        if slipx is not None:
            folder = stack.enter_context(output_folder(Path(slipx), force=overwrite))
            for name, text in slipx_files(model, rng, date.today()).items():
                (folder / name).parent.mkdir(exist_ok=True)
                write_file(folder / name, text)
        texts = [] if tir is None else [tire_properties(model, axle, verdict) for axle in AXLES]
        texts += [] if ggv is None else [ggv_text(model)]
        texts += [] if steady is None else [steady_text(model)]
        found = understeer_gradient(model, rng) if understeer is not False else None
        texts += [] if table is None or found is None else [found.csv]
        try:
            for path, text in zip(files, texts, strict=True):
                write_atomically(path, text)
        except BaseException:
            for path in new:
                path.unlink(missing_ok=True)
            raise
    return Emitted(paths, found)
