"""The vector type of generated C, and the functions on it: each lane holds the number of one sample.

sin, cos, tanh and atan2 are written out where the processor multiplies and adds in one instruction: a call of a
library would move all registers to memory and back. Their polynomials are Chebyshev approximations of the functions
that follow from the equations in `_INLINE`; errors are at most 2.1 units in the last place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Target:
    """Target of the C compiler: lanes of a vector, compiler flags, prefix of glibc's vector functions (or empty).

    fused : the processor has one instruction for a * b + c.
    """

    lanes: int
    flags: tuple[str, ...] = ()
    prefix: str = ""
    fused: bool = False


_ONE, _TWO = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log"), ("pow", "atan2")
_WRITTEN_OUT = ("sin", "cos", "tanh", "atan2")

_HEAD = """
#include <math.h>
typedef double V __attribute__((vector_size(8 * W)));
typedef long long M __attribute__((vector_size(8 * W)));
typedef double U __attribute__((vector_size(8 * W), aligned(8), may_alias));
#define K(x) ((V){} + (x))
#define NUMBER(m) ((V)((m) & (M)K(1.0)))
#define EACH(f) V r; for (int i = 0; i < W; ++i) r[i] = f(x[i]); return r;
#define EACH2(f) V r; for (int i = 0; i < W; ++i) r[i] = f(x[i], y[i]); return r;
static inline V v_fabs(V x) { return (V)((M)x & ((M){} + 0x7fffffffffffffffLL)); }
static inline V v_sqrt(V x) { EACH(__builtin_sqrt) }
static inline V v_floor(V x) { EACH(__builtin_floor) }
static inline V v_ceil(V x) { EACH(__builtin_ceil) }
#ifdef __AVX__ // one instruction, that compilers do not find
#define PICK(name, relation) V r; __asm__(name " %2, %1, %0" : "=v"(r) : "v"(x), "vm"(y)); return r;
#else
#define PICK(name, relation) M m = x relation y; return (V)((m & (M)x) | (~m & (M)y));
#endif
static inline V v_min(V x, V y) { PICK("vminpd", <) } // y if one is not a number
static inline V v_max(V x, V y) { PICK("vmaxpd", >) }
"""


def _horner(variable: str, coefficients: Sequence[float]) -> str:
    """A polynomial as C, the constant first."""
    text = repr(coefficients[-1])
    for number in reversed(coefficients[:-1]):
        text = f"{number!r} + {variable} * ({text})"
    return f"({text})"


# (sin(x) / x - 1) / x^2 and (cos(x) - 1 + x^2 / 2) / x^4 in x^2, |x| <= pi/4
_SIN = (
    -0.16666666666666666, 0.008333333333330948, -0.00019841269836756774, 2.7557316101617874e-06,
    -2.505113165023518e-08, 1.5918115263265974e-10,
)  # fmt: skip
_COS = (
    0.041666666666666664, -0.0013888888888887398, 2.480158729876456e-05, -2.7557317271145144e-07,
    2.087614614655861e-09, -1.1382623647474604e-11,
)  # fmt: skip
# (exp(2 x) - 1 - 2 x) / x^2 in x, |x| <= log(2) / 4
_EXP = (
    2.0000000000000004, 1.3333333333333335, 0.6666666666659861, 0.26666666666656197, 0.08888888907016779,
    0.02539682542470863, 0.00634918945176432, 0.0014109321451518497, 0.0002828297056809958, 5.1405589494805136e-05,
)  # fmt: skip
# (atan(x) / x - 1) / x^2 in x^2, |x| <= 1
_ATAN = (
    -0.3333333333333333, 0.1999999999999753, -0.14285714285384132, 0.11111111093490827, -0.09090908590891934,
    0.07692298971033217, -0.06666564699289104, 0.05881506877793656, -0.052579733342841106, 0.04737749579527779,
    -0.04260356632601652, 0.03749486812535247, -0.031277189066996385, 0.023696731580048622, -0.015535152475414177,
    0.008368931178450162, -0.0034958859739163094, 0.0010496035084968515, -0.00019996189377901382,
    1.806195461861215e-05,
)  # fmt: skip

# Adding 1.5 * 2^52 rounds to an integer, which is then in the low bits. sin and cos: the rest of whole quarters of a
# turn, pi/2 as a sum of three numbers; arguments beyond 10^9 lose digits. tanh: (e - 1) / (e + 1), e = exp(2 |x|) as
# 2^n (1 + p), so that no digit is lost near 0. atan2: of the smaller over the larger, then turned; two infinite
# arguments give no number.
_INLINE = f"""
#define SIGN ((M){{}} + (-0x7fffffffffffffffLL - 1))
#define ROUND 6755399441055744.0
static inline V v_pick(M m, V x, V y) {{ return (V)((m & (M)x) | (~m & (M)y)); }}
static inline V v_rest(V x, M *quarter) {{
  V turned = x * 0.6366197723675814 + ROUND, n = turned - ROUND;
  *quarter = (M)turned;
  return ((x - n * 1.5707963267948966) - n * 6.123233995736766e-17) + n * 1.4973849048591698e-33;
}}
static inline V v_wave(V x, M quarter) {{
  V z = x * x, s = x + x * z * {_horner("z", _SIN)}, c = 1 + z * (-0.5 + z * {_horner("z", _COS)});
  return (V)((M)v_pick((quarter & 1) != 0, c, s) ^ (quarter << 62 & SIGN));
}}
static inline V v_sin(V x) {{ M quarter; V rest = v_rest(x, &quarter); return v_wave(rest, quarter); }}
static inline V v_cos(V x) {{ M quarter; V rest = v_rest(x, &quarter); return v_wave(rest, quarter + 1); }}
static inline V v_tanh(V x) {{
  V size = v_min(K(20.0), v_fabs(x)), doubled = size * 2.8853900817779268 + ROUND, n = doubled - ROUND;
  V r = (size - n * 0.34657359027997264) - n * 1.1595234069231498e-17, p = r * (2 + r * {_horner("r", _EXP)});
  V power = (V)((M)K(1.0) + ((M)doubled << 52)), less = power * p + (power - 1);
  return (V)((M)(less / (less + 2)) | ((M)x & SIGN));
}}
static inline V v_atan2(V y, V x) {{
  V ahead = v_fabs(x), aside = v_fabs(y);
  V t = v_min(ahead, aside) / v_max(K(2.2250738585072014e-308), v_max(aside, ahead)), z = t * t;
  V a = t + t * z * {_horner("z", _ATAN)};
  a = v_pick(aside > ahead, 1.5707963267948966 - a, a);
  a = v_pick((M)x < 0, 3.141592653589793 - a, a);
  return (V)((M)a | ((M)y & SIGN));
}}
"""


def head(wanted: Target) -> str:
    """Common beginning of all C sources: the vector type of the target and its functions."""
    lines = [f"#define W {wanted.lanes}", _HEAD]
    for name in (*_ONE, *_TWO):
        operands, letters, each = (1, "v", "EACH") if name in _ONE else (2, "vv", "EACH2")
        if wanted.fused and name in _WRITTEN_OUT:
            continue
        if wanted.prefix:
            called = f"{wanted.prefix}{letters}_{name}"
            lines.append(f"V {called}({', '.join(['V'] * operands)});\n#define v_{name} {called}")
        else:
            lines.append(f"static inline V v_{name}({', '.join(['V x', 'V y'][:operands])}) {{ {each}({name}) }}")
    return "\n".join([*lines, _INLINE if wanted.fused else ""])
