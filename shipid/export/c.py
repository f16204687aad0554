"""C99 files: the C that CasADi writes of some functions, and a wrapper of names, units, comments and tables."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from string import Template
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from shipid.errors import escape_unprintable
from shipid.version import __version__

Array = np.ndarray
TAKEN_NAMES = frozenset(
    """
    assert complex ctype errno fenv float inttypes iso646 limits locale main math setjmp signal stdalign stdarg
    stdatomic stdbool stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar wchar wctype
    """.split()
)
"""Names of the headers of C's library, and of the example: files of these names would stand in their place."""


@dataclass(frozen=True)
class SourceFiles:
    """The files: name of a file -> its text; `name` begins every public name in C."""

    name: str
    texts: dict[str, str]


class Wrapper(NamedTuple):
    """Texts of C by hand in which @ stands for the name that begins every public name, and $KEY for a value."""

    header: str
    source: str
    example: str


def source_files(
    name: str,
    about: Sequence[str],
    functions: Mapping[str, ca.Function],
    units: Mapping[str, Mapping[str, str]],
    numbers: Mapping[str, Array],
    wrapper: Wrapper,
    values: Mapping[str, Any],
) -> SourceFiles:
    """Header, source, CasADi's source and an example.

    about : lines of the first comment. functions : called `NAME_casadi_KEY` in C. units : group -> entry -> unit, and
    numbers : name -> array, become public tables. values : of the wrapper, in addition to those of all wrappers.
    """
    generator = ca.CodeGenerator(f"{name}_casadi", {"with_header": False, "avoid_stack": True})
    for key, function in functions.items():
        generator.add(rename_function(function, f"{name}_casadi_{key}"))
    generated = generator.dump()
    sizes = {key: max(map(int, re.findall(rf"\*sz_{key} = (\d+);", generated))) for key in ("arg", "res", "iw", "w")}
    defined = [
        array_of("char *const", f"{name}_{group}_{what}", texts, f"\n    {c_strings(texts)}")
        for group, one in units.items()
        for what, texts in (("names", [*one]), ("units", [*one.values()]))
    ] + [array_of("double", f"{name}_{key}", array, number_list(array)) for key, array in numbers.items()]
    declared = "\n".join(f"extern {one.partition(' = ')[0]};" for one in defined)
    filled: dict[str, Any] = {
        "SIZES": "".join(f"    {name}_NUM_{group.upper()} = {len(one)},\n" for group, one in units.items()),
        "DEFINED": "\n".join(defined),
        "FUNCTIONS": "\n".join(
            f"int {name}_casadi_{key}(const double **arg, double **res, long long *iw, double *w, int mem);"
            for key in functions
        ),
        "ARRAYS": f"const double *arg[{max(9, sizes['arg'])}] = {{0}};\n"
        f"    double *res[{max(4, sizes['res'])}] = {{0}};\n    long long iw[{sizes['iw'] + 1}] = {{0}};",
        "WORK": sizes["w"] + 1,
        **values,
    }

    def fill(text: str) -> str:
        return Template(text.replace("@", name)).substitute(filled)

    guard = f"{name.upper()}_H"
    header = _IN_C.format(f"{declared}\n\n{fill(wrapper.header)}")
    origin = f"/* Written by shipid {__version__}; see {name}.h. */\n"
    return SourceFiles(
        name,
        {
            f"{name}.h": f"{c_comment(about)}\n#ifndef {guard}\n#define {guard}\n\n{header}#endif\n",
            f"{name}.c": origin + fill(_SOURCE_HEAD + wrapper.source),
            f"{name}_casadi.c": _UNUSED_ALLOWED + _IN_C.format(generated),
            "main.c": fill(wrapper.example),
        },
    )


_IN_C = '#ifdef __cplusplus\nextern "C" {{\n#endif\n{}\n#ifdef __cplusplus\n}}\n#endif\n'
# CasADi gives all its functions the same parameters; tools that import an FMU may take a warning for an error.
_UNUSED_ALLOWED = '#if defined __GNUC__\n#pragma GCC diagnostic ignored "-Wunused-parameter"\n#endif\n'

_SOURCE_HEAD = """#include "@.h"

#include <math.h>
#include <string.h>

#if (defined __FINITE_MATH_ONLY__ && __FINITE_MATH_ONLY__) || defined _M_FP_FAST
#error "compile without -ffast-math, -Ofast and /fp:fast: they take out the checks of values that are not finite"
#endif

#ifdef __cplusplus
extern "C" {
#endif
$FUNCTIONS
#ifdef __cplusplus
}
#endif

$DEFINED

static int are_finite(const double *values, int count)
{
    int i;
    for (i = 0; i < count; ++i) if (!isfinite(values[i])) return 0;
    return 1;
}
"""


def rename_function(function: ca.Function, name: str) -> ca.Function:
    """The same function under another name."""
    inputs, options = function.mx_in(), {"is_diff_out": function.is_diff_out()}
    results = function.call(inputs, True, False)
    return ca.Function(name, inputs, results, function.name_in(), function.name_out(), options)


def c_name(text: str) -> str:
    """A name for C and its files from any text: letters, digits and _, with a letter first."""
    name = re.sub(r"\W+", "_", text, flags=re.ASCII).strip("_").lower() or "model"
    return f"m_{name}" if name in TAKEN_NAMES or name.startswith("casadi") or name[0].isdigit() else name


def number_list(values: Array | Sequence[float]) -> str:
    """Literals of an array in a row, without needless zeros."""
    texts = (repr(float(value)).removesuffix(".0") for value in np.ravel(values))
    return ",".join(text.replace("inf", "INFINITY") for text in texts)


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


def array_of(kind: str, name: str, values: Sequence[Any] | Array, body: str | None = None) -> str:
    """A constant array in C; one of a single 0 where it has no entry, as C has no empty arrays."""
    text = ", ".join(map(str, values)) if body is None else body
    return f"const {kind} {name}[{max(1, np.size(values))}] = {{{text or '0'}}};"
