"""Text of C99: names, strings, comments and tables of a wrapper, and the C that CasADi writes of its functions."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from string import Template
from typing import Any

import casadi as ca
import numpy as np

from shipid.errors import escape_unprintable
from shipid.vessel.load import Vessel

Array = np.ndarray
SINGLE_PRECISION_NOTE = [  # of the header in single precision
    "Single precision: give north and east from a point nearby. In coordinates of a map, such as 7,000,000 m, the next",
    "number is 0.5 m away.",
]
RESERVED_WORDS = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while main real
    acos asin atan atan2 cos sin tan acosh asinh atanh cosh sinh tanh exp exp2 expm1 frexp ilogb ldexp log log10 log1p
    log2 logb modf scalbn scalbln cbrt fabs hypot pow sqrt erf erfc lgamma tgamma ceil floor nearbyint rint lrint llrint
    round lround llround trunc fmod remainder remquo copysign nan nextafter nexttoward fdim fmax fmin fma isnan isinf
    isfinite signbit abort abs atexit atof atoi atol atoll bsearch calloc div exit free getenv labs ldiv llabs lldiv
    malloc qsort rand realloc srand strtod strtof strtol system memchr memcmp memcpy memmove memset strcat strchr strcmp
    strcpy strlen strncmp strncpy strstr printf fprintf sprintf snprintf scanf puts putchar getchar perror remove rename
    rewind signal raise time clock gamma j0 j1 jn y0 y1 yn index bool true false complex imaginary linux unix
    and asm bitand bitor catch class compl delete explicit export friend mutable namespace new not operator or private
    protected public template this throw try typeid typename using virtual xor math string
    alignas alignof concept consteval constexpr constinit decltype noexcept nullptr requires static_assert thread_local
    typeof typeof_unqual const_cast dynamic_cast reinterpret_cast static_cast co_await co_return co_yield
    stdin stdout stderr errno assert random select
    above_zero are_finite begin_within choose evaluate follow free_memory get_memory guid identifier is_ours kinds
    past_rows path_at planned_turns predict_from refuse say self set start_values sum_of t va_list
    """.split()
)
"""Keywords of C99, C23 and C++20, names of C's library and headers and of the sources themselves.

A file of such a name would not compile."""


@dataclass(frozen=True)
class SourceFiles:
    """The files: name of a file -> its text; `name` begins every public name in C."""

    name: str
    texts: dict[str, str]


@dataclass(frozen=True)
class NumberPrecision:
    """How C writes numbers: in `double` or in `single` precision."""

    single: bool = False

    @property
    def real(self) -> str:
        """Type of a number in C."""
        return "float" if self.single else "double"

    def number(self, value: float) -> str:
        """A literal that reads back as the value, rounded to the precision."""
        if self.single:
            with np.errstate(over="ignore", under="ignore"):
                value = float(str(np.float32(value)))
        if np.isinf(value):
            return "INFINITY" if value > 0 else "(-INFINITY)"
        return repr(float(value)) + ("f" if self.single else "")

    def table(self, values: Array) -> str:
        """Literals of an array in a row, without needless zeros."""
        return ",".join(self.number(value).removesuffix(".0") for value in np.asarray(values, dtype=float).ravel())


@dataclass(frozen=True)
class GeneratedC:
    """C that CasADi writes of some functions, each called `NAME_casadi_KEY`, and what a wrapper must know of it.

    text : of the file. declared : lines of C that declare the functions, on numbers of the type `real`.
    num_arg, num_res, num_iw, num_w : of the arrays that every call needs.
    """

    text: str
    declared: str
    num_arg: int
    num_res: int
    num_iw: int
    num_w: int

    @property
    def arrays(self) -> str:
        """C that declares the arrays of a call but for its numbers."""
        return (
            f"const real *arg[{self.num_arg}] = {{0}};\n"
            f"    real *res[{self.num_res}] = {{0}};\n    long long iw[{self.num_iw}] = {{0}};"
        )


def generate_c(functions: Mapping[str, ca.Function], name: str, precision: NumberPrecision) -> GeneratedC:
    """CasADi's C of functions, key -> function; what is in it but its public functions has a name of its own."""
    generator = ca.CodeGenerator(
        f"{name}_casadi", {"casadi_real": precision.real, "with_header": False, "avoid_stack": True}
    )
    called = {key: f"{name}_casadi_{key}" for key in functions}
    for key, function in functions.items():
        generator.add(rename_function(function, called[key]))
    declared = "\n".join(
        f"int {one}(const real **arg, real **res, long long *iw, real *w, int mem);" for one in called.values()
    )
    text = generator.dump()
    keys = ("arg", "res", "iw", "w")
    most = (max(1, *(int(size) for size in re.findall(rf"\*sz_{key} = (\d+);", text))) for key in keys)
    return GeneratedC(_AS_C.format(text), _AS_C.format(declared), *most)


_AS_C = '#ifdef __cplusplus\nextern "C" {{\n#endif\n{}\n#ifdef __cplusplus\n}}\n#endif\n'


def rename_function(function: ca.Function, name: str) -> ca.Function:
    """The same function under another name."""
    inputs, options = function.mx_in(), {"is_diff_out": function.is_diff_out()}
    results = function.call(inputs, True, False)
    return ca.Function(name, inputs, results, function.name_in(), function.name_out(), options)


def fill_template(text: str, name: str, values: Mapping[str, str]) -> str:
    """A text in which @ is the name that begins every public name, and $KEY a value."""
    return Template(text.replace("@", name)).substitute(values)


def c_name(text: str) -> str:
    """A name for C from any text: letters, digits and _, with a letter first."""
    name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_").lower() or "model"
    taken = (
        name in RESERVED_WORDS or name.endswith("_t") or name.startswith("casadi")
    )  # types of POSIX; names of CasADi
    return f"m_{name}" if taken or name[0].isdigit() else name


def c_strings(values: Sequence[str]) -> str:
    """C strings in UTF-8, one a line; all but plain characters as octal numbers of three digits."""
    return (
        ",\n    ".join(f'"{"".join(map(_escape_byte, value.encode("utf-8", "replace")))}"' for value in values) or "0"
    )


def _escape_byte(byte: int) -> str:
    return chr(byte) if 32 <= byte < 127 and chr(byte) not in '"\\?' else f"\\{byte:03o}"


def c_comment(lines: Sequence[str]) -> str:
    """A C comment; what is not printable is written out: compilers refuse letters that turn the direction of a line."""
    kept = [escape_unprintable(line).replace("*/", "* /").replace("/*", "/ *") for line in lines]
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in kept), " */"])


SOURCE_HEAD = """#include "@.h"

#include <math.h>
#include <string.h>

#if (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__) || defined _M_FP_FAST
#error "compile without -ffast-math, -Ofast and /fp:fast: they take out the checks of values that are not finite"
#endif

typedef @_real real;
"""
"""First lines of a source; @ stands for the name that begins every public name."""

ARE_FINITE = """static int are_finite(const real *values, int count)
{
    int i;
    for (i = 0; i < count; ++i) if (!isfinite(values[i])) return 0;
    return 1;
}
"""


def array_of(kind: str, name: str, values: Sequence[Any] | Array, body: str | None = None) -> str:
    """A constant array in C; one of a single 0 where it has no entry, as C has no empty arrays."""
    text = ", ".join(map(str, values)) if body is None else body
    return f"const {kind} {name}[{max(1, np.size(values))}] = {{{text or '0'}}};"


def tables_of(
    prefix: str, groups: Mapping[str, Mapping[str, str]], numbers: Mapping[str, Array], precision: NumberPrecision
) -> tuple[str, str]:
    """Declarations and definitions of tables: names and units of groups, entry -> unit, and arrays of numbers."""
    defined = []
    for group, units in groups.items():
        for what, texts in (("names", list(units)), ("units", list(units.values()))):
            defined.append(array_of("char *const", f"{prefix}_{group}_{what}", texts, f"\n    {c_strings(texts)}"))
    for key, values in numbers.items():
        defined.append(array_of(f"{prefix}_real", f"{prefix}_{key}", values, precision.table(values)))
    declared = [f"extern {one.partition(' = ')[0]};" for one in defined]
    return "\n".join(declared), "\n".join(defined)


def places_above_zero(parameters: Sequence[str], vessel: Vessel | None) -> list[int]:
    """Places of the parameters that must be above 0."""
    above_zero = frozenset() if vessel is None else vessel.above_zero
    return [place for place, name in enumerate(parameters) if name in above_zero]


def provenance_lines(what: Mapping[str, Any]) -> list[str]:
    """Plain lines of what is known of an origin, for a comment."""
    texts = {key: json.dumps(value, default=str, ensure_ascii=True) for key, value in what.items()}
    return [f"{key}: {text if len(text) <= 400 else text[:400] + ' ...'}" for key, text in texts.items()]
