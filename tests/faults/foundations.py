"""Rows of the campaign: simulators of others that misbehave: FMUs, functions, tables of predictions; and packages."""

from __future__ import annotations

import io
import random
import re
import shutil
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd

from shipid.errors import ShipidError
from shipid.foundations.fmu import SimulatorFmu
from shipid.foundations.function import FUNCTIONS
from shipid.hybrid.methods import METHODS
from shipid.logs.guess.sniff import recognise_log
from shipid.logs.readers import READERS, read_log_table
from shipid.physics import TERMS
from shipid.plugins import REGISTRIES, installed_entries
from shipid.study.plan import Plan, read_plan
from shipid.study.prepare import PreparedStudy, obtain_runs, prepare
from shipid.study.windows import windows
from tests.faults.documents import BAD
from tests.faults.folders import child
from tests.faults.mutations import MUTATIONS
from tests.faults.recordings import damaged
from tests.faults.trials import Failure
from tests.foundations.foreign import SOURCE, build_ship, motion_of_ship, write_table
from tests.foundations.ships import gunnerus, simulated_table, study_file

STEP, HORIZON, LIMIT = 0.5, 20, 1.0  # s, steps, s that a run of an FMU may take
IN_A_STEP = [
    *("return 1;", "return 2;", "return 3;", "return 4;", "return 99;", "exit(0);", "exit(7);", "abort();"),
    *("*(volatile int *)0 = 1;", "for (;;) continue;", "raise(9);", "raise(19);", "fclose(stdout);", "close(1);"),
    *("x[X] = NAN;", "x[Y] = INFINITY;", "x[SURGE] = 1e300;", "x[X] += 1e9;", "x[YAW] = 1e17;", "x[RATE] = -1e-320;"),
    *('for (i = 0; i < 200000; ++i) printf("%s", "no end of it ");', 'printf("\\033[2J\\033[31m\\n"); return 3;'),
    *(
        'printf("\\xff\\xfe\\n"); fflush(stdout); return 3;',
        "usleep(300000);",
        'chdir("/");',
        "s->value[i % COUNT] = x[0];",
    ),
    *(
        "for (i = 3; i < 60; ++i) close(i);",
        "while (malloc(1 << 20)) continue; return 3;",
        "if (fork() == 0) _exit(0);",
    ),
]
AT = [
    "static int step_ship(Ship *s, double h)\n{",
    "static int start_ship(Ship *s)\n{",
    "static int reset_ship(Ship *s)\n{",
]


@cache
def ships() -> Path:
    """A folder with the sound FMU of each version, which other rows of this process copy."""
    folder = Path(tempfile.mkdtemp(prefix="faults-fmu-"))
    for version in (2, 3):
        write_table(build_ship(folder / f"sound{version}.fmu", version), more=f"limit = {LIMIT:g}")
    return folder


def drawn_windows() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """States (S, 6) and orders, name -> (S, K)."""
    draw = np.random.default_rng(3)
    states = draw.uniform([-500, -500, -7, 2, 0, -0.02], [500, 500, 7, 6, 0, 0.02], (3, 6))
    states[:, 4] = -8.0 * states[:, 5]
    low, high = {"rudder.delta": -0.4, "propeller.n": 1.0}, {"rudder.delta": 0.4, "propeller.n": 4.0}
    return states, {name: draw.uniform(low[name], high[name], (3, HORIZON)) for name in low}


def fmu(seed: int) -> None:
    """An FMU whose code, description, archive or table is wrong: refused, or its runs are lost with a line for each."""
    rng = random.Random(f"fmu {seed}")
    version = rng.choice([2, 3])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, table = folder / "ship.fmu", folder / "ship.toml"
        shutil.copyfile(ships() / f"sound{version}.fmu", file)
        table.write_text((ships() / f"sound{version}.toml").read_text().replace(f"sound{version}.fmu", "ship.fmu"))
        kind = rng.choice(["code", "code", "code", "part", "part", "archive", "table"])
        if kind == "code":
            _other_code(file, version, rng)
        elif kind == "part":
            _other_part(file, rng)
        elif kind == "archive":
            file.write_bytes(damaged(file.read_bytes(), rng))
        else:
            for _ in range(rng.choice([1, 1, 2])):
                changed = rng.choice(MUTATIONS)(table.read_text(errors="replace"), rng)
                table.write_bytes(changed if isinstance(changed, bytes) else changed.encode())
        before = sorted(folder.iterdir())
        states, orders = drawn_windows()
        with _no_files_left(folder, before):
            one = SimulatorFmu.read(str(table), folder, True)[0]
            motion, faults = one.simulate(states, orders, STEP)
        if motion.shape != (3, HORIZON + 1, 6):
            raise Failure("mixed", f"{kind}: motion of shape {motion.shape}")
        for line in faults:
            if line and (not line.isprintable() or len(line) > 500):
                raise Failure("no line", kind, repr(line[:300]))
        if kind == "code" and not any(faults):
            sound = motion_of_ship(states, orders, STEP)
            same = np.isclose(motion[:, 1:], sound, rtol=0, atol=1e-6).all(axis=(1, 2))
            if not same.all() and not re.search(
                r"x\[|value\[|return 1;|\bi % COUNT", file.with_suffix(".txt").read_text()
            ):
                raise Failure("mixed", "other motion without a word", file.with_suffix(".txt").read_text())


@contextmanager
def _no_files_left(folder: Path, before: list[Path]) -> Iterator[None]:
    yield
    if left := [one.name for one in sorted(folder.iterdir()) if one not in before]:
        raise Failure("left over", *left)


def _other_code(file: Path, version: int, rng: random.Random) -> None:
    """Compile the ship with a line that misbehaves at the start, at a reset or from the sixth second on."""
    line, place = rng.choice(IN_A_STEP), rng.choice([*AT[:1] * 4, *AT[1:]])
    late = "s->time > 5" if place == AT[0] and rng.random() < 0.7 else "1"
    words = f"\n    {{ double *x = s->value; int i = 0; (void)x; (void)i; if ({late}) {{ {line} }} }}"
    text = SOURCE.read_text().replace(place, place + words)
    other = file.parent / "other" / "source.c"
    other.parent.mkdir()
    other.write_text("#include <unistd.h>\n#include <signal.h>\n" + text)
    with patch("tests.foundations.foreign.SOURCE", other):
        build_ship(other.with_name("ship.fmu"), version)
    shutil.copyfile(other.with_name("ship.fmu"), file)
    shutil.rmtree(other.parent)
    file.with_suffix(".txt").write_text(f"{place} {late} {line}")


def _other_part(file: Path, rng: random.Random) -> None:
    """Damage the description or the library of an FMU, leave one out, or give parts names that lead out of it."""
    with zipfile.ZipFile(io.BytesIO(file.read_bytes())) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    name = rng.choice(["modelDescription.xml", "modelDescription.xml", next(one for one in parts if one[-3:] == ".so")])
    kind = rng.randrange(6)
    if kind == 0:
        del parts[name]
    elif kind == 1:
        parts["../../outside.txt" if rng.random() < 0.5 else "/tmp/outside.txt"] = b"x"
    elif kind == 2 and name.endswith("xml"):
        text = parts[name].decode()
        old, new = rng.choice(
            [
                ('causality="output"', 'causality="local"'),
                ('variability="fixed"', 'variability="x"'),
                ("CoSimulation", "ModelExchange"),
                ('modelIdentifier="ship"', 'modelIdentifier="../ship"'),
                ('fmiVersion="', 'fmiVersion="9'),
                ('valueReference="', 'valueReference="7'),
                ("<Unit ", "<Units "),
                ('<?xml version="1.0"?>', '<!DOCTYPE a [<!ENTITY b "b"><!ENTITY c "&b;&b;">]>'),
                ('start="', 'start="x'),
                ('valueReference="0"', 'valueReference="4294967295"'),
                ('name="x"', 'name="y"'),
                ("Real", "Integer"),
            ]
        )
        parts[name] = text.replace(old, new).encode()
    else:
        parts[name] = damaged(parts[name], rng)
    with zipfile.ZipFile(file, "w") as archive:
        for one, data in parts.items():
            archive.writestr(one, data)


FAMILIES = '[[family]]\nname = "theirs"\nfunction = "theirs"\n'


@cache
def prepared_soundly() -> tuple[Any, PreparedStudy]:
    """The runs of the tiny study, and what it is prepared to with the sound function."""
    with tempfile.TemporaryDirectory() as folder, patch.dict(FUNCTIONS, {"theirs": gunnerus}):
        plan = _plan_with(Path(folder))
        runs = obtain_runs(plan)
        return runs, prepare(plan, runs)


def _plan_with(folder: Path, families: str = FAMILIES) -> Plan:
    return read_plan(study_file(folder, families), trust=True)


def _raise(error: BaseException) -> None:
    raise error


def function(seed: int) -> None:
    """A function that gives what it must not, raises, or changes what it is given: refused, or nothing else changes."""
    rng = random.Random(f"function {seed}")
    errors: list[BaseException] = [
        *(ValueError("a\nb\x1b[2J"), KeyError(), MemoryError(), RecursionError(), SystemExit(3), StopIteration(7)),
        *(OSError(28, "no space"), UnicodeDecodeError("utf-8", b"\xff", 0, 1, "x")),
        *(AssertionError("x" * 10**6), ArithmeticError(), ShipidError("mine")),
    ]
    results: list[Callable[[np.ndarray], Any]] = [
        *(
            lambda _: None,
            lambda _: "x",
            lambda _: 3.0,
            lambda a: a.tolist(),
            lambda a: a + 0j,
            lambda a: a.astype(object),
        ),
        *(lambda a: a.astype("float32"), lambda a: a[:, :-1], lambda a: a[:-1], lambda a: a[..., :5], lambda a: a.T),
        *(
            lambda a: a[None],
            lambda a: np.ma.masked_array(a, a > 0),
            lambda a: pd.DataFrame(a[:, 0]),
            lambda a: a * np.nan,
        ),
        *(lambda a: np.where(rng.random() < 0.5, a, np.inf), lambda a: a * 1e300, lambda a: a * -1, lambda a: iter(a)),
        *(lambda a: a.astype(str), lambda a: np.zeros_like(a), lambda a: a > 0, lambda a: a + 1e6, lambda a: {"a": a}),
        *(lambda _: _raise(rng.choice(errors)) for _ in range(12)),
        *(lambda a: a for _ in range(6)),
    ]
    change, spoils, calls = rng.choice(results), rng.random() < 0.5, [0]

    def theirs(states: np.ndarray, orders: Any, weather: Any, step: float) -> Any:
        after = gunnerus(states.copy(), {name: one.copy() for name, one in orders.items()}, weather, step)
        calls[0] += 1
        if spoils:
            for one in (states, *orders.values(), *weather.values()):
                one *= 0.0
            orders.clear()
        return change(after)

    runs, sound = prepared_soundly()
    before = runs.frame.copy()
    with tempfile.TemporaryDirectory() as folder, patch.dict(FUNCTIONS, {"theirs": theirs}):
        plan = _plan_with(Path(folder))
        try:
            prepared = prepare(plan, runs)
        finally:
            pd.testing.assert_frame_equal(runs.frame, before)
        for name, values in sound.pool.columns.items():
            if not np.array_equal(values, prepared.pool.columns[name]):
                raise Failure("mixed", f"the function has changed {name}")
        if not np.isfinite(prepared.known["theirs"].test_paths).all():
            raise Failure("mixed", "paths that are no number")


@cache
def table_of_paths() -> pd.DataFrame:
    """What a simulator makes of all windows of the tiny study."""
    with tempfile.TemporaryDirectory() as folder:
        table = '[[family]]\nname = "table"\npredictions = "paths.parquet"\n'
        return simulated_table(windows(study_file(Path(folder), table), every=True)).reset_index(drop=True)


def _other_table(t: pd.DataFrame, rng: random.Random) -> pd.DataFrame:
    """A table with a row or a column that is another, gone, or there twice."""
    name, row = rng.choice(list(t)), rng.randrange(len(t))
    value = rng.choice([np.nan, np.inf, 1e300, "x", None, 0.0, True, pd.Timestamp(0)])
    changes: list[Callable[[], pd.DataFrame]] = [
        lambda: t.drop(columns=name),
        lambda: t.drop(index=t.index[row]),
        lambda: t[:0],
        lambda: t.sample(frac=1.0, random_state=row),
        lambda: pd.concat([t, t[row : row + 2]]),
        lambda: t.assign(**{name: value}),
        lambda: t.assign(**{name: t[name].astype(str)}),
        lambda: t.assign(more="x", **{"\x1b[2J": 1}),
        lambda: t.astype({name: "category" if name == "run" else "float32"}),
        lambda: t.set_index(name),
        lambda: t.assign(ahead=t["ahead"] + 1e-3),
        lambda: t.assign(instant=t["instant"] * 1e9),
        lambda: t.rename(columns={name: name.upper()}),
        lambda: t.assign(**{name: [[1.0]] * len(t)}),
        lambda: t.assign(**{name: t[name].where(t.index != row)}),
    ]
    return rng.choice(changes)()


def predictions(seed: int) -> None:
    """A table of paths with other rows or columns: refused, or what it says is what is taken."""
    rng = random.Random(f"predictions {seed}")
    table = table_of_paths()
    for _ in range(rng.choice([1, 1, 2])):
        with suppress(KeyError, ValueError, TypeError, IndexError):  # an earlier change leaves nothing to change
            table = _other_table(table, rng)
    runs, _ = prepared_soundly()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        table.to_parquet(folder / "paths.parquet")
        if spoilt := rng.random() < 0.2:  # a value of it may then be another, which nobody can know
            file = folder / "paths.parquet"
            file.write_bytes(damaged(file.read_bytes(), rng))
        prepared = prepare(_plan_with(folder, '[[family]]\nname = "table"\npredictions = "paths.parquet"\n'), runs)
        kept = table_of_paths()
        keys = ["run", "instant", "ahead"]
        if {*keys, "north", "east"} <= {*table} and not spoilt:
            whole = table.set_index(keys).sort_index()[["north", "east"]]
            sound = kept.set_index(keys).sort_index()[["north", "east"]]
            if len(whole) == len(sound) and np.array_equal(whole.to_numpy(), sound.to_numpy()):
                want = prepared_soundly()[1].known["theirs"].test_paths
                if not np.allclose(prepared.known["table"].test_paths, want, atol=1e-6):
                    raise Failure("mixed", "the order of rows changes paths")


TERM = "from shipid.physics import Term\n"
METHOD = "from shipid.hybrid.method import Method\n"
READER = "from shipid.logs.formats import Format\nfrom shipid.logs.readers import LogReader\n"
SIGNAL = "from shipid.physics.signals import Signal\nMEMBER = Signal('command', '-', 'x', names='(', usual=(0, 1))"
NAMES = ["odd", "hull.odd", "kernel", "hull.mmg", "text", "u", "a b"]
MODULES = [
    *("MEMBER = 3", "MEMBER = None", "MEMBER = 'x'", "def MEMBER(): ...", "class MEMBER: ...", "1 / 0", "def f(:"),
    *("import no_such", "import sys; sys.exit('at the import')", "MEMBER = [MEMBER]", "\\0", "# coding: no-such"),
    *("def __getattr__(name): raise KeyError(name)", "MEMBER = property(lambda self: 1 / 0)", SIGNAL),
    *(f"{TERM}MEMBER = Term(lambda nu_r, *, C: nu_r)", f"{TERM}MEMBER = Term(abs)", f"{METHOD}MEMBER = Method"),
    f"{METHOD}class MEMBER(Method): ...",
    f"{METHOD}class MEMBER(Method):\n    def fit(self, task): raise ValueError('a\\nb')",
    f"{METHOD}class MEMBER(Method):\n    a: int = 'x'\n    def fit(self, task): return {{}}",
    *(f"{READER}MEMBER = LogReader(Format, lambda *_: {a}, lambda *_: {b})" for a, b in (("1 / 0", "1 / 0"), (3, 7))),
    f"{READER}MEMBER = LogReader(Format, lambda *_: 3, lambda *_: {{'kind': 'odd'}})",
    "def MEMBER(states, orders, weather, step): raise ValueError('a\\nb')",
    "def MEMBER(*a, **b): return 3",
]


def package(seed: int) -> None:
    """An installed package, any of whose members cannot be used: one line where it is named, nothing else changes."""
    rng = random.Random(f"package {seed}")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        place = folder / "odd-1.0.dist-info"
        place.mkdir()
        (place / "METADATA").write_text("Name: odd\nVersion: 1.0\n")
        named = {group: rng.choice(NAMES) for group in REGISTRIES}
        target = rng.choice(
            ["odd_module:MEMBER"] * 6 + ["odd_module", ":", "odd_module:a.b.c", "1:2", "odd_module:MEMBER [x]"]
        )
        text = "\n".join(f"[{group}]\n{one} = {target}" for group, one in named.items())
        (place / "entry_points.txt").write_text(text)  # a damaged one brings down every program
        (folder / "odd_module.py").write_text(rng.choice(MODULES))
        code = child(lambda: _use_package(folder, named, rng))
        if code:
            raise Failure("traceback" if code == 2 else "mixed", f"exit code {code}")


def _use_package(folder: Path, named: dict[str, str], rng: random.Random) -> None:
    import sys

    sys.path.insert(0, str(folder))
    installed_entries.cache_clear()
    for registry in REGISTRIES.values():
        registry.__dict__.pop("offers", None)
    log = folder / "log.csv"
    shutil.copyfile(BAD / "logs" / "good.csv", log)
    study = study_file(folder, f'[[family]]\nname = "odd"\nfunction = "{rng.choice([*named.values(), "odd"])}"\n')
    uses: list[Callable[[], Any]] = [
        *(
            lambda registry=registry, one=one: registry[one]
            for registry in (METHODS, TERMS, READERS)
            for one in named.values()
        ),
        lambda: [registry.load_all() for registry in (METHODS, TERMS, READERS)],
        lambda: recognise_log(log, ()),
        lambda: read_log_table(log, READERS["odd"].options(kind="odd"), "time"),
        lambda: prepare(read_plan(study, trust=True), prepared_soundly()[0]),
        lambda: read_plan(BAD / "studies" / "plain.toml", {"method": [{"name": "a", "kind": "odd"}]}),
    ]
    for use in uses:
        try:
            use()
        except ShipidError as error:
            if not str(error).isprintable() or len(str(error)) > 3000:
                raise Failure("no line", str(error)) from None
        except KeyError as error:
            if str(error).strip("'\"") not in {*named.values(), "odd"}:  # a name that the registry does not have
                raise
    prepare(read_plan(BAD / "studies" / "plain.toml"), prepared_soundly()[0])
