"""The vector type of generated C, and the functions on it: each lane holds the number of one sample.

sin, cos, tanh and atan2 are written out where the processor multiplies and adds in one instruction: a call of a
library would move all registers to memory and back. Their polynomials are Chebyshev approximations of the functions
that `Precision` names; tests/engine/test_vectors.py allows 4 units in the last place.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipid.engine.tables import PermutedLookup, TableLookup


@dataclass(frozen=True)
class Precision:
    """Numbers of a precision, and what the written-out functions need for it.

    real, integer : C types of one size. letter : of functions of libm. packed : of vector instructions. bits, mantissa
    : of a number. least : the smallest normal number. one : from here on tanh is 1.
    quarter : pi/2 as a sum of three numbers; half : log(2)/2 as a sum of two.
    sin : (sin(x) / x - 1) / x^2 in x^2, |x| <= pi/4. cos : (cos(x) - 1 + x^2 / 2) / x^4, the same.
    exp : (exp(2 x) - 1 - 2 x) / x^2 in x, |x| <= log(2) / 4. atan : (atan(x) / x - 1) / x^2 in x^2, |x| <= 1.
    """

    real: str
    integer: str
    letter: str
    packed: str
    bits: int
    mantissa: int
    least: float
    one: float
    quarter: tuple[float, float, float]
    half: tuple[float, float]
    sin: Sequence[float]
    cos: Sequence[float]
    exp: Sequence[float]
    atan: Sequence[float]

    @property
    def dtype(self) -> np.dtype[np.floating[Any]]:
        """NumPy's type of these numbers."""
        return np.dtype(f"f{self.bits // 8}")


DOUBLE = Precision(
    real="double",
    integer="long long",
    letter="",
    packed="pd",
    bits=64,
    mantissa=52,
    least=2.2250738585072014e-308,
    one=20.0,
    quarter=(1.5707963267948966, 6.123233995736766e-17, -1.4973849048591698e-33),
    half=(0.34657359027997264, 1.1595234069231498e-17),
    sin=(
        -0.16666666666666666, 0.008333333333330948, -0.00019841269836756774, 2.7557316101617874e-06,
        -2.505113165023518e-08, 1.5918115263265974e-10,
    ),
    cos=(
        0.041666666666666664, -0.0013888888888887398, 2.480158729876456e-05, -2.7557317271145144e-07,
        2.087614614655861e-09, -1.1382623647474604e-11,
    ),
    exp=(
        2.0000000000000004, 1.3333333333333335, 0.6666666666659861, 0.26666666666656197, 0.08888888907016779,
        0.02539682542470863, 0.00634918945176432, 0.0014109321451518497, 0.0002828297056809958,
        5.1405589494805136e-05,
    ),
    atan=(
        -0.3333333333333333, 0.1999999999999753, -0.14285714285384132, 0.11111111093490827, -0.09090908590891934,
        0.07692298971033217, -0.06666564699289104, 0.05881506877793656, -0.052579733342841106, 0.04737749579527779,
        -0.04260356632601652, 0.03749486812535247, -0.031277189066996385, 0.023696731580048622,
        -0.015535152475414177, 0.008368931178450162, -0.0034958859739163094, 0.0010496035084968515,
        -0.00019996189377901382, 1.806195461861215e-05,
    ),
)  # fmt: skip
SINGLE = Precision(
    real="float",
    integer="int",
    letter="f",
    packed="ps",
    bits=32,
    mantissa=23,
    least=1.1754943508222875e-38,
    one=10.0,
    quarter=(1.5707963705062866, -4.371138828673793e-08, -1.7151245100058819e-15),
    half=(0.3465735912322998, -9.523271060629668e-10),
    sin=(-0.166666642, 0.00833274703, -0.00019587639),
    cos=(0.0416666642, -0.00138883013, 2.45476895e-05),
    exp=(2.0, 1.3333261, 0.666664839, 0.267623454, 0.0891280025),
    atan=(
        -0.333333313, 0.199997395, -0.142785683, 0.110337645, -0.0865688026, 0.0625016913, -0.0358715393,
        0.0135077713, -0.00238699722,
    ),
)  # fmt: skip


@dataclass(frozen=True)
class CompilerTarget:
    """Target of the C compiler: lanes of a vector, compiler flags, prefix of glibc's vector functions (or empty).

    fused : the processor has one instruction for a * b + c. precision : of all numbers.
    """

    lanes: int
    flags: tuple[str, ...] = ()
    prefix: str = ""
    fused: bool = False
    precision: Precision = DOUBLE

    @property
    def lookup(self) -> TableLookup | None:
        """How tables are looked up; None without the written-out functions."""
        if self.lanes * self.precision.bits == 512:
            return PermutedLookup(self.lanes, self.precision.packed)
        return TableLookup(self.lanes) if self.fused else None


_ONE, _TWO = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log"), ("pow", "atan2")
_WRITTEN_OUT = ("sin", "cos", "tanh", "atan2")


def _vector_types(of: Precision, lanes: int) -> str:
    """The vector type V of REAL, the type M of its comparisons, U as it lies in memory, and their simple functions."""
    size = of.bits // 8
    return f"""
#include <math.h>
#define W {lanes}
typedef {of.real} REAL;
typedef REAL V __attribute__((vector_size({size} * W)));
typedef {of.integer} M __attribute__((vector_size({size} * W)));
typedef REAL U __attribute__((vector_size({size} * W), aligned({size}), may_alias));
#define K(x) ((V){{}} + (REAL)(x))
#define SIGN ((M)-(V){{}})
#define NUMBER(m) ((V)((m) & (M)K(1)))
#define EACH(f) V r; for (int i = 0; i < W; ++i) r[i] = f(x[i]); return r;
#define EACH2(f) V r; for (int i = 0; i < W; ++i) r[i] = f(x[i], y[i]); return r;
static inline V v_fabs(V x) {{ return (V)((M)x & ~SIGN); }}
static inline V v_sqrt(V x) {{ EACH(__builtin_sqrt{of.letter}) }}
static inline V v_floor(V x) {{ EACH(__builtin_floor{of.letter}) }}
static inline V v_ceil(V x) {{ EACH(__builtin_ceil{of.letter}) }}
#ifdef __AVX__ // one instruction, that compilers do not find
#define PICK(name, relation) V r; __asm__(name " %2, %1, %0" : "=v"(r) : "v"(x), "vm"(y)); return r;
#else
#define PICK(name, relation) M m = x relation y; return (V)((m & (M)x) | (~m & (M)y));
#endif
static inline V v_min(V x, V y) {{ PICK("vmin{of.packed}", <) }} // y if one is not a number
static inline V v_max(V x, V y) {{ PICK("vmax{of.packed}", >) }}
"""


def _polynomial_in_c(variable: str, coefficients: Sequence[float]) -> str:
    """A polynomial as C, the constant first, by Estrin's scheme: few of its operations wait for one another."""
    if len(coefficients) == 1:
        return f"K({coefficients[0]!r})"
    half = 1 << (len(coefficients) - 1).bit_length() - 1
    low, high = (_polynomial_in_c(variable, part) for part in (coefficients[:half], coefficients[half:]))
    return f"({low} + {_power_in_c(variable, half)} * {high})"


def _power_in_c(variable: str, exponent: int) -> str:
    """A power of two of a variable as C."""
    root = variable if exponent == 1 else _power_in_c(variable, exponent // 2)
    return root if exponent == 1 else f"({root} * {root})"


def _written_functions(of: Precision) -> str:
    """The functions that are written out, as C.

    Adding 1.5 * 2^mantissa rounds to an integer, which is then in the low bits. sin, cos: arguments beyond 10^9 (single
    precision: 10^4) lose digits. tanh: (e - 1) / (e + 1), e = exp(2 |x|) as 2^n (1 + p). atan2: of the smaller over the
    larger, then turned; two infinite arguments give no number.
    """
    first, second, third = of.quarter
    whole, rest = of.half
    return f"""
#define ROUND {1.5 * 2.0**of.mantissa!r}
static inline V v_pick(M m, V x, V y) {{ return (V)((m & (M)x) | (~m & (M)y)); }}
static inline V v_rest(V x, M *quarter) {{
  V turned = x * K({1 / first!r}) + K(ROUND), n = turned - K(ROUND);
  *quarter = (M)turned;
  return ((x - n * K({first!r})) - n * K({second!r})) - n * K({third!r});
}}
static inline V v_wave(V x, M quarter) {{
  V z = x * x, s = x + x * z * {_polynomial_in_c("z", of.sin)}, c = K(1) + z * {_polynomial_in_c("z", (-0.5, *of.cos))};
  return (V)((M)v_pick((quarter & 1) != 0, c, s) ^ (quarter << {of.bits - 2} & SIGN));
}}
static inline V v_sin(V x) {{ M quarter; V rest = v_rest(x, &quarter); return v_wave(rest, quarter); }}
static inline V v_cos(V x) {{ M quarter; V rest = v_rest(x, &quarter); return v_wave(rest, quarter + 1); }}
static inline V v_tanh(V x) {{
  V size = v_min(K({of.one!r}), v_fabs(x)), doubled = size * K({1 / whole!r}) + K(ROUND), n = doubled - K(ROUND);
  V r = (size - n * K({whole!r})) - n * K({rest!r}), p = r * {_polynomial_in_c("r", (2.0, *of.exp))};
  V power = (V)((M)K(1) + ((M)doubled << {of.mantissa})), less = power * p + (power - K(1));
  return (V)((M)(less / (less + K(2))) | ((M)x & SIGN));
}}
static inline V v_atan2(V y, V x) {{
  V ahead = v_fabs(x), aside = v_fabs(y);
  V t = v_min(ahead, aside) / v_max(K({of.least!r}), v_max(aside, ahead)), z = t * t;
  V a = t + t * z * {_polynomial_in_c("z", of.atan)};
  a = v_pick(aside > ahead, K(1.5707963267948966) - a, a);
  a = v_pick((M)x < 0, K(3.141592653589793) - a, a);
  return (V)((M)a | ((M)y & SIGN));
}}
"""


def vector_source(wanted: CompilerTarget) -> str:
    """Common beginning of all C sources: the vector type of the target and its functions."""
    lines = [_vector_types(wanted.precision, wanted.lanes)]
    for name in (*_ONE, *_TWO):
        operands, letters, each = (1, "v", "EACH") if name in _ONE else (2, "vv", "EACH2")
        if wanted.fused and name in _WRITTEN_OUT:
            continue
        scalar = f"{name}{wanted.precision.letter}"
        if wanted.prefix:
            called = f"{wanted.prefix}{letters}_{scalar}"
            lines.append(f"V {called}({', '.join(['V'] * operands)});\n#define v_{name} {called}")
        else:
            lines.append(f"static inline V v_{name}({', '.join(['V x', 'V y'][:operands])}) {{ {each}({scalar}) }}")
    return "\n".join([*lines, _written_functions(wanted.precision) if wanted.fused else ""])
