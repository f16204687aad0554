"""The whole of an identification: the report agrees with the fit, and a patch is the identified vessel."""

from __future__ import annotations

import math
import os
import signal
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from shipid.data.dataset import Dataset
from shipid.errors import DataError, DocumentError, ShipidError
from shipid.identification import outcome
from shipid.identification.bands import residual_spacing
from shipid.identification.design import Candidate, InformedCandidate, candidate_manoeuvres
from shipid.identification.diagnosis import diagnose
from shipid.identification.fit import Solution
from shipid.identification.free_run import ALL, simulate_free_runs
from shipid.identification.outcome import (
    AFTER,
    BEFORE,
    Identification,
    pick_runs,
    read_settings,
    run_identification,
    write_patch,
)
from shipid.identification.settings import Identify, free_factors
from shipid.identification.solve import identify
from shipid.identification.statistics import fit_statistics
from shipid.vessel.load import Vessel, load_vessel
from tests.identification.trials import changed, noisy, trials

SHIP = load_vessel("gunnerus-28.9")
FEW = ["hull.derivatives.N_ur", "hull.derivatives.N_uv", "hull.derivatives.Y_ur"]
NOISE = {"u": 0.02, "v": 0.02, "r": math.radians(0.1)}


def off() -> Vessel:
    """The ship before it is identified."""
    return SHIP.with_values({path: 0.7 * SHIP.parameters[path] for path in FEW})


def settings(**more: object) -> Identify:
    return Identify(**{"parameters": FEW, "start": "base", "horizon": 0, "weights": NOISE, **more})


@pytest.fixture
def one_manoeuvre(monkeypatch: pytest.MonkeyPatch) -> None:
    """Vessels perform one manoeuvre, where the manoeuvres are not the point."""
    monkeypatch.setattr(outcome, "STARBOARD_TRIALS", {"zigzag 10/10": ("zigzag", (10, 10), "starboard")})


@pytest.fixture(scope="module")
def log() -> Dataset:
    return noisy(trials(SHIP, runs=5, steps=60), NOISE, 3)


@pytest.fixture(scope="module")
def identified(log: Dataset) -> Identification:
    return run_identification(off(), log, settings(), held_out=["M05"], profiles=FEW[:1], programme=True)


def test_a_fit_sees_no_moment_of_a_run_held_out(log: Dataset) -> None:
    """On one clock a run may overlap another one; what it holds there does not matter, and it is said."""
    t = log.frame["t"].where(log.frame["run"] != "M05", log.frame["t"] + 50.0)
    t = t + 1000.0 * log.frame["run"].map({"M01": 0, "M02": 1, "M03": 2, "M04": 3, "M05": 3})
    overlap = log.frame["run"].eq("M04") & (t >= t[log.frame["run"] == "M05"].min())
    metadata = {**log.metadata, "clock": "shared"}
    fits = []
    for factor in (1.0, 1.5):
        frame = log.frame.assign(t=t, r=log.frame["r"].where(~overlap, factor * log.frame["r"]))
        shared = Dataset(frame, metadata)
        apart, runs, warnings = outcome.without_shared(shared, ["M01", "M02", "M03", "M04"], ["M05"])
        fits.append(identify(off(), apart, runs, settings()).factors)
        assert runs == ("M01", "M02", "M03", "M04")
        assert warnings == (
            "run M04 shares 18 % of its rows in time with the runs held out: they take no part in the fit",
        )
    np.testing.assert_array_equal(*fits)
    done = run_identification(off(), shared, settings(), held_out=["M05"])
    np.testing.assert_allclose(done.solution.factors, fits[0])
    assert warnings[0] in done.warnings
    everything = Dataset(log.frame, metadata)  # each run from 0 s on the same clock
    with pytest.raises(DataError, match="every run shares its moments"):
        run_identification(off(), everything, settings(), held_out=["M05"])


def test_a_run_of_a_single_row_is_named_and_left_out(log: Dataset) -> None:
    whole = log.select(["M01", "M02"])
    single = Dataset(pd.concat([whole.frame, log.select(["M03"]).frame.head(1)], ignore_index=True), log.metadata)
    _, runs, warnings = outcome.without_shared(single, single.runs, [])
    assert runs == ("M01", "M02")
    assert warnings == ("run M03 has a single row: it takes no part in the fit",)


def test_it_tells_what_the_parts_tell(identified: Identification, log: Dataset) -> None:
    alone = identify(off(), log, ["M01", "M02", "M03", "M04"], settings())
    assert identified.runs == alone.runs
    assert identified.held_out == ("M05",)
    known = fit_statistics(alone)
    assert np.allclose(identified.estimates["factor"], alone.factors, rtol=1e-6)
    assert np.allclose(identified.estimates["factor_error"], known.errors, rtol=1e-4)
    for row in identified.estimates.to_dict("records"):
        base = off().parameters[row["path"]]
        assert row["base"] == base
        assert row["value"] == pytest.approx(base * row["factor"])
        assert row["error"] == pytest.approx(abs(base) * row["factor_error"])
        assert row["low"] < row["value"] < row["high"]
        assert row["identified"]
        assert row["unit"] == SHIP.units[row["path"]]


def test_the_truth_is_within_and_free_runs_are_better(identified: Identification) -> None:
    for row in identified.estimates.to_dict("records"):  # four standard errors: one in 16,000
        assert abs(row["value"] - SHIP.parameters[row["path"]]) < 4 * row["error"]
    rms = identified.errors[(identified.errors["set"] == "test") & (identified.errors["run"] == ALL)].set_index("model")
    for name, width in NOISE.items():
        assert rms[name][AFTER] == pytest.approx(width, rel=0.5)  # what is left is the noise
    assert rms["position"][AFTER] < 0.5 * rms["position"][BEFORE]
    others = [one for one in identified.warnings if not one.startswith("not in the log, taken as 0: V_w, beta_w")]
    assert "or predictions begin at noisy rows" in others[0]  # as they do here
    assert all("residuals of" in warning or "standard errors" in warning for warning in others)
    assert not identified.unseen


def test_measures_before_and_after_are_those_of_the_vessels(
    identified: Identification, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = identified.manoeuvres
    assert set(table["manoeuvre"]) == {"zigzag 10/10", "zigzag 20/20", "turning 35"}
    monkeypatch.setattr(outcome, "STARBOARD_TRIALS", {"zigzag 10/10": ("zigzag", (10, 10), "starboard")})
    truth = outcome._compare_manoeuvres({BEFORE: off(), AFTER: SHIP})[0]
    both = table[: len(truth)]
    assert list(both["measure"]) == list(truth["measure"])
    assert np.allclose(both["before"], truth["before"])
    assert np.allclose(both["after"], truth["after"], rtol=0.1)
    assert (table["note"] == "").all()
    assert np.isfinite(table["before"]).all()


@pytest.mark.usefixtures("one_manoeuvre")
def test_a_manoeuvre_that_cannot_be_is_a_note() -> None:
    without = Vessel({key: value for key, value in SHIP.document.items() if key != "particulars"}, SHIP.file)
    table = outcome._compare_manoeuvres({BEFORE: without, AFTER: SHIP})[0]
    assert table["before"].isna().all()
    assert np.isfinite(table["after"]).all()
    assert table["note"].str.contains("L_pp").all()


def test_a_patch_is_the_identified_vessel_and_says_where_it_is_from(identified: Identification, tmp_path: Path) -> None:
    base = tmp_path / "base.toml"
    base.write_text('base = "gunnerus-28.9"\n[set]\n' + "".join(f'"{p}" = {off().parameters[p]!r}\n' for p in FEW))
    mine = replace(identified, vessel=load_vessel(str(base)))
    file = write_patch(mine, tmp_path / "new" / "patch.toml")
    again = load_vessel(str(file))
    expected = off().parameters | dict(identified.solution.values)
    assert again.parameters == expected  # bit for bit
    document = tomllib.loads(file.read_text())
    assert document["base"] == "../base.toml"
    provenance = document["provenance"]
    assert provenance["dataset"] == identified.digest
    assert provenance["held_out"] == ["M05"]
    assert provenance["runs"] == list(identified.runs)
    assert provenance["settings"]["weights"]["u"] == NOISE["u"]
    assert provenance["standard_errors"].keys() == set(FEW)
    assert provenance["free_run_rms"].keys() == {"fit before", "fit after", "test before", "test after"}
    assert Identify(**provenance["settings"]) == settings(current=mine.solution.settings.current, nuisance={})
    assert mine.patch(file) == file.read_text()
    with pytest.raises(DataError, match="not written over"):
        write_patch(mine, file)


def test_a_patch_on_a_bundled_vessel_names_it(identified: Identification, tmp_path: Path) -> None:
    assert tomllib.loads(replace(identified, vessel=SHIP).patch(tmp_path / "a.toml"))["base"] == "gunnerus-28.9"


def test_a_patch_holds_what_was_changed_after_the_base_was_read(identified: Identification, tmp_path: Path) -> None:
    """It was refused where it was read: the base was said to have changed."""
    changed = SHIP.with_values({"inertia.m": 1.1 * SHIP.parameters["inertia.m"], FEW[0]: 1.0})
    again = load_vessel(write_patch(replace(identified, vessel=changed), tmp_path / "patch.toml"))
    assert again.parameters == changed.parameters | dict(identified.solution.values)
    other = replace(identified, vessel=SHIP.with_values({"current.kind": "uniform"}))
    with pytest.raises(ShipidError, match="more than numbers of it were changed"):
        write_patch(other, tmp_path / "other.toml")
    assert not (tmp_path / "other.toml").exists()


def test_a_patch_names_estimates_that_contradict_others_and_is_read(identified: Identification, tmp_path: Path) -> None:
    """A force of the rudder ahead of midships, a rudder aft: the patch was written, and refused where it was read."""
    tanker, odd = load_vessel("kvlcc2-l7"), "thruster.rudder.x_H"
    found = replace(identified, vessel=tanker, solution=replace(identified.solution, values={odd: 4.4}))
    again = load_vessel(write_patch(found, tmp_path / "patch.toml"))
    assert again.parameters == tanker.parameters | {odd: 4.4}
    assert again.document["unusual"] == [odd]
    assert "unusual" not in tomllib.loads(identified.patch(tmp_path / "usual.toml"))


def test_the_profile_agrees_with_the_interval(identified: Identification) -> None:
    curve = identified.curves[0]
    row = identified.estimates.set_index("path").loc[curve.path]
    assert curve.path == FEW[0]
    assert curve.low == pytest.approx(row["factor_low"], abs=0.3 * row["factor_error"])
    assert curve.high == pytest.approx(row["factor_high"], abs=0.3 * row["factor_error"])


def test_a_fit_stays_where_manoeuvres_to_run_next_cannot_be_performed(
    log: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before, one that diverged ended the command without a word of the fit."""
    every, some = outcome.design.information_of_candidates, candidate_manoeuvres(SHIP, [3.0])[4:9:4]

    def informed(vessel: Vessel, choice: Sequence[Candidate], *args: Any, **how: Any) -> list[InformedCandidate]:
        if any(one.title.startswith("turning") for one in choice):
            raise ShipidError("she diverges")
        return every(vessel, choice, *args, **how)

    monkeypatch.setattr(outcome, "STARBOARD_TRIALS", {"zigzag 10/10": ("zigzag", (10, 10), "starboard")})
    monkeypatch.setattr(outcome.design, "candidate_manoeuvres", lambda *_: some)
    monkeypatch.setattr(outcome.design, "information_of_candidates", informed)
    done = run_identification(off(), log.select(["M01", "M02"]), settings(parameters=FEW[:1]), programme=True)
    assert done.solution.status == "ok"
    assert len(done.programme)
    assert not done.programme["manoeuvre"].str.startswith("turning").any()
    assert any(line.startswith("not among the manoeuvres to run next") for line in done.warnings)


def test_the_programme_is_ranked(identified: Identification) -> None:
    table = identified.programme
    assert table["per_hour"].is_monotonic_decreasing
    assert (table["after"] <= table["before"]).all()
    assert (table["after"] < table["before"]).iloc[0]
    assert set(table["narrows"]) <= set(FEW)


def test_free_runs_take_what_is_set_for_a_run(log: Dataset) -> None:
    calm = simulate_free_runs({BEFORE: SHIP}, log, ["M01", "M02"], settings()).errors.set_index("run")["u"]
    windy = settings(runs={"M02": {"environment": {"V_w": 15.0}}})
    errors = simulate_free_runs({BEFORE: SHIP}, log, ["M01", "M02"], windy).errors.set_index("run")["u"]
    assert errors["M01"] == calm["M01"]
    assert errors["M02"] != calm["M02"]


def test_a_free_run_that_diverges_is_no_number(log: Dataset) -> None:
    wild = SHIP.with_values({"hull.derivatives.X_u|u|": -100 * SHIP.parameters["hull.derivatives.X_u|u|"]})
    runs = simulate_free_runs({BEFORE: SHIP, AFTER: wild}, log, ["M01"], settings())
    rows = runs.errors[runs.errors["run"] == ALL].set_index("model")
    assert rows.loc[AFTER, ["u", "v", "r", "position"]].isna().all()
    assert np.isfinite(rows["u"][BEFORE])


@pytest.mark.usefixtures("one_manoeuvre")
def test_few_runs_that_may_hide_a_drift_are_warned_of() -> None:
    """White noise; the resistance decides the mean speed, as a drift of the log would."""
    path = "hull.derivatives.X_u|u|"
    log = noisy(trials(SHIP, runs=1, steps=60), NOISE, 3)
    wanted = settings(parameters=[path, FEW[1]], nuisance=["initial_state"])
    warnings = " ".join(run_identification(SHIP, log, wanted).warnings)
    assert "are correlated over" not in warnings
    assert "few runs may hide a slow drift of sensors, wind or current" in warnings
    assert "by these factors: X_u|u| 1." in warnings


@pytest.mark.usefixtures("one_manoeuvre")
def test_coloured_residuals_and_a_short_horizon_are_warned_of(log: Dataset) -> None:
    rng, drift = np.random.default_rng(1), np.zeros(len(log.frame))
    for i in range(1, len(drift)):
        drift[i] = 0.95 * drift[i - 1] + 0.05 * rng.normal()
    mended = changed(log, v=log.frame["v"] + drift)
    identified = run_identification(off(), mended, settings(horizon=20.0), ahead=30.0)
    warnings = " ".join(identified.warnings)
    assert "are correlated over" in warnings
    assert "the horizon of 20 s is short" in warnings
    assert "no run was held out" in warnings


@pytest.mark.usefixtures("one_manoeuvre")
def test_what_was_dropped_has_no_interval_and_says_so(log: Dataset) -> None:
    extra = "hull.derivatives.X_uvv"  # true as it is
    identified = run_identification(off(), log, settings(parameters=[*FEW, extra], drop=3.0))
    rows = identified.estimates.set_index("path")
    assert identified.solution.dropped == (extra,)
    assert rows["value"][extra] == SHIP.parameters[extra]
    assert not rows["identified"][extra]
    assert "dropped" in rows["reason"][extra]
    assert rows["identified"][FEW].all()
    with pytest.raises(ShipidError, match="support a change of any: give a smaller drop"):
        run_identification(SHIP, log, settings(drop=5.0))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"runs": ["M011"]}, "'M011' is no run: did you mean"),
        ({"held_out": ["ZZ*"]}, "'ZZ.' is no run: valid: M01, M02"),
        ({"held_out": ["*"]}, "every run is held out"),
        ({"profiles": ["hull.derivatives.N_u"]}, "is not free in the fit: did you mean"),
        ({"ahead": 1.0}, "must hold two steps"),
        ({"ahead": 500.0}, "no unbroken stretch"),
    ],
)
def test_mistakes_are_reported_before_anything_is_solved(
    more: dict[str, object], message: str, log: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(outcome, "identify", lambda *_, **__: pytest.fail("solved"))
    with pytest.raises(DataError, match=message):
        run_identification(SHIP, log, settings(), **more)  # type: ignore[arg-type]


def test_a_fit_that_fails_is_its_sentence(log: Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    real = identify

    def stopped(*given: object, **more: object) -> Solution:
        return real(*given, **{**more, "progress": lambda count, _: count >= 1})  # type: ignore[arg-type]

    monkeypatch.setattr(outcome, "identify", stopped)
    with pytest.raises(ShipidError, match="stopped after"):
        run_identification(off(), log, settings())


@pytest.mark.usefixtures("one_manoeuvre")
def test_ctrl_c_is_ctrl_c_wherever_it_comes(log: Dataset) -> None:
    """Libraries turn an interrupt into other errors; here it comes while they are at work."""

    def pressed(*_: object) -> None:
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        run_identification(off(), log, settings(), progress=pressed)


def test_patterns_pick_runs_in_the_order_of_the_log(log: Dataset) -> None:
    assert pick_runs(log) == (("M01", "M02", "M03", "M04", "M05"), ())
    assert pick_runs(log, ["M04", "M01"], ["M0[12]", "M05"][1:]) == (("M01", "M04"), ("M05",))
    assert pick_runs(log, ["*"], ["*5", "M01"]) == (("M02", "M03", "M04"), ("M01", "M05"))


def test_settings_are_read_and_changed(tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text('[identify]\nparameters = ["hull.*"]\nhorizon = 20\nweights = {u = 0.1, r = 0.01}\n')
    given = read_settings(file, {"horizon": 0, "weights.u": 0.05})
    assert given.horizon == 0
    assert given.weights == {"u": 0.05, "r": 0.01}
    assert given.parameters == ["hull.*"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[identify]\nhorizont = 3\n", "identify.horizont: unknown key: did you mean 'horizon'"),
        ("[identify]\n", "identify.parameters: missing"),
        ("identify = 3\n", "identify: must be a table"),
        ("[identify\n", "not valid TOML"),
        ('[identify]\nparameters = ["a"]\nhorizon = 1\n', "must hold two steps"),
    ],
)
def test_a_bad_settings_file_is_one_line(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text(text)
    with pytest.raises(DocumentError) as error:
        read_settings(file)
    assert message in str(error.value)
    assert str(error.value).startswith(str(file))


def test_a_change_of_settings_that_reaches_nothing_is_one_line() -> None:
    """Before, `--set horizon.x=1` ended in a traceback."""
    with pytest.raises(DocumentError, match=r"there is no .x.") as error:
        read_settings(None, {"horizon": 20, "horizon.x": 1})
    assert error.value.path == "identify.horizon.x"


def test_a_profile_holds_its_factor_whatever_bounds_it_has(
    identified: Identification, log: Dataset, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its own bounds before those of a pattern took the place of the value held: the profile was flat, and open."""
    bounds = {FEW[0]: (0.2, 5.0), "hull.*": (0.1, 10.0)}
    solution = replace(identified.solution, settings=settings(bounds=bounds))
    tried: list[tuple[float, float]] = []

    def fitted(vessel: Vessel, _data: Dataset, _runs: object, asked: Identify, **_: object) -> Solution:
        limits = free_factors(vessel, asked)
        here = limits.paths.index(FEW[0])
        tried.append((float(limits.low[here]), float(limits.high[here])))
        return replace(solution, objective=solution.objective + 1e6)

    monkeypatch.setattr(outcome, "identify", fitted)
    outcome._profile(FEW[0], log, solution, identified.statistics)
    assert tried
    assert all(low == high for low, high in tried)


def test_the_time_between_residuals_is_that_of_most_rows_whatever_the_order_of_the_runs() -> None:
    """A run with rows 5 s apart beside one with rows 1 s apart: correlation times [s] are those of the many rows."""
    fine, coarse = (rows for _, rows in trials(SHIP, runs=2, steps=60).frame.groupby("run"))
    for runs in ((fine, coarse[::5]), (coarse[::5], fine)):
        data = Dataset(pd.concat(runs, ignore_index=True), {"clock": "run", "flags": []})
        assert residual_spacing(identify(SHIP, data, data.runs, settings())) == 1.0


@pytest.mark.usefixtures("one_manoeuvre")
def test_free_runs_that_are_worse_name_the_nuisances_that_they_leave_out() -> None:
    """The numbers are right, but a free run is compared with an antenna 15 m ahead as if it were at the origin."""
    log = trials(SHIP, runs=3, steps=60)
    psi, r, v = (log.frame[name] for name in ("psi", "r", "v"))
    ahead = changed(
        log, v=v + 15 * r, north=log.frame["north"] + 15 * np.cos(psi), east=log.frame["east"] + 15 * np.sin(psi)
    )
    assert diagnose(off(), ahead).cause == "lever arm position and velocity"
    result = run_identification(off(), ahead, settings(horizon=0, nuisance={"lever_arm": 15.0}))
    assert result.solution.factors[0] == pytest.approx(1 / 0.7, rel=0.02)
    said = [warning for warning in result.warnings if "worse than before" in warning]
    assert said
    assert said[0].startswith("free runs of the fit runs, which leave out lever_arm, are worse than before in ")


@pytest.mark.parametrize(
    ("v", "position", "worse"),
    [(1.003, 0.5, []), (1.003, 1.04, ["position by 4 %"]), (1.234, 2.5, ["v by 23 %", "position by 150 %"])],
)
def test_free_runs_that_are_worse_say_by_how_much_and_a_little_more_is_not_worse(
    v: float, position: float, worse: list[str]
) -> None:
    """Before, 0.3 % more error was worse, without a number."""
    before = {"u": 0.2, "v": 0.1, "r": 0.002, "position": 8.0}
    after = {**before, "v": v * before["v"], "position": position * before["position"]}
    assert outcome._worse_signals(pd.DataFrame([before, after], index=[BEFORE, AFTER])) == worse


@pytest.mark.usefixtures("one_manoeuvre")
def test_a_profile_of_a_factor_that_ends_at_a_bound_is_left_out_and_the_fit_stays() -> None:
    """Nobody knows before the fit which factor will end at a bound."""
    bounds = {FEW[0]: (1.6, 2.0)}  # the true factor is 1 / 0.7
    result = run_identification(off(), trials(SHIP, runs=2), settings(bounds=bounds), profiles=FEW[:2])
    assert [curve.path for curve in result.curves] == FEW[1:2]
    assert f"no profile of {FEW[0]}: it is at a bound, fixed or dropped" in result.warnings
    said = (
        f"at a bound, so without an interval: {FEW[0]}; the intervals of the others hold if the bound is the true value"
    )
    assert said in result.warnings


@pytest.mark.usefixtures("one_manoeuvre")
@pytest.mark.parametrize("horizon", [0, 5.0])
def test_a_horizon_that_is_short_beside_the_memory_of_the_residuals_is_named(horizon: float) -> None:
    """The residuals are correlated: the log has an error that comes and goes."""
    log = trials(SHIP, 3, 100)
    drift = np.sin(log.frame["t"].to_numpy() / 3)
    shaken = changed(log, **{name: log.frame[name] + size * drift for name, size in NOISE.items()})
    warnings = "; ".join(run_identification(off(), shaken, settings(horizon=horizon)).warnings)
    assert "are correlated over" in warnings
    assert ("is short in comparison" in warnings) == (horizon > 0)


def test_commands_that_no_run_varies_are_named(log: Dataset) -> None:
    """One helm and one shaft speed: yaw damping and resistance were identified with other factors, without a word."""
    names = list(log.commands)
    one = {name: float(log.frame[name].iloc[0]) for name in names}
    (words,) = outcome._not_varied(changed(log, **one), log.runs, FEW)
    assert "are the same in all 5 runs" in words
    shafts = changed(log, **{name: 2.5 for name in names if name.endswith(".n")})
    assert outcome._not_varied(shafts, log.runs, FEW) == []
    (words,) = outcome._not_varied(shafts, log.runs, ["thruster.port.D_p", *FEW])
    assert words == "port.n is the same in all runs to fit: what other orders do there is not learnt"
    assert outcome._not_varied(log, log.runs, ["thruster.port.D_p"]) == []


@pytest.mark.parametrize("degrees", [0.4, 2.0])
def test_a_helm_that_hardly_varies_is_named(log: Dataset, degrees: float) -> None:
    """Intervals of such fits hold the truth in 85 % of cases: docs/records/identification-coverage.md."""
    steps = np.radians(10.0 + degrees * (np.arange(len(log.frame)) // 50 % 2))
    alpha = {name: steps for name in log.commands if name.endswith(".alpha")}
    words = outcome._not_varied(changed(log, **alpha), log.runs, FEW)
    assert [f"all angles lie within {degrees:g} deg" in one for one in words] == [True] * (degrees < 1.0)
