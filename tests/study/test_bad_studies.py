"""Broken study documents: one line each, with the file, the dotted path and what would be right."""

from pathlib import Path

import pytest

from shipid.errors import DocumentError
from shipid.study.plan import read_plan

FOLDER = Path(__file__).parents[1] / "bad" / "studies"

#: file -> dotted path that must be named, and a piece of the remedy
BROKEN = {
    "not-toml": ("", "not valid TOML"),
    "key-twice": ("", "overwrite"),
    "unknown-block": ("splits", "did you mean 'split'?"),
    "no-question": ("question", "missing"),
    "question-of-nothing": ("question", "must have 3 or more characters"),
    "truth-and-data": ("", "either [truth] (simulation) or [data]"),
    "neither-truth-nor-data": ("", "either [truth] (simulation) or [data]"),
    "data-of-two-sources": ("data", "either `dataset`, or `mapping`"),
    "dataset-with-repairs": ("data", "go with a `mapping`"),
    "unknown-truth-vessel": ("truth.vessel", "did you mean 'gunnerus-"),
    "truth-sets-unknown-block": ("truth.set.thruster.port.lag", "unknown key: valid: D_p"),
    "truth-sets-inside-a-number": ("truth.set.inertia.m.x", "there is no 'x': nothing is defined there"),
    "truth-range-backwards": ("truth.manoeuvre.0", "start_speed has low > high"),
    "truth-orders-of-old": ("truth.n_rpm", "unknown key"),
    "truth-of-no-kind": ("truth.manoeuvre.0", "did you mean 'zigzag'"),
    "truth-without-an-order": ("truth.manoeuvre.0.delta_deg", "give delta_deg = [low, high]"),
    "truth-with-a-foreign-key": ("truth.manoeuvre.0", "angle: no key of zigzag: did you mean 'angle_deg'"),
    "interval-between-steps": ("truth", "a multiple of step 0.3 s"),
    "horizon-longer-than-runs": ("truth.duration", "shorter than the horizon of 21 s"),
    "step-of-zero": ("prediction.step", "must be above 0"),
    "ahead-between-steps": ("prediction", "ahead = 5.5 s must be 2 to 100,000 steps of 1 s"),
    "unknown-integrator": ("prediction.integrator", "'euler' or 'rk4'"),
    "unknown-base": ("family.right.base", "did you mean 'gunnerus-28.9'?"),
    "missing-base-file": ("family.right.base", "'./gone.toml': no such file"),
    "family-without-base": ("family.right.base", "name a base vessel"),
    "extends-nobody": ("family.right.extends", "did you mean 'wrong'?"),
    "circular-extends": ("family.right.extends", "right -> wrong"),
    "range-backwards": ("family.wrong.perturb.0.factor", "give [low, high]"),
    "range-of-three": ("family.wrong.perturb.0.factor", "must be a number or a list of 2 or fewer entries (it has 3"),
    "selects-nothing": ("family.wrong.perturb.0.parameters", "did you mean 'hull.derivatives."),
    "factor-without-parameters": ("family.wrong.perturb.0", "together with factor"),
    "parameters-without-factor": ("family.wrong.perturb.0", "together with factor"),
    "negative-mass": ("family.wrong", "inertia.m: -410931.81"),
    "family-called-none": ("family.none.name", "taken by the foundation without physics"),
    "family-called-like-a-member": ("family", "two models are called 'wrong-1'"),
    "two-families-of-one-name": ("family.1.name", "two families are called 'right'"),
    "family-with-a-slash": ("family.a/b.name", "'a/b'"),
    "family-beside-families": ("family", "5: must be a list"),
    "families-of-itself": ("families", "families-of-itself.toml takes its families from elsewhere itself: name that"),
    "no-families": ("", "only recorded runs can be studied without physics"),
    "more-data-than-runs": ("grid.N_D", "12 manoeuvres less 4 test runs leave 8"),
    "empty-grid": ("grid.N_D", "must be a list of 1 or more entries (it has 0)"),
    "no-run-for-training": ("grid.N_D.0", "must be at least 1"),
    "negative-seed": ("grid.seeds.0", "must be at least 0"),
    "no-test-run": ("split.test", "must be a list of 1 or more entries (it has 0)"),
    "named-test-of-a-truth": ("split.test", "give the number of test runs"),
    "identify-inside-a-family": ("family.right.identify", 'add [[family]] name = "right-new", extends = "right"'),
    "identify-of-perturbed": ("family.wrong.identify", 'add [[family]] name = "wrong-new", extends = "wrong"'),
    "identify-of-members": ("family.fitted.identify", "an identified or observed family must be a separate family"),
    "unknown-method": ("method.kernel.kind", "did you mean 'kernel'?"),
    "unknown-method-key": ("method.kernel.term", "did you mean 'terms'?"),
    "method-key-of-python": ("method.kernel.model_config", "unknown key"),
    "method-of-no-trials": ("method.kernel.trials", "must be above 0"),
    "method-of-unknown-family": ("method.kernel.families", "'wrnog' is no family: did you mean 'wrong'?"),
    "method-with-a-plus": ("method.kernel+.name", "'kernel+'"),
    "family-without-method": ("method", "no method meets 'wrong-1': name its family in `families`"),
    "two-methods-of-one-name": ("method.1.name", "two methods are called 'kernel'"),
    "kernel-with-a-budget": ("method.kernel.budget", "unknown key: a key of former methods: delete it"),
    "alone-with-a-setting": ("method.alone.trials", "unknown key"),
    "no-method": ("method", "must be a list of 1 or more entries (it has 0)"),
    "claims-of-unknown-method": ("claims.method", "did you mean 'kernel'?"),
    "claims-of-nobody": ("claims.accurate", "did you mean 'right'?"),
    "claims-of-no-physics": ("claims.inaccurate", "valid: right, wrong"),
    "claims-of-many-members": ("claims.inaccurate", "2 members"),
    "claims-of-one-family": ("claims", "the same family"),
    "claims-of-accurate-alone": ("claims", "give both `accurate` and `inaccurate`, or neither"),
    "claims-of-high-alone": ("claims", "give both `moderate` and `high`, or neither"),
    "claims-of-one-degraded-family": ("claims", "`moderate` and `high` are the same family"),
    "claims-of-unknown-moderate": ("claims.moderate", "did you mean 'wrong'?"),
    "nominal-of-many-members": ("claims.nominal", "2 members: give one"),
    "nominal-that-is-perturbed": ("claims.nominal", "'wrong' is perturbed"),
    "aside-of-nobody": ("claims.aside", "did you mean 'right'?"),
    "published-without-source": ("published.source", "missing"),
    "published-unknown-quantity": ("published", "envelope.u_deg is no input of a study: did you mean"),
    "published-out-of-order": ("published", "envelope.r_deg: give [min, mean, max], not [0.0, 8.0, 6.0]"),
    "published-of-two-numbers": ("published", "envelope.r_deg: give [min, mean, max], not [0.0, 8.0]"),
    "cost-of-two-goals": ("cost", "give either `per_metre` or `H_end_required`"),
    "cost-of-nothing": ("cost.run", "0.0: must be above 0"),
    "cost-without-unit": ("cost.unit", "missing (of every price, such as EUR or h)"),
    "cost-of-nobody": ("cost.foundations.templat", "did you mean 'template'?"),
    "cost-below-zero": ("cost.foundations.wrong", "-1.0: must be at least 0"),
    "negative-world": ("seed", "must be at least 0"),
    "waves-below-zero": ("truth.waves.H_s", "-1.0: must be at least 0"),
    "waves-of-no-period": ("truth.waves.T_p", "must be above 0"),
    "waves-without-period": ("truth.waves.T_p", "missing"),
    "waves-of-gamma-below-one": ("truth.waves.gamma", "must be at least 1"),
    "waves-misspelt": ("truth.waves.spread", "did you mean 'spreading'?"),
    "gusts-without-kind": ("truth.gusts.kind", "missing"),
    "gusts-of-unknown-kind": ("truth.gusts.kind", "'npd'"),
    "gusts-with-intensity": ("truth.gusts.turbulence_intensity", "unknown key"),
    "gusts-backwards": ("truth.gusts.frequencies", "low > high: give [low, high], not [0.5, 0.01]"),
    "sensor-of-negative-noise": ("truth.sensors.psi.noise", "must be at least 0"),
    "current-backwards": ("truth.current_speed", "low > high"),
    "actuators-at-sea": ("truth.manoeuvre.0", "actuators_at: must be 'order' or 'rest'"),
    "waves-for-a-vessel-without": ("truth.waves", "gunnerus-28.9 has no [waves]"),
    "current-for-a-vessel-without": ("truth.current_speed", "gunnerus-28.9-6dof has no [current]"),
    "gusts-of-negative-wind": ("truth.wind_speed.0", "must be at least 0"),
    "sensor-of-no-column": ("truth.sensors.psy", "did you mean 'psi'?"),
    "sensor-of-the-clock": ("truth.sensors.t", "valid: V_w, beta_w, east"),
}


def test_every_document_of_the_folder_is_tested() -> None:
    assert {file.stem for file in FOLDER.glob("*.toml")} == {"plain", *BROKEN}


def test_the_plain_one_is_in_order() -> None:
    """What the broken ones differ from is read, so that their flaw is the one that is meant."""
    assert read_plan(FOLDER / "plain.toml").cells == 8


@pytest.mark.parametrize("name", BROKEN)
def test_broken(name: str) -> None:
    path, remedy = BROKEN[name]
    with pytest.raises(DocumentError) as caught:
        read_plan(FOLDER / f"{name}.toml")
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(FOLDER / f"{name}.toml") + ": ")
    assert (caught.value.path or "") == path
    assert remedy in line


@pytest.mark.parametrize("name", ["nowhere.toml", "./nowhere.toml", "quik"])
def test_no_such_study(name: str) -> None:
    with pytest.raises(DocumentError, match=r"no such file|did you mean 'quick'\?"):
        read_plan(name)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("family.2.members", "--set: there is no '2': valid: right, wrong"),
        ("family.wrnog.members", "--set: there is no 'wrnog': did you mean 'wrong'?"),
        ("family.wrong.perturb.4.factor", "there is no '4': valid: 0"),
    ],
)
def test_a_change_beyond_a_list_names_its_entries(path: str, message: str) -> None:
    with pytest.raises(DocumentError) as caught:
        read_plan(FOLDER / "plain.toml", {path: 7})
    assert message in str(caught.value)
    assert caught.value.path == path
    assert "\n" not in str(caught.value)
