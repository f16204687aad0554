"""Rows of the campaign: mutated documents, read and used as a user would."""

from __future__ import annotations

import random
import re
import resource
import tempfile
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from typer.testing import CliRunner

from shipid.cli import app
from shipid.engine.rollout import rollout
from shipid.errors import DocumentError
from shipid.export.c_predictor import predictor_files
from shipid.export.c_vessel import vessel_files
from shipid.export.model import build_model
from shipid.logs.importing import import_log
from shipid.logs.mapping import read_mapping
from shipid.study.plan import plan_text, read_plan
from shipid.study.prepare import obtain_runs, prepare
from shipid.study.run import run_unit
from shipid.vessel.dynamics import vessel_dynamics
from shipid.vessel.load import load_vessel
from tests.drawn_ships import drawn_ship
from tests.export.compiled import SANITIZERS, run_example
from tests.export.strange import KINDS, drawn
from tests.faults.mutations import mutated
from tests.faults.trials import Failure
from tests.study.tiny import whole_unit

BAD = Path(__file__).parents[1] / "bad"
MEMORY_ERRORS = "-fsanitize=memory,undefined,local-bounds,nullability"  # of clang: of what was never written, too
SANITIZED = [("gcc", *SANITIZERS), ("clang", *SANITIZERS), ("clang", "-g", MEMORY_ERRORS, SANITIZERS[-1])]
RUNNABLE = 2e5  # steps of a truth, or cells: a larger one is planned only


def study(seed: int) -> None:
    """Plan a mutated study; run a small one as far as its first batch, as it may not fail later."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.toml"
        content, words = mutated("study", seed)
        file.write_bytes(content)
        plan = read_plan(file)
        plan_text(plan)
        truth = plan.study.truth
        if truth is None or plan.cells > 60 or not words.startswith(("plain", "rich")):
            return
        steps = truth.manoeuvres * truth.length / truth.step
        searched = max(getattr(way.method, "trials", 1) * getattr(way.method, "units", 1) for way in plan.methods)
        if steps < RUNNABLE and plan.study.prediction.horizon < 100 and searched < 50:
            prepared = prepare(plan, obtain_runs(plan))
            run_unit(plan, prepared, whole_unit(plan, plan.batches[-1]), "cpu")


def vessel(seed: int) -> None:
    """Load a mutated vessel and let it move one second."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.toml"
        file.write_bytes(mutated("vessel", seed)[0])
        loaded = load_vessel(str(file))
        model = vessel_dynamics(loaded)
        rest = [{name: np.ones(1) for name in names} for names in (model.state, model.commands, model.environment)]
        rollout(loaded, *rest, step=0.5, num_steps=2, engine="casadi")


def mapping(seed: int) -> None:
    """Import a sound log by a mutated mapping."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.toml"
        file.write_bytes(mutated("mapping", seed)[0])
        parsed = read_mapping(file)
        with patch("shipid.logs.catalogue.fetch_log", side_effect=AssertionError):
            import_log(parsed, BAD / "logs" / "good.csv")


def sanitized(seed: int) -> None:
    """The C of a drawn predictor or ship runs under sanitizers of addresses and arithmetic, of GCC or of clang."""
    rng = random.Random(f"sanitized {seed}")
    most = resource.getrlimit(resource.RLIMIT_AS)[1]
    resource.setrlimit(resource.RLIMIT_AS, (most, most))  # sanitizers reserve terabytes
    if seed % 2:
        files = vessel_files(drawn_ship(seed), "ship", rng.choice(["rk4", "euler"]))
    else:
        draws = (drawn(rng.choice(KINDS), rng.randrange(10**6)) for _ in range(100))
        files = predictor_files(
            build_model(next(one for one in draws if one.predictor.physics.observer is None).predictor), "odd"
        )
    name, *options = SANITIZED[seed // 2 % len(SANITIZED)]
    with tempfile.TemporaryDirectory() as folder:
        run_example(files, Path(folder), *options, names=[name])


def chain(seed: int) -> None:
    """Patches on patches, or vessels that extend vessels, in a long chain or a ring."""
    length, ring, word = [1, 5, 80, 1200][seed % 4], seed % 3 == 0, ("base", "extends")[seed // 4 % 2]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in range(length):
            last = "./0.toml" if ring else "gunnerus-28.9"
            other = f"./{number + 1}.toml" if number + 1 < length else last
            (folder / f"{number}.toml").write_text(f'{word} = "{other}"\n')
        load_vessel(str(folder / "0.toml"))


def log(seed: int) -> None:
    """Import a mutated log by a sound mapping."""
    rng = random.Random(f"log {seed}")
    content = bytearray((BAD / "logs" / "good.csv").read_bytes())
    lines = bytes(content).split(b"\n")
    kind = rng.randrange(8)
    if kind == 0:
        content = content[: rng.randrange(len(content))]
    elif kind == 1:
        for _ in range(rng.choice([1, 5, 50])):
            content[rng.randrange(len(content))] = rng.randrange(256)
    elif kind == 2:
        del lines[rng.randrange(len(lines))]
        rng.shuffle(lines)
        content = bytearray(b"\n".join(lines))
    elif kind == 3:
        place = rng.randrange(1, len(lines) - 1)
        cells = lines[place].split(b",")
        values = [
            b"",
            b"nan",
            b"inf",
            b"1e308",
            b"-",
            b"1e400",
            b'"',
            b"\x00",
            b"9" * 5000,
            b"2022-01-01",
            b"\x1b[2J",
            b"1,5",
        ]
        cells[rng.randrange(len(cells))] = rng.choice(values)
        lines[place] = b",".join(cells)
        content = bytearray(b"\n".join(lines))
    elif kind == 4:
        content = bytearray(
            rng.choice([b"", b"\n" * 1000, b"," * 10**6, b"a," * 10**5 + b"\n1\n", b"\xff\xfe" + content])
        )
    elif kind == 5:
        content = content * rng.choice([2, 50])
    elif kind == 6:
        head = lines[0].split(b",")
        head[rng.randrange(len(head))] = rng.choice([b"", head[0], b"\x1b[31m", b"a" * 10**5])
        content = bytearray(b"\n".join([b",".join(head), *lines[1:]]))
    else:
        content = bytearray(content.replace(b",", rng.choice([b";", b"\t", b" ", b"|"])))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "log.csv"
        file.write_bytes(bytes(content))
        import_log(read_mapping(BAD / "logs" / "plain.toml"), file)


def memory(seed: int) -> None:
    """A study that would take more memory than any machine has: refused, with the number that causes it."""
    rng = random.Random(f"memory {seed}")
    changes: dict[str, Any] = {"unusual": ["*"]}
    path, value = rng.choice(
        [
            ("truth.interval", 10.0 ** -rng.randrange(8, 12)),
            ("prediction.interval", 10.0 ** -rng.randrange(10, 13)),
            ("truth.step", 10.0 ** -rng.randrange(9, 12)),
            ("truth.duration", 10.0 ** rng.randrange(11, 14)),
        ]
    )
    changes[path] = value
    if path == "truth.interval":
        changes["truth.step"] = value
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "x.toml"
        file.write_text((BAD / "studies" / "plain.toml").read_text())
        try:
            plan = read_plan(file, changes)
            prepare(plan, obtain_runs(plan))
        except DocumentError as error:
            if "GiB" not in error.message:
                raise Failure("no line of an error", str(error)) from None
            return
        raise Failure("not refused", f"{path} = {value:g}")


VALUES = ["nan", "inf", "-inf", "-1", "0", "-0.0", "1e308", "1e-308", "5e-324", "x", "", "1e400", "9" * 400, "\x1b[2J"]
OPTIONS = {
    "expect": {"--length": "120", "--speed": "7", "--A": "3", "--runs": "12", "--ahead": "2", "--kind": "template"},
    "vessel similar": {
        **{"--length": "90", "--beam": "15", "--draught": "5", "--block": "0.7", "--speed": "6", "--number": "2"},
        "--vessel": "mariner",
    },
}


def options(seed: int) -> None:
    """A question on ships with one to three options that nobody expects: one line, or an answer in numbers."""
    rng = random.Random(f"options {seed}")
    words = rng.choice(list(OPTIONS))
    given = {name: value for name, value in OPTIONS[words].items() if rng.random() < 0.7}
    for name in rng.sample(list(OPTIONS[words]), rng.choice([1, 1, 2, 3])):
        given[name] = rng.choice([*VALUES, str(float(f"{10 ** rng.uniform(-6, 6):.3g}"))])
    result = CliRunner().invoke(app, [*words.split(), *(f"{name}={value}" for name, value in given.items())])
    if result.exception is not None and not isinstance(result.exception, SystemExit):
        raise result.exception
    if result.exit_code == 0 and re.search(r"\b(nan|inf)\b", result.output):
        raise Failure("no number", str(given), result.output[:300])
