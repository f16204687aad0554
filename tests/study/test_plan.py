"""Plans: bundled studies, changes from the command line, digests, batches."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from shipid import capacity
from shipid import document as documents
from shipid.document import bundled_documents
from shipid.errors import DocumentError
from shipid.hybrid.kernel import Kernel
from shipid.hybrid.methods import METHODS
from shipid.hybrid.path_trained import PathTrained
from shipid.study.declared import NO_MODEL
from shipid.study.plan import (
    _sources,
    build_plan,
    drawn_conditions,
    fitted_families,
    input_files,
    model_label,
    past_steps,
    plain_rival,
    plan_text,
    read_plan,
    run_command,
    verdict_method,
)
from shipid.study.prepare import all_windows, obtain_runs
from shipid.study.schema import Data
from shipid.vessel.load import load_vessel
from tests.study.tiny import mixed_plan, tiny_plan


@pytest.mark.parametrize(
    ("name", "foundations", "alone", "batches"),
    [
        ("calm", 3 + 2 + 1, 0, 3 + 2 + 1),
        ("full-scale", 4 + 1 + 1, 1, 8 * 3),
        ("simulation", 10 + 8 + 1 + 1, 0, 10),
        ("simulation-small", 4 + 2 * 3 + 1 + 1, 3, 3 * 2),
    ],
)
def test_bundled_studies_expand(name: str, foundations: int, alone: int, batches: int) -> None:
    """`alone` counts the foundations that are also judged without a compensator: identified ones."""
    plan = read_plan(name)
    assert (len(plan.foundations), len(plan.batches)) == (foundations, batches)
    assert plan.cells == (foundations + alone + 1) * batches, "and no physics once more, plain"
    assert plain_rival(plan) == "plain"
    assert model_label(plan, NO_MODEL, "plain") == "none + plain"
    bare = [name for name, way in plan.pairs if not way.method.compensates]
    assert len(bare) == alone
    assert {one.family for one in plan.foundations if one.name in bare} == (fitted_families(plan) if alone else set())
    assert [model.name for model in plan.foundations if model.vessel is None] == [NO_MODEL]
    assert plan.study.question.endswith("?")


def test_the_first_instant_comes_after_the_run_up() -> None:
    few = {"truth.manoeuvres": 4, "split.test": 1, "grid.N_D": [2], "truth.step": 0.5}
    plan = read_plan("zigzags", {"truth.run_up": 32.0, **few})
    assert past_steps(plan) == 32
    windows = all_windows(plan, obtain_runs(plan))
    assert (windows.t.min(), windows.t.max()) == (32.0, 32.0 + 59.0)
    assert set(windows.spans.values()) == {(0.0, 32.0 + 59.0 + 15.0)}


def test_orders_and_weather_make_pairs_of_runs_and_nothing_else_does(tmp_path: Path) -> None:
    """Runs of two truths are pairs where all is alike that is drawn before the ship reacts."""
    plan = tiny_plan(tmp_path)
    draws, truth = drawn_conditions(plan), plan.study.truth
    noisy = tiny_plan(tmp_path, {"truth.manoeuvres": 13, "truth.sensors.u.noise": 0.1, "grid.N_D": [5]})
    assert draws == drawn_conditions(noisy)
    sea = {"H_s": 1.0, "T_p": 6.0}
    for key, value in {
        **{"seed": 4, "wind_speed": (1.0, 2.0), "current_speed": (0.2, 0.3), "environment": {"h": 9.0}},
        **{"waves": sea, "gusts": {"z": 5.0}},
    }.items():
        other = plan.study.model_copy(update={"truth": truth.model_copy(update={key: value})})
        with warnings.catch_warnings():  # of values that are no models here
            warnings.simplefilter("ignore")
            assert drawn_conditions(replace(plan, study=other)) != draws, key
    assert drawn_conditions(tiny_plan(tmp_path, {"truth.manoeuvre.0.n_rpm": [60.0, 200.0]})) != draws


def test_inaccurate_family_is_what_was_fixed_beforehand() -> None:
    """The architecture document pins it: higher-order damping removed, N_ur, Y_ur, N_uv times 0.6, nothing else."""
    models = {model.name: model for model in read_plan("full-scale").foundations}
    variant, base = models["inaccurate"].variant, load_vessel("gunnerus-28.9").parameters
    wanted = dict(base)
    for path in base:
        _, _, factors = path.removeprefix("hull.derivatives.").partition("_")
        if path.startswith("hull.derivatives.") and len(re.sub(r"\|", "", factors)) >= 3:
            wanted[path] = 0.0
    for name in ("N_ur", "Y_ur", "N_uv"):
        wanted[f"hull.derivatives.{name}"] *= 0.6
    values = dict(zip(base, variant.parameters, strict=True))
    assert values == pytest.approx(wanted, rel=1e-15)
    assert sum(value == 0.0 for path, value in values.items() if base[path] != 0.0) > 5
    accurate = models["accurate"].variant
    assert accurate.parameters == list(base.values())


def test_the_simulation_study_is_the_grid_of_the_paper() -> None:
    """19 models and the nominal one, N_D = 10, 20, ... 100, 50 trials per cell; the small one is a part of it."""
    full, small = read_plan("simulation"), read_plan("simulation-small")
    assert [batch.N_D for batch in full.batches] == list(range(100, 0, -10))
    assert [way.method for way in full.methods] == [PathTrained(), Kernel(mirror=False)]
    assert full.methods[0].method.trials == 50  # type: ignore[attr-defined]
    assert read_plan("simulation", {"method.0.kind": "kernel"}).methods[0].method == small.methods[0].method == Kernel()
    assert small.study.truth == full.study.truth
    assert small.study.split == full.study.split
    assert small.study.prediction == full.study.prediction
    assert small.study.published == full.study.published
    wide = {model.name: model.variant for model in full.foundations}
    assert all(
        model.variant is None or model.variant.values == wide[model.variant.name].values for model in small.foundations
    )
    nominal = wide["nominal"]
    assert not nominal.values


def test_another_world_has_other_manoeuvres_families_data_and_training(tmp_path: Path) -> None:
    changes = {"grid.seeds": [0, 2]}
    here, there = tiny_plan(tmp_path, changes), tiny_plan(tmp_path, {**changes, "seed": 3})
    assert there.study.truth.seed == here.study.truth.seed + 3000
    assert there.study.split.seed == here.study.split.seed + 3000
    assert sorted({batch.seed for batch in there.batches}) == there.study.grid.seeds == [3000, 3002]
    for one, other in zip(here.foundations, there.foundations, strict=True):
        assert one.name == other.name
        if one.variant and other.variant and one.variant.values:
            assert all(one.variant.values[path] != other.variant.values[path] for path in one.variant.values)
    assert there.digest != here.digest


def test_a_stored_world_is_the_same_world(tmp_path: Path) -> None:
    """The document keeps the seeds as written: they are not shifted again."""
    plan = tiny_plan(tmp_path, {"seed": 2})
    again = tmp_path / "again.toml"
    again.write_text(plan_text(plan))
    assert read_plan(again).study == plan.study
    assert read_plan(again).digest == plan.digest


def test_few_runs_are_drawn_several_times_unless_the_study_names_seeds() -> None:
    """The root of 100 / 10, of 100 / 30 and of 100 / 100; in another world other draws."""
    plan = read_plan("quick", {"seed": 3})
    assert [(batch.N_D, batch.seed % 1000) for batch in plan.batches] == [
        *((100, 0), (30, 0), (30, 1)),
        *((10, seed) for seed in range(3)),
    ]
    assert {batch.seed // 1000 for batch in plan.batches} == {3}
    assert len(read_plan("quick", {"grid.N_D": [1, 100]}).study.seeds_of(1)) == 3, "and no more"
    assert len(read_plan("quick", {"grid.seeds": [7]}).batches) == 3


def test_batches_cover_grid_and_seeds_once(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"grid.N_D": [6, 4, 6], "grid.seeds": [2, 0, 2]})
    assert sorted((batch.N_D, batch.seed) for batch in plan.batches) == [(4, 0), (4, 2), (6, 0), (6, 2)]
    assert len({batch.key for batch in plan.batches}) == 4
    assert plan.cells == 4 * 4


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"grid.ND": [3]}, "grid.ND: --set: unknown key: did you mean 'N_D'"),
        ({"grid.N_D": "3x"}, "grid.N_D: --set: '3x': must be a list"),
        ({"family.0.members": -1}, "--set: "),
        ({"truth": {"vessel": "gunnerus-28.9", "manouvres": 3}}, "truth.manouvres: --set: unknown key"),
    ],
)
def test_a_mistake_of_set_is_not_put_down_to_the_file(changes: dict[str, object], message: str) -> None:
    """Before, the bundled file was named, in which there is no such mistake, and nothing else."""
    with pytest.raises(DocumentError) as caught:
        read_plan("quick", changes)
    assert message in str(caught.value)
    assert str(caught.value).count("--set") == 1


@pytest.mark.parametrize(
    ("changes", "path"),
    [
        ({"grd.N_D": [3]}, "grd.N_D"),
        ({"grid.N_D": [3], "question.x": 1}, "question.x"),
        ({"grid.N_D": [3], "question.x.y": 1}, "question.x.y"),
        ({"family.9.members": 3}, "family.9.members"),
        ({"family.first.members": 3}, "family.first.members"),
        ({"method.0.kind.name": "alone"}, "method.0.kind.name"),
    ],
)
def test_changes_that_reach_nothing_are_reported(tmp_path: Path, changes: dict[str, object], path: str) -> None:
    with pytest.raises(DocumentError, match="--set") as caught:
        tiny_plan(tmp_path, changes)
    assert caught.value.path == path


def test_the_command_of_a_users_method_names_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Mine(Kernel):
        """Of a user: no class of shipid."""

    monkeypatch.setattr("shipid.study.plan.TRIED_FILES", [Path("my files/own.py")])
    assert run_command(tiny_plan(tmp_path)).startswith("shipid study run ")
    monkeypatch.setitem(METHODS, "mine", Mine)
    plan = tiny_plan(tmp_path, {"method": [{"name": "mine", "kind": "mine", "trials": 1, "terms": 4}]})
    assert run_command(plan).startswith(f"shipid --with 'my files/own.py' study run {tmp_path}/tiny.toml --set ")


def test_digest_follows_the_document(tmp_path: Path) -> None:
    plain = tiny_plan(tmp_path)
    assert tiny_plan(tmp_path).digest == plain.digest
    assert tiny_plan(tmp_path, {"truth.seed": 4}).digest != plain.digest
    turned = dict(reversed(plain.document.items()))
    assert build_plan(turned, Path(plain.file)).digest == plain.digest


def test_digest_follows_the_vessel_of_the_truth(tmp_path: Path) -> None:
    document, original = tmp_path / "own.toml", Path(bundled_documents("models")["gunnerus-28.9"]).read_text()
    document.write_text(original)
    before = tiny_plan(tmp_path, {"truth.vessel": "./own.toml"}).digest
    document.write_text(original.replace("L_oa = 31.25", "L_oa = 31.3"))
    assert tiny_plan(tmp_path, {"truth.vessel": "./own.toml"}).digest != before


def test_work_is_cut_where_cells_share_hardly_anything(tmp_path: Path) -> None:
    """Cells that are fitted by themselves are a unit each; networks that train as one stack are one together."""
    plan = read_plan("simulation")
    sizes = [len(unit.pairs) for unit in plan.units]
    assert (len(plan.units), max(sizes), sum(sizes)) == (210, 1, plan.cells)
    assert len({unit.key for unit in plan.units}) == 210
    tiny = tiny_plan(tmp_path)
    assert [unit.key for unit in tiny.units] == [
        f"{name}+kernel-N000{N_D}-s0" for N_D in (6, 4) for name in ("right", "wrong-1", "wrong-2", "none")
    ]
    stacked = read_plan("simulation", {"method.0.layers": 2, "method.0.units": 32})  # one architecture trains as one
    assert [len(unit.pairs) for unit in stacked.units] == [20, 1] * 10


def test_an_identification_is_in_one_unit(tmp_path: Path) -> None:
    """Cells of one identified foundation are together, whatever their methods; every cell is in one unit."""
    plan = mixed_plan(tmp_path)
    for unit in plan.units:
        fitted = {method for foundation, method in unit.pairs if foundation == "fitted"}
        assert fitted in (set(), {"kernel", "trained", "alone"})
    every = [pair for unit in plan.units for pair in unit.pairs]
    assert sorted(every) == sorted((name, way.name) for name, way in plan.pairs)
    assert len({unit.key for unit in plan.units}) == len(plan.units) > 5


def test_every_file_of_a_log_is_part_of_the_study(tmp_path: Path) -> None:
    """A folder of runs, and a further file beside the log: kept results are not taken for those of changed ones."""
    units = {"north": "m", "east": "m", "psi": "rad", "u": "m/s", "v": "m/s", "r": "rad/s"}
    columns = "[columns]\n" + "".join(f'{name} = {{ from = "{name}", unit = "{units[name]}" }}\n' for name in units)
    clock = '[clock]\nfrom = "t"\nunit = "s"\n'
    further = '[file.gps]\npath = "gps.csv"\n[file.gps.clock]\nfrom = "t"\nunit = "s"\n'
    for name, text in (("runs", f'[source]\nruns = "*.csv"\n{clock}{columns}'), ("two", f"{clock}{columns}{further}")):
        (tmp_path / f"{name}.toml").write_text(f'name = "{name}"\nvessel = "a ship"\n{text}')
    (tmp_path / "logs").mkdir()
    for file in ("logs/a.csv", "logs/b.csv", "log.csv", "gps.csv"):
        (tmp_path / file).write_text("t,n,e,h\n0,0,0,0\n")
    for name, log, changed in (("runs", "logs", "logs/b.csv"), ("two", "log.csv", "gps.csv")):
        data = Data(mapping=f"{name}.toml", log=log)
        before = _sources(data, tmp_path / "study.toml")
        (tmp_path / changed).write_text("t,n,e,h\n0,0,1,0\n")
        assert before.keys() == {"mapping", "log"}
        assert before != _sources(data, tmp_path / "study.toml")


def test_the_judged_method_is_the_first_that_learns_beside_physics(tmp_path: Path) -> None:
    drawn = {"kind": "kernel", "trials": 2, "steps": 2, "terms": 4}
    alone = {"name": "plain", "families": ["none"], **drawn}
    still = {"name": "still", "kind": "alone"}
    both = tiny_plan(tmp_path, {"method": [alone, {"name": "kernel", **drawn}]})
    plans = both, tiny_plan(tmp_path, {"method": [alone, still]})
    assert [verdict_method(plan) for plan in plans] == ["kernel", "plain"]


def test_a_digest_says_what_is_in_every_file_that_a_study_reads(tmp_path: Path) -> None:
    """Each part's digest those of its files, the whole one those of all: results are never taken for another log's."""
    vessel = Path(bundled_documents("models")["gunnerus-28.9"]).read_text()
    files = {f"{name}.parquet": name for name in ("first", "second")} | {f"{name}.toml": vessel for name in ("p", "q")}
    document = {
        "question": "What of it?",
        "data": {"dataset": "first.parquet"},
        "split": {"test": ["Z"]},
        "prediction": {"ahead": 15.0, "step": 1.0},
        "grid": {"N_D": [1]},
        "method": [{"name": "alone", "kind": "alone"}],
        "family": [{"name": name, "base": f"{name}.toml"} for name in ("p", "q")],
        "condition": [{"name": "one", "set": {}}, {"name": "two", "set": {"data.dataset": "second.parquet"}}],
    }
    reads = {"one": {"first.parquet", "p.toml", "q.toml"}, "two": {"second.parquet", "p.toml", "q.toml"}}

    def digests(changed: Mapping[str, str]) -> dict[str, str]:
        for name, text in (files | changed).items():
            (tmp_path / name).write_text(text)
        plan = build_plan(document, tmp_path / "study.toml")
        assert {str(tmp_path / name) for name in files} <= set(map(str, input_files(plan)))
        again = build_plan(document, tmp_path / "study.toml", plan.vessels, plan.sources)  # as of a stored run
        every = {"": plan.digest, **{name: part.plan.digest for name, part in plan.parts.items()}}
        assert every == {"": again.digest, **{name: part.plan.digest for name, part in again.parts.items()}}
        return every

    before = digests({})
    for name in files:
        other = "other" if name.endswith(".parquet") else vessel.replace("L_oa = 31.25", "L_oa = 31.3")
        assert other != files[name]
        now = digests({name: other})
        assert now[""] != before[""]
        assert {part for part in reads if now[part] != before[part]} == {part for part in reads if name in reads[part]}


NONSENSE: dict[str, Any] = {
    "truth.manoeuvre.0.alpha_deg": [-50.0, 1e20],
    "truth.manoeuvre.0.n_rpm": [50.0, 1e9],
    "truth.step": 1e-9,
    "truth.duration": 1e9,
    "truth.wind_speed": [0.0, 500.0],
    "prediction.interval": 1e-9,
    "method.0.trials": 10**9,
    "family.1.perturb.0.factor": [0.5, 1e6],
}


@pytest.mark.parametrize("path", NONSENSE)
def test_nonsense_is_refused_with_the_range_and_the_word(path: str, tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match=r"expected .* if it is meant, write unusual") as caught:
        tiny_plan(tmp_path, {path: NONSENSE[path]})
    assert str(caught.value.path).startswith(documents.path_with_names(tiny_plan(tmp_path).document, path))


def test_what_is_meant_is_taken(tmp_path: Path) -> None:
    plan = tiny_plan(tmp_path, {"truth.wind_speed": [0.0, 500.0], "unusual": ["truth.wind_speed.*"]})
    assert plan.study.unusual == ["truth.wind_speed.*"]


def test_seeds_that_generators_do_not_take(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="at most 2"):
        tiny_plan(tmp_path, {"grid.seeds": [2**32]})


def test_names_that_no_file_can_have(tmp_path: Path) -> None:
    with pytest.raises(DocumentError, match="pattern"):
        tiny_plan(tmp_path, {"family.0.name": "n" * 245})


LONG: dict[str, tuple[dict[str, float], int]] = {  # changes, and bytes of memory that all but this take
    "truth.step": ({"truth.step": 0.01, "truth.interval": 20.0, "truth.duration": 40.0}, 1_000_000),
    "truth.interval": ({"truth.step": 0.5, "truth.interval": 0.5}, 40_000),
}


@pytest.mark.parametrize("path", LONG)
def test_memory_that_cannot_be_had_is_refused_with_its_cause(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    changes, most = LONG[path]
    monkeypatch.setattr(capacity, "usable_memory", lambda: most)
    with pytest.raises(DocumentError, match="GiB of memory, and there are") as caught:
        tiny_plan(tmp_path, changes)
    assert caught.value.path == path
