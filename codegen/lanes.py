"""Generated C as C++ over lanes: casadi_real becomes a small vector of GCC, one run in each lane.

The operations are those of the scalar code, in the same order and without fused instructions, so
that a lane has the bits of a scalar run. Functions that no processor has for vectors (exp, tanh,
...) are called lane by lane. What has no meaning lane by lane, such as a branch, does not compile.
"""

import re
from functools import cache
from typing import NamedTuple

import casadi as ca

from codegen.compiler import load_library

CPP_FLAGS = (
    "-x",
    "c++",
    "-std=c++17",
    "-O2",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-fno-signed-zeros",
    "-ffp-contract=off",
    "-fno-exceptions",
    "-fno-rtti",
    "-Wno-psabi",  # vectors are passed within this one file only
    "-fPIC",
    "-shared",
)


class Target(NamedTuple):
    """Doubles in one register of the processor, and the compiler's options that say so."""

    lanes: int
    flags: tuple[str, ...]


# Never wider than a register: gcc then goes through memory and loses all that lanes gain.
TARGETS = (
    Target(2, ()),
    Target(4, ("-mavx2",)),
    Target(8, ("-mavx512f", "-mavx512dq", "-mavx512vl")),
)
PROBE = """
int tireid_vectors(void) {
#if defined(__x86_64__) && defined(__GNUC__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")
      && __builtin_cpu_supports("avx512vl")) return 2;
  if (__builtin_cpu_supports("avx2")) return 1;
#endif
  return 0;
}
"""
# fmax and fmin are those of C99: the number where the other is none.
LANES = """
#include <math.h>
#include <string.h>
#define __STDC_VERSION__ 199901L /* generated code asks it whether there is fmax */
enum { N_LANES = %d };
typedef double Numbers __attribute__((vector_size(8 * N_LANES)));
typedef long long Bits __attribute__((vector_size(8 * N_LANES)));
namespace {
struct Lanes {
  Numbers v;
  Lanes() = default;
  Lanes(double a) : v(a - Numbers{}) {}
  Lanes(Numbers a) : v(a) {}
};
inline Lanes pick(Bits c, Lanes a, Lanes b) { return Lanes(Numbers(c ? a.v : b.v)); }
#define ARITHMETIC(op) \\
  inline Lanes operator op(Lanes a, Lanes b) { return Lanes(Numbers(a.v op b.v)); }
ARITHMETIC(+) ARITHMETIC(-) ARITHMETIC(*) ARITHMETIC(/)
inline Lanes operator-(Lanes a) { return Lanes(Numbers(-a.v)); }
inline Lanes& operator+=(Lanes& a, Lanes b) { return a = a + b; }
#define COMPARISON(op) \\
  inline Lanes operator op(Lanes a, Lanes b) { return pick(a.v op b.v, 1., 0.); }
COMPARISON(<) COMPARISON(<=) COMPARISON(>) COMPARISON(>=) COMPARISON(==) COMPARISON(!=)
inline Lanes operator!(Lanes a) { return a == 0.; }
inline Lanes operator&&(Lanes a, Lanes b) { return pick((a.v != 0.) & (b.v != 0.), 1., 0.); }
inline Lanes operator||(Lanes a, Lanes b) { return pick((a.v != 0.) | (b.v != 0.), 1., 0.); }
inline Lanes where(Lanes c, Lanes a) { return pick(c.v != 0., a, 0.); }
inline Lanes fmax(Lanes a, Lanes b) { return pick((a.v > b.v) | (b.v != b.v), a, b); }
inline Lanes fmin(Lanes a, Lanes b) { return pick((a.v < b.v) | (b.v != b.v), a, b); }
inline Lanes fabs(Lanes a) { return Lanes((Numbers)((Bits)a.v & 0x7fffffffffffffffLL)); }
inline Lanes sign(Lanes a) { return pick(a.v < 0., -1., pick(a.v > 0., 1., a)); }
#define LANE_BY_LANE(f) inline Lanes f(Lanes a) { \\
  Lanes y; for (int i = 0; i < N_LANES; ++i) y.v[i] = ::f(a.v[i]); return y; }
#define PAIR_BY_PAIR(f) inline Lanes f(Lanes a, Lanes b) { \\
  Lanes y; for (int i = 0; i < N_LANES; ++i) y.v[i] = ::f(a.v[i], b.v[i]); return y; }
LANE_BY_LANE(sqrt) LANE_BY_LANE(exp) LANE_BY_LANE(log) LANE_BY_LANE(expm1) LANE_BY_LANE(log1p)
LANE_BY_LANE(sin) LANE_BY_LANE(cos) LANE_BY_LANE(tan) LANE_BY_LANE(asin) LANE_BY_LANE(acos)
LANE_BY_LANE(atan) LANE_BY_LANE(sinh) LANE_BY_LANE(cosh) LANE_BY_LANE(tanh) LANE_BY_LANE(asinh)
LANE_BY_LANE(acosh) LANE_BY_LANE(atanh) LANE_BY_LANE(floor) LANE_BY_LANE(ceil) LANE_BY_LANE(erf)
PAIR_BY_PAIR(pow) PAIR_BY_PAIR(atan2) PAIR_BY_PAIR(fmod) PAIR_BY_PAIR(copysign)
PAIR_BY_PAIR(hypot)
#define casadi_real Lanes
#define CASADI_SYMBOL_EXPORT static inline
"""

# b runs over blocks of lanes, k over samples. Carried ports alternate between `wide` and `other`.
# A pointer of `in` moves by in_block from block to block and by in_step from sample to sample;
# where `shared` holds, it leads to plain numbers that all lanes get.
LOOP = """
enum {{ N_IN = {n_in}, N_OUT = {n_out}, ALL_IN = {all_in}, ALL_OUT = {all_out} }};
const long SIZE_IN[] = {{{size_in}}}, SIZE_OUT[] = {{{size_out}}};
const long NEXT[] = {{{next}}};  /* output that the input is carried on from, or -1 */
const int IS_OUTPUT[] = {{{outputs}}};  /* whether an output is told, not carried */
inline void load(Lanes* to, const double* from, long size, long shared) {{
  for (long j = 0; j < size; ++j) {{
    if (shared) to[j] = Lanes(from[j]);
    else memcpy(&to[j], from + j * N_LANES, sizeof(Lanes));
  }}
}}
}}
extern "C" int {name}_lanes(
    long n, long first, long last, const double* const* in, const long* in_block,
    const long* in_step, const long* shared, long n_kept, const long* kept,
    double* const* states, double* const* final, double* const* outputs, double* scratch) {{
  Lanes* const wide = (Lanes*)scratch;
  Lanes *const other = wide + ALL_IN, *const out = other + ALL_IN, *const work = out + ALL_OUT;
  Lanes *now[N_IN], *following[N_IN], *res[{sz_res}];
  const Lanes* arg[{sz_arg}];
  for (long b = first; b < last; ++b) {{
    Lanes *to = wide, *to_next = other, *to_out = out;
    for (long i = 0; i < N_IN; to += SIZE_IN[i], to_next += SIZE_IN[i], ++i) {{
      load(to, in[i] + b * in_block[i], SIZE_IN[i], shared[i]);
      arg[i] = now[i] = to;
      following[i] = to_next;
    }}
    for (long i = 0; i < N_OUT; to_out += SIZE_OUT[i], ++i) res[i] = to_out;
    long row = 0;
    for (long k = 0; k < n; ++k) {{
      const int keep = row < n_kept && kept[row] == k;
      for (long i = 0; i < N_IN; ++i) {{
        if (in_step[i])
          load(now[i], in[i] + b * in_block[i] + k * in_step[i], SIZE_IN[i], shared[i]);
        if (NEXT[i] < 0) continue;
        arg[i] = now[i];
        res[NEXT[i]] = following[i];
        if (keep)
          memcpy(states[i] + (b * n_kept + row) * SIZE_IN[i] * N_LANES, now[i],
                 SIZE_IN[i] * sizeof(Lanes));
      }}
      if ({name}(arg, res, 0, work, 0)) return 1;
      if (keep) {{
        for (long i = 0; i < N_OUT; ++i)
          if (IS_OUTPUT[i])
            memcpy(outputs[i] + (b * n_kept + row) * SIZE_OUT[i] * N_LANES, res[i],
                   SIZE_OUT[i] * sizeof(Lanes));
        ++row;
      }}
      for (long i = 0; i < N_IN; ++i) {{
        if (NEXT[i] < 0) continue;
        Lanes* const swap = now[i];
        now[i] = following[i];
        following[i] = swap;
      }}
    }}
    for (long i = 0; i < N_IN; ++i)
      if (NEXT[i] >= 0)
        memcpy(final[i] + b * SIZE_IN[i] * N_LANES, now[i], SIZE_IN[i] * sizeof(Lanes));
  }}
  return 0;
}}
"""


@cache
def find_target() -> Target | None:
    """Return the widest vectors of this machine; None where there is no compiler.

    Raises
    ------
    CompilationError
        Where the compiler refuses to tell.
    OSError
        Where its answer can be neither written nor loaded.
    """
    library = load_library(PROBE, "vectors")
    return None if library is None else TARGETS[library.tireid_vectors()]


def lanes_source(step: ca.Function, carry: tuple[str, ...], lanes: int) -> str:
    """Return C++ of a loop over samples, `{step}_lanes`, each lane of which is a run of its own.

    Raises
    ------
    ValueError
        Where it is no SX function: only those are straight-line code.
    """
    if not step.is_a("SXFunction"):
        raise ValueError(f"{step.name()} must be an SX function, it is a {step.class_name()}")
    generator = ca.CodeGenerator(f"{step.name()}.c")
    generator.add(step)
    body = generator.dump()
    for pattern, replacement in (
        (r"\((\w+)\?(\w+):0\)", r"where(\1,\2)"),
        (r"arg\[\d+\]\? (arg\[\d+\]\[\d+\]) : 0", r"\1"),  # every pointer is given
        (r"if \(res\[\d+\]!=0\) ", ""),
        (r"return x<0 \? -1 : x>0 \? 1 : x;", "return sign(x);"),
    ):
        body = re.sub(pattern, replacement, body)
    return LANES % lanes + body + _loop(step, carry)


def scratch_size(step: ca.Function) -> int:
    """Return how many vectors of lanes the loop needs to work in."""
    ports_in, ports_out = step.nnz_in(), step.nnz_out()
    return int(2 * ports_in + ports_out + step.sz_w())


def _loop(step: ca.Function, carry: tuple[str, ...]) -> str:
    names_in, names_out = list(step.name_in()), list(step.name_out())
    size_in = [step.numel_in(name) for name in names_in]
    size_out = [step.numel_out(name) for name in names_out]
    after = [names_out.index(f"{p}_next") if p in carry else -1 for p in names_in]
    return LOOP.format(
        name=step.name(),
        n_in=len(names_in),
        n_out=len(names_out),
        all_in=sum(size_in),
        all_out=sum(size_out),
        size_in=_listed(size_in),
        size_out=_listed(size_out),
        next=_listed(after),
        outputs=_listed([int(i not in after) for i in range(len(names_out))]),
        sz_arg=max(step.sz_arg(), len(names_in)),
        sz_res=max(step.sz_res(), len(names_out)),
    )


def _listed(numbers: list[int]) -> str:
    return ", ".join(map(str, numbers))
