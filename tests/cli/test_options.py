"""Options that several commands share."""

from __future__ import annotations

import functools
import inspect
import json
import operator
import os
import re
import shlex
import shutil
import signal
import sys
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import SimpleNamespace
from typing import Any

import pytest
import typer
import typer.main
from typer.testing import CliRunner

import shipid
from shipid.cli import app
from shipid.cli.options import OUTPUTS, GuardedCommand, check_output
from shipid.document import bundled_documents
from shipid.errors import DocumentError, ShipidError
from shipid.vessel.usv import SmallCraft
from tests.cli.running import BAD, ended, output_of
from tests.study.tiny import TINY


def test_changes_are_toml_or_text() -> None:
    from shipid.cli.options import parse_changes

    assert parse_changes(None) == {}
    assert parse_changes(["grid.N_D=[10, 30]", "method.0.kind=alone", "a=1e-3"]) == {
        "grid.N_D": [10, 30],
        "method.0.kind": "alone",
        "a": 1e-3,
    }
    for wrong in ("grid.N_D", "=3"):
        with pytest.raises(DocumentError, match="write --set path=value"):
            parse_changes([wrong])


def test_a_path_may_hold_a_comparison() -> None:
    from shipid.cli.options import parse_assignments

    assert parse_assignments(["hull.*[order >= 3]=0.2"], "--prior", "paths=0.3") == {"hull.*[order >= 3]": 0.2}


def test_the_command_line_can_be_typed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    from shipid.cli.options import command_line

    monkeypatch.setattr(sys, "argv", ["/usr/bin/shipid", "manoeuvre", "my ship.toml", "zigzag"])
    assert shlex.split(command_line()) == ["shipid", "manoeuvre", "my ship.toml", "zigzag"]


@pytest.mark.parametrize("given", [("zigzag", None), (None, 0.1)])
def test_a_band_needs_a_level(given: tuple[str | None, float | None]) -> None:
    from shipid.cli.options import check_band

    check_band(0.9, *given)
    with pytest.raises(ShipidError, match="give --level too"):
        check_band(None, *given)


@pytest.mark.parametrize(
    "words",
    [
        "predict folder log.parquet --cell x --level 90",
        "aboard log.parquet --predictor x.npz --level 0.9 --adaptive 0",
        "identify otter log.parquet --band 90",
        "replay otter log.parquet --step -1",
        "expect --speed 7 --length -3",
        "expect --length 120 --speed 7 --sea wild",
        "vessel new --length 2 --beam 1 --out x.toml --kind boat",
    ],
)
def test_a_value_out_of_range_is_one_line_that_names_its_option(words: str) -> None:
    code, _, error = ended(*words.split())
    assert (code, error.count("\n")) == (2, 1)
    assert f"Invalid value for '{words.split()[-2]}'" in error


class Reached(Exception):
    """The work of a command would begin."""


LOG = SimpleNamespace(runs=["A1", "A2", "B1"], digest="none")
SHIP = "gunnerus-28.9"
MAPPING, STUDY = (shlex.quote(str(file)) for file in (BAD / "logs" / "plain.toml", TINY))
AFTER = {"out", "as_json", "html", "csv", "log"}
"""Options of what is done with results: other tests read what they make."""
BAND = "--level 0.8 --kind zigzag --adaptive 0.03"
THE_BAND = {"level": 0.8, "kind": "zigzag", "rate": 0.03}
SIZES = {"length": 90.0, "beam": 15.0, "draught": 5.0, "block": 0.6, "speed": 6.0, "rpm": 150.0, "shafts": 2}
SIZES |= {"propeller_diameter": 3.0, "rudder_area": 7.0, "scale": 1.0}
IDENTIFY = (
    f"identify {SHIP} log.parquet --runs A* --test B1 --parameters hull.*,inertia.m --fixed inertia.m --together a,b "
    "--prior hull.*=0.4 --bounds hull.*=[0.5,3] --nuisance current=0.2 --horizon 12 --set weights.u=0.07 "
    "--settings begin.toml --ahead 9 --band 0.8"
)


def is_ship(vessel: Any) -> bool:
    return bool(vessel.key == SHIP)


def is_changed(plan: Any) -> bool:
    return bool(plan.study.grid.N_D == [5])


def are_sizes(given: Any) -> bool:
    kinds = {"propulsor": "propeller-rudder", "ship_type": "tanker", "tunnel_thruster": True}
    return bool(vars(given) == {**SIZES, **kinds})


def are_settings(settings: Any) -> bool:
    lists = {"parameters": ["hull.*", "inertia.m"], "fixed": ["inertia.m"], "together": [["a", "b"]]}
    numbers = {
        "prior": {"hull.*": 0.4},
        "bounds": {"hull.*": [0.5, 3.0]},
        "nuisance": {"current": 0.2},
        "horizon": 12.0,
    }
    given = json.loads(settings.model_dump_json(exclude_defaults=True))
    return bool(given.pop("weights")["u"] == 0.07 and given == {**lists, **numbers, "step": 0.25})


WORK: dict[str, tuple[str, str, Mapping[str, Any]]] = {
    "predict": (
        "shipid.study.apply:predict_log",
        f"predict folder log.csv --cell right --mapping of.toml {BAND}",
        {"folder": Path("folder"), "cell": "right", "log": Path("log.csv"), "mapping": "of.toml", **THE_BAND},
    ),
    "aboard": (
        "shipid.study.aboard:play_aboard",
        f"aboard log.csv --predictor a.npz --mapping of.toml --every 7 {BAND}",
        {"file": Path("a.npz"), "log": Path("log.csv"), "mapping": "of.toml", "every": 7.0, **THE_BAND},
    ),
    "export": (
        "shipid.export.write:export_vessel",
        f"export {SHIP} --to c --out x --integrator euler --name other",
        {"vessel": is_ship, "to": "c", "out": Path("x"), "integrator": "euler", "name": "other"},
    ),
    "export a predictor": (
        "shipid.export.write:export_predictor",
        "export a.npz --to onnx --out x.onnx --single --name other",
        {"predictor": Path("a.npz"), "to": "onnx", "out": Path("x.onnx"), "single": True, "name": "other"},
    ),
    "replay": (
        "shipid.identification.free_run:simulate_free_runs",
        f"replay {SHIP} log.parquet --run A* --ahead 9 --step 0.3 --commands between",
        {
            "runs": ("A1", "A2"),
            "length": 9.0,
            "settings": lambda settings: (settings.step, settings.commands) == (0.3, "between"),
        },
    ),
    "identify": (
        "shipid.identification.outcome:run_identification",
        f"{IDENTIFY} --profile inertia.m --design",
        {"vessel": is_ship, "settings": are_settings, "runs": ["A*"], "held_out": ["B1"], "ahead": 9.0, "band": 0.8}
        | {"profiles": ["inertia.m"], "programme": True},
    ),
    "identify structures": (
        "shipid.study.structures:compare_structures",
        f"{IDENTIFY} --structures 'mmg, cubic' --folds 5",
        {"vessel": is_ship, "settings": are_settings, "runs": ["A*"], "held_out": ["B1"], "ahead": 9.0, "level": 0.8}
        | {"names": ["mmg", "cubic"], "folds": 5},
    ),
    "manoeuvre": (
        "shipid.simulation.measured:measure_standard",
        f"manoeuvre {SHIP} zigzag 15 5 --speed 3 --side port --duration 90 --approach rest",
        {"vessel": is_ship, "name": "zigzag", "angles": [15.0, 5.0], "speed": 3.0, "side": "port", "duration": 90.0}
        | {"approach": "rest"},
    ),
    "simulate": (
        "shipid.study.prepare:obtain_runs",
        f"simulate {STUDY} --set grid.N_D=[5]",
        {"plan": is_changed},
    ),
    "vessel new": (
        "shipid.vessel.template:first_guess",
        "vessel new --propulsor propeller-rudder --ship-type tanker --tunnel-thruster --name Fram --out f.toml "
        + " ".join(f"--{name.replace('_', '-')} {value}" for name, value in SIZES.items()),
        {"given": are_sizes, "name": "Fram"},
    ),
    "vessel new usv": (
        "shipid.vessel.usv:guess_craft",
        "vessel new --kind usv --length 2 --beam 1 --mass 80 --speed 3 --thruster -1,0 --thrust 90 --swivel 30 "
        "--hulls 2 --name Fram --out f.toml",
        {"given": SmallCraft(2.0, 1.0, 80.0, 3.0, ((-1.0, 0.0),), 90.0, 30.0, 2), "name": "Fram"},
    ),
    "data import": (
        "shipid.logs.importing:import_log",
        f"data import {MAPPING} raw.csv --without heading_offset",
        {"file": Path("raw.csv"), "without": ["heading_offset"]},
    ),
    "data import guess": (
        "shipid.logs.guess.columns:guess",
        f"data import --guess raw.csv --names t,x,y --vessel {SHIP} --frame enu",
        {"path": Path("raw.csv"), "names": ("t", "x", "y"), "vessel": is_ship, "frame": "enu"},
    ),
    "data import topics": (
        "shipid.logs.readers:list_topics",
        "data import --topics raw.csv",
        {"file": Path("raw.csv")},
    ),
    "data measures": (
        "shipid.logs.measuring:measure_dataset",
        "data measures log.parquet --manoeuvre zigzag --length 28.9",
        {"dataset": LOG, "kind": "zigzag", "length": 28.9},
    ),
    "data check": ("shipid.data.checks:check_dataset", "data check log.parquet", {"dataset": LOG}),
    "study new": (
        "shipid.study.new:draft_study",
        f"study new --vessel {SHIP} --vessel mariner --data log.parquet --out s.toml",
        {"vessels": [SHIP, "mariner"], "data": Path("log.parquet"), "out": Path("s.toml")},
    ),
    "study screen": (
        "shipid.study.screen:screen",
        f"study screen {STUDY} wrong --members 7 --single --set grid.N_D=[5] --device gpu",
        {"plan": is_changed, "wanted": lambda families: [one.name for one in families] == ["wrong"], "count": 7}
        | {"device": "gpu", "engine": "single"},
    ),
    "study run": (
        "shipid.study.run:run_study",
        f"study run {STUDY} --workers 3 --scheduler tcp://here --set grid.N_D=[5] --shard 3/20 --device gpu",
        {"plan": is_changed, "workers": 3, "scheduler": "tcp://here", "device": "gpu", "shard": (3, 20)},
    ),
    "study resume": (
        "shipid.study.run:run_study",
        "study resume folder --workers 3 --scheduler tcp://here --device gpu",
        {"folder": Path("folder"), "workers": 3, "scheduler": "tcp://here", "device": "gpu"},
    ),
    **{
        f"trust in {words.split(' ')[1]}": ("shipid.study.plan:build_plan", f"{words} --trust", {"trust": True})
        for words in (f"study run {STUDY}", f"study screen {STUDY}")
    },
    "study windows": (
        "shipid.study.windows:windows",
        f"study windows {STUDY} --out w --N_D 6 --seed 3 --with-truth --every --trust --device gpu",
        {"N_D": 6, "seed": 3, "with_truth": True, "every": True, "trust": True, "device": "gpu"},
    ),
    "trust of a document": ("shipid.study.plan:build_plan", f"simulate {STUDY} --trust", {"trust": True}),
    "trust in a folder": ("shipid.study.store:stored_plan", "study resume folder --trust", {"trust": True}),
    "study compare": (
        "shipid.answer.compare:compare",
        "study compare one two --pair drawn=trained --pair a=b",
        {"folders": [Path("one"), Path("two")], "pairs": {"drawn": "trained", "a": "b"}},
    ),
}
"""The function that does the work of a command, words of the command, and what the function must get."""


@pytest.fixture
def ready(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs, folders and devices as if they were there."""
    monkeypatch.chdir(tmp_path)
    Path("begin.toml").write_text("[identify]\nstep = 0.25\n")
    for module in ("answer", "cli", "study"):  # what is imported later would keep a stand-in for good
        for found in iter_modules([str(Path(shipid.__file__).parent / module)], f"shipid.{module}."):
            import_module(found.name)
    stand_ins: dict[str, Callable[..., Any]] = {
        "shipid.study.store:read_predictor": lambda file: file,
        "shipid.data.dataset:read_dataset": lambda *_: LOG,
        "shipid.data.checks:check_dataset": lambda *_: None,
        "shipid.identification.outcome:check_identification": lambda *_, **__: None,
        "shipid.study.structures:check_comparison": lambda *_, **__: None,
        "shipid.identification.segments:too_short": lambda *_: [],
        "shipid.cli.identify:_diagnose_first": lambda *_: None,
        "shipid.engine.engines:check_device": lambda *_: None,
        "shipid.engine.engines:engine_by_name": lambda *_: None,
        "shipid.study.prepare:obtain_runs": lambda *_: LOG,
        "shipid.study.prepare:partition": lambda *_: (),
        "shipid.study.screen:notes_on_windows": lambda *_: [],
        "shipid.study.store:stored_plan": lambda *_: SimpleNamespace(parts={}),
        "shipid.study.plan:program_of": lambda *_: "shipid",
    }
    for place, stand_in in stand_ins.items():
        module, _, name = place.partition(":")
        original = operator.attrgetter(name)(import_module(module))
        monkeypatch.setattr(f"{module}.{name}", functools.wraps(original)(stand_in))


@pytest.mark.parametrize("case", WORK)
@pytest.mark.usefixtures("ready")
def test_every_option_reaches_the_work(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    place, words, expected = WORK[case]
    module, name = place.split(":")
    original, calls = getattr(import_module(module), name), []

    def work(*arguments: Any, **named: Any) -> None:
        calls.append(inspect.signature(original).bind(*arguments, **named).arguments)
        raise Reached

    monkeypatch.setattr(import_module(module), name, work)
    result = CliRunner().invoke(app, shlex.split(words))
    assert isinstance(result.exception, Reached), result.exception or result.output
    for key, value in expected.items():
        got = calls[0].get(key)
        assert value(got) if callable(value) else got == value, (key, got)


def test_every_option_has_such_a_case() -> None:
    words = [shlex.split(words) for _, words, _ in WORK.values()]
    used, commands = {word for some in words for word in some}, {tuple(some[:k]) for some in words for k in (1, 2)}

    def options(command: Any, path: tuple[str, ...]) -> Any:
        for name, inner in getattr(command, "commands", {}).items():
            yield from options(inner, (*path, name))
        if path in commands:
            for one in command.params:
                if one.param_type_name == "option" and one.name not in {*AFTER, "help"}:
                    yield path, one.opts

    known = list(options(typer.main.get_command(app), ()))
    assert len(known) > 60
    assert [one for one in known if not used & set(one[1])] == []


@pytest.mark.parametrize("words", ["vessel list --with my.py", "vessel list --with=my.py", "--with my.py vessel list"])
def test_files_that_are_tried_may_stand_behind_the_command(words: str) -> None:
    status, _, said = ended(*words.split())
    assert (status, said.strip()) == (1, "error: my.py: --with: no such file: on a cluster each machine needs it")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a vessel and a dataset."""
    folder = tmp_path_factory.mktemp("made")
    shutil.copy(bundled_documents("models")["mariner"], folder / "ship.toml")
    words = ["zigzag", "10", "10", "--out", folder / "page.html", "--log", folder / "log.parquet"]
    output_of("manoeuvre", folder / "ship.toml", *words)
    return folder


@pytest.fixture
def there(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(shutil.copytree(made, tmp_path / "there"))
    Path("link.html").symlink_to("ship.toml")
    Path("link.parquet").symlink_to("log.parquet")
    return tmp_path / "there"


@pytest.mark.parametrize(
    "words",
    [
        "manoeuvre ./ship.toml zigzag 20 20 --out ship.toml",
        "manoeuvre ./ship.toml zigzag 20 20 --out link.html",
        "data measures log.parquet --csv log.parquet",
        "data measures log.parquet --csv ../there/log.parquet",
        "data measures link.parquet --csv log.parquet",
        "replay ./ship.toml log.parquet --csv log.parquet",
    ],
)
def test_what_is_read_is_not_written(words: str, there: Path) -> None:
    before = {file.name: file.read_bytes() for file in there.iterdir()}
    status, _, error = ended(*words.split())
    assert status == 1
    assert "is named twice" in error
    assert {file.name: file.read_bytes() for file in there.iterdir()} == before


@pytest.mark.parametrize(
    "words",
    [
        "data import gunnerus-2022 --out a.csv",
        "simulate quick --out a.csv",
        "manoeuvre mariner zigzag 10 10 --log a.csv",
        "manoeuvre mariner zigzag 10 10 --out a.htm",
        "data check log.parquet --html a.htm",
        "aboard log.parquet --predictor a.npz --html a.htm",
        "identify mariner log.parquet --html a.htm",
        "replay mariner log.parquet --out a.htm",
    ],
)
def test_a_dataset_or_page_of_another_ending_is_refused_before_anything_is_read(words: str) -> None:
    file, ending = ("a.csv", ".parquet") if "a.csv" in words else ("a.htm", ".html")
    option = words.split()[-2]
    assert ended(*words.split()) == (1, "", f"error: {file}: {option}: let the name end in {ending}\n")


@pytest.mark.usefixtures("there")
def test_what_cannot_be_written_is_refused_before_anything_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    status, _, error = ended("manoeuvre", "./ship.toml", "zigzag", "20", "20", "--out", "ship.toml/new/a.html")
    assert status == 1
    assert "ship.toml: --out: is a file, not a folder: name another place to write" in error
    monkeypatch.setattr(os, "access", lambda folder, _: Path(folder).name != "locked")
    Path("locked").mkdir()
    for name in ("locked/a.html", "locked/new/a.html"):
        with pytest.raises(ShipidError, match="is in a folder that this user may not write into: name another"):
            check_output(Path(name))
    check_output(Path("new/a.html"))


def test_no_file_of_results_is_written_over(there: Path) -> None:
    """A folder of results, whatever file it is: the seal would say that it was edited."""
    results = there / "results" / "quick"
    for name in ("study.toml", "provenance.json", "cells/a.parquet"):
        (results / name).parent.mkdir(parents=True, exist_ok=True)
        (results / name).write_text("sealed")
    status, _, error = ended("data", "measures", "log.parquet", "--csv", "results/quick/cells/a.parquet")
    assert status == 1
    assert "--csv: belongs to the results of a study" in error
    assert (results / "cells/a.parquet").read_text() == "sealed"


@pytest.mark.parametrize("value", ["inf", "-inf", "nan"])
@pytest.mark.parametrize(
    "words",
    ["data measures log.parquet --length", "replay ./ship.toml log.parquet --step",
     "manoeuvre ./ship.toml stop --speed",
     "aboard log.parquet --predictor cell.npz --every"],
)  # fmt: skip
@pytest.mark.usefixtures("there")
def test_numbers_are_finite(words: str, value: str) -> None:
    status, _, error = ended(*f"{words}={value}".split())
    assert status in (1, 2)  # shipid's, or Typer's, which checks ranges first
    assert re.fullmatch(rf"error: (--\w+: {value}: must be a finite number|Invalid value for '--\w+': .+)\n", error)
    status, _, error = ended("manoeuvre", "./ship.toml", "turning", "--", value)
    assert (status, error) == (1, f"error: ANGLES: {value}: must be a finite number\n")


def test_every_command_is_guarded() -> None:
    """Also one that is added later, if its output has one of the names."""

    def commands(group: object) -> list[object]:
        inner = list(getattr(group, "commands", {}).values())
        return [leaf for one in inner for leaf in commands(one)] if inner else [group]

    leaves = commands(typer.main.get_command(app))
    assert len(leaves) > 20
    assert all(isinstance(one, GuardedCommand) for one in leaves)
    assert {param.name for one in leaves for param in one.params} >= set(OUTPUTS)


def test_ctrl_c_is_one_line_in_every_command(monkeypatch: pytest.MonkeyPatch) -> None:
    def pressed(*_: object) -> None:
        raise KeyboardInterrupt

    def pressed_in_compiled_code(*_: object) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise SystemError("returned a result with an exception set") from None

    for press in (pressed, pressed_in_compiled_code):
        monkeypatch.setattr("shipid.document.bundled_documents", press)
        assert ended("study", "list") == (130, "", "interrupted\n")
