"""C source of a folded step for the FMU: the files of the C package, and model.h, which names them.

What is simulated is what is shipped: the same equations, guards and status codes, in double.
"""

from pathlib import PurePosixPath

from identifier.export.c_source import c_sources
from identifier.export.fold import FoldedStep
from identifier.export.manifest import ingredients, summary

HEADER = """/* Generated: which component the FMU holds. */
#ifndef MODEL_H
#define MODEL_H

#include "{name}.h"

/* All names begin with that of the component, for programs that hold several. */
#define MODEL(name) {name}_##name

#define MODEL_TOKEN "{token}"
#define MODEL_DT {NAME}_SAMPLE_TIME
#define MODEL_MIN_SPEED {NAME}_MIN_SPEED

#endif
"""


def model_header(name: str, token: str) -> str:
    """Return model.h.

    Parameters
    ----------
    name : of the step.
    token : GUID of FMI 2.0, instantiation token of FMI 3.0.
    """
    return HEADER.format(name=name, NAME=name.upper(), token=token)


def model_files(folded: FoldedStep) -> dict[str, str]:
    """Return header and sources of the C package by file name.

    Parameters
    ----------
    folded : the step.

    Raises
    ------
    UnknownOperationError
        Where the method needs an operation that has no plain C.
    ValueError
        Where nothing is carried from step to step, or a carried value is not finite.
    """
    about = summary(folded, ingredients(folded, single=False))
    sources = c_sources(folded, single=False, about=about)
    return {PurePosixPath(path).name: text for path, text in sources.items()}
