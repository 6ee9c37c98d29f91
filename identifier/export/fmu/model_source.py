"""C source of a folded step for the FMU: model.h, what is fixed, and model.c, what it does.

The step itself is text that CasADi generates. Carried values lie one after the other in one array,
matrices by columns.
"""

import math
from collections.abc import Iterable

import casadi as ca
import numpy as np

from identifier.export.fold import FoldedStep

HEADER = """/* Generated: one identifier, every number folded in. */
#ifndef MODEL_H
#define MODEL_H

/* All names begin with that of the model, for programs that hold several. */
#define MODEL(function) {name}_##function

#define MODEL_TOKEN "{token}"
#define MODEL_DT {dt}        /* s, sampling interval */
#define MODEL_MIN_SPEED {min_speed} /* m/s, below it forces are zero and learning rests */
#define MODEL_CARRY {carry}      /* numbers carried from sample to sample, at least one */
#define MODEL_RESTS_FIRST {rests_first} /* before the first sample the observer takes its values */

extern const double MODEL(carry_start)[MODEL_CARRY];

/* One sample: input is v_x, x = (v_y, r), u = (delta_f, delta_r); next and force are written. */
void MODEL(kernel)(const double *carry, const double *input, double *next, double *force);

/* With adaptation off, what has been learnt stays: next takes it from carry. */
void MODEL(keep_learnt)(const double *carry, double *next);

#endif
"""

SOURCE = """/* Generated: see model.h. */
#include "model.h"

#include <stddef.h>
#include <string.h>

{generated}
const double MODEL(carry_start)[MODEL_CARRY] = {{
{start}
}};

void MODEL(kernel)(const double *carry, const double *input, double *next, double *force) {{
  const double *arg[{sz_arg}] = {{{arguments}}};
  double *res[{sz_res}] = {{{results}}};
  double w[{sz_w}];
  casadi_int iw[{sz_iw}];
{clear}  {name}(arg, res, iw, w, 0);
}}

void MODEL(keep_learnt)(const double *carry, double *next) {{
{kept}
}}
"""


def model_header(folded: FoldedStep, token: str) -> str:
    """Return model.h.

    Parameters
    ----------
    folded : the step.
    token : GUID of FMI 2.0, instantiation token of FMI 3.0.
    """
    return HEADER.format(
        name=folded.name,
        token=token,
        dt=literal(folded.dt),
        min_speed=literal(folded.min_speed),
        carry=max(sum(value.size for value in folded.carry.values()), 1),
        rests_first=int(folded.rests_first),
    )


def model_source(folded: FoldedStep) -> str:
    """Return model.c.

    Parameters
    ----------
    folded : the step.

    Raises
    ------
    ValueError
        Where a carried value is not finite.
    """
    step = folded.function
    generator = ca.CodeGenerator("model.c", {"with_header": False})
    generator.add(step)
    sizes = [value.size for value in folded.carry.values()]
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
    ports = dict(zip(folded.carry, zip(offsets, sizes, strict=False), strict=False))
    start = [float(number) for value in folded.carry.values() for number in value.ravel(order="F")]
    kept = [
        f"  memcpy(next + {first}, carry + {first}, {size} * sizeof(double)); /* {port} */"
        for port, (first, size) in ports.items()
        if port in folded.learnt
    ]
    return SOURCE.format(
        generated=generator.dump(),
        name=folded.name,
        start=_rows(literal(number) for number in start or [0.0]),
        clear="" if ports else "  next[0] = carry[0]; /* nothing is carried */\n",
        sz_arg=step.sz_arg(),
        sz_res=step.sz_res(),
        sz_w=max(step.sz_w(), 1),
        sz_iw=max(step.sz_iw(), 1),
        arguments=", ".join(
            [f"carry + {first}" for first, _ in ports.values()]
            + ["&input[1]", "&input[3]", "input"]
        ),
        results=", ".join([f"next + {first}" for first, _ in ports.values()] + ["force"]),
        kept="\n".join(kept) or "  (void)carry; /* nothing is learnt */\n  (void)next;",
    )


def literal(number: float) -> str:
    """Return a C literal that reads back as the same double.

    Parameters
    ----------
    number : finite.

    Raises
    ------
    ValueError
        Where it is not.
    """
    if not math.isfinite(number):
        raise ValueError(f"a carried value must be finite to be exported, it is {number}")
    return repr(float(number))


def _rows(literals: Iterable[str], width: int = 4) -> str:
    words = list(literals)
    lines = [", ".join(words[i : i + width]) for i in range(0, len(words), width)]
    return ",\n".join(f"  {line}" for line in lines)
