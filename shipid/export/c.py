"""Text of C99: names, strings, comments and tables that every exported source is made of."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from shipid.errors import visible
from shipid.export.blocks import Precision
from shipid.vessel.load import Vessel

Array = np.ndarray
NEARBY = [  # of the header in single precision
    "Single precision: give north and east from a point nearby. In coordinates of a map, such as 7,000,000 m, the next",
    "number is 0.5 m away.",
]
WORDS = frozenset(
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
    begin_filters begin_within first_turn follow free_memory get_memory go_filters guid identifier is_ours kind_of kinds
    nearest_turn no no_band predict_from radius_of refuse same_turn say self set start_values sum_of t va_list
    """.split()
)
"""Keywords of C99, C23 and C++20, names of C's library and headers and of the sources themselves.

A file of such a name would not compile."""


@dataclass(frozen=True)
class Files:
    """The files: name of a file -> its text; `name` begins every public name in C."""

    name: str
    texts: dict[str, str]


def c_name(text: str) -> str:
    """A name for C from any text: letters, digits and _, with a letter first."""
    name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_").lower() or "model"
    taken = name in WORDS or name.endswith("_t") or re.fullmatch(r"f\d+(_.*)?", name)  # types of POSIX; functions
    return f"m_{name}" if taken or name[0].isdigit() else name


def strings(values: Sequence[str]) -> str:
    """C strings in UTF-8, one a line; all but plain characters as octal numbers of three digits."""
    return ",\n    ".join(f'"{"".join(map(_escaped, value.encode("utf-8", "replace")))}"' for value in values) or "0"


def _escaped(byte: int) -> str:
    return chr(byte) if 32 <= byte < 127 and chr(byte) not in '"\\?' else f"\\{byte:03o}"


def comment(lines: Sequence[str]) -> str:
    """A C comment; what is not printable is written out: compilers refuse letters that turn the direction of a line."""
    kept = [visible(line).replace("*/", "* /").replace("/*", "/ *") for line in lines]
    return "\n".join(["/*", *(f" * {line}".rstrip() for line in kept), " */"])


def source_head(name: str, precision: Precision) -> str:
    """The first lines of a source: what it includes, its type of numbers, and M, which names the functions of libm."""
    suffix = "name ## f" if precision.single else "name"
    return f"""#include "{name}.h"

#include <math.h>
#include <string.h>

#if (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__) || defined _M_FP_FAST
#error "compile without -ffast-math, -Ofast and /fp:fast: they take out the checks of values that are not finite"
#endif

typedef {name}_real real;
#define M(name) {suffix}
"""


def array_of(kind: str, name: str, size: int, body: str) -> str:
    """A constant array in C; one of a single 0 where it has no entry, as C has no empty arrays."""
    return f"const {kind} {name}[{max(1, size)}] = {{{body or '0'}}};"


def tables_of_names(prefix: str, group: str, names: Sequence[str], unit: Mapping[str, str]) -> tuple[str, str]:
    """Declarations and definitions of the names and units of a group."""
    count = max(1, len(names))
    declared, defined = [], []
    for what, texts in (("names", list(names)), ("units", [unit[name] for name in names])):
        declared.append(f"extern const char *const {prefix}_{group}_{what}[{count}];")
        defined.append(f"const char *const {prefix}_{group}_{what}[{count}] = {{\n    {strings(texts)}}};")
    return "\n".join(declared), "\n".join(defined)


def refusals(parameters: Sequence[str], vessel: Vessel | None, result: str) -> list[str]:
    """Lines of C that return a result where a parameter that must be above 0 is not; none where there is none."""
    above_zero = frozenset() if vessel is None else vessel.above_zero
    places = [str(place) for place, name in enumerate(parameters) if name in above_zero]
    if not places:
        return []
    return [
        f"static const int above_zero[{len(places)}] = {{{', '.join(places)}}};",
        f"for (i = 0; i < {len(places)}; ++i) if (!(parameters[above_zero[i]] > 0)) return {result};",
    ]


def provenance_lines(what: Mapping[str, Any]) -> list[str]:
    """Plain lines of what is known of an origin, for a comment."""
    lines = []
    for key, value in what.items():
        text = json.dumps(value, default=str, ensure_ascii=True)
        lines.append(f"{key}: {text if len(text) <= 400 else text[:400] + ' ...'}")
    return lines
