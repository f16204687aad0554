"""Broken vessels and studies: one line each, with the file, the dotted path and what would be right."""

from pathlib import Path

import pytest

from shipid.document import bundled_documents
from shipid.errors import DocumentError
from shipid.study.plan import read_plan
from shipid.vessel.load import load_vessel

FOLDER = Path(__file__).parent / "bad"

#: file -> dotted path that must be named, and a piece of the remedy
VESSELS = {
    "broken-syntax": ("", "not valid TOML"),
    "duplicate-key": ("", "overwrite"),
    "unknown-top-level-key": ("speed", "valid: added_mass"),
    "typo-in-block": ("hull.derivativs", "did you mean 'derivatives'?"),
    "typo-in-thruster": ("thruster.stern.F2", "did you mean 'F_2'?"),
    "missing-mass": ("inertia.m", "missing"),
    "negative-mass": ("inertia.m", "-1000.0: must be above 0"),
    "zero-length": ("wind.L_oa", "must be above 0"),
    "text-for-number": ("inertia.I_z", "'2000': must be a number"),
    "truth-for-number": ("inertia.I_z", "must be a number"),
    "not-a-number": ("inertia.x_G", "finite"),
    "infinite": ("inertia.I_z", "finite"),
    "unknown-derivative": ("hull.derivatives", "factors of phi, u, v, w, p, q, r"),
    "duplicate-monomial": ("hull.derivatives", "'Y_rv' and 'Y_vr' name the same monomial: keep one"),
    "duplicate-modulus": ("hull.derivatives", "'Y_|v|v' and 'Y_v|v|' name the same monomial: keep one"),
    "added-mass-in-hull": ("hull.derivatives", "it belongs in [added_mass]"),
    "hull-name-in-added-mass": ("added_mass", "write it like 'X_udot'"),
    "added-mass-with-wrong-sign": ("inertia", "X_udot < 0"),
    "unknown-thruster-kind": ("thruster.stern.kind", "did you mean 'tunnel'?"),
    "rudder-behind-nothing": ("thruster.rudder.behind", "'screw' gives no wash: valid: propeller"),
    "rudder-behind-a-screw-that-is-off": ("thruster.rudder.behind", "'propeller' gives no wash: it is off"),
    "rudder-derivative-in-the-hull": ("hull.abkowitz", "belongs in a rudder"),
    "hull-derivative-of-a-rudder": ("thruster.rudder", "belongs in [hull.abkowitz]"),
    "unknown-coriolis": ("added_mass.coriolis", "'full', 'mmg' or 'none'"),
    "missing-kind": ("thruster.stern.kind", "missing"),
    "unequal-wind-columns": ("wind", "gamma_deg 3, C_X 3, C_Y 4, C_N 3"),
    "wind-angles-not-rising": ("wind.gamma_deg", "must rise"),
    "wind-table-of-one": ("wind.gamma_deg", "2 or more entries"),
    "missing-rho": ("constants.rho", "a term needs rho"),
    "no-strips": ("hull.crossflow.strips", "must be at least 1"),
    "half-a-strip": ("hull.crossflow.strips", "must be a whole number"),
    "five-degrees-of-freedom": ("dof", "3, 4 or 6"),
    "six-degrees-without-inertia": ("inertia.I_x", "missing: 6 degrees of freedom need it"),
    "two-components-of-one-name": ("thruster.wind", "choose another"),
    "dot-in-a-name": ("thruster.stern.1", ""),
    "thruster-called-actual": ("thruster.actual", "columns of what actuators have reached"),
    "thruster-is-a-number": ("thruster.stern", "must be a table"),
    "off-is-a-word": ("thruster.stern.off", "must be true or false"),
    "unknown-actuator": ("thruster.stern.actuator.n.kind", "first_order"),
    "lag-of-a-rate-limit": ("thruster.stern.actuator.n.T", "valid: high, kind, low, off, rate"),
    "actuator-of-no-command": ("thruster.stern.actuator.alpha", "valid: n"),
    "current-without-kind": ("current.kind", "missing"),
    "empty": ("name", "missing"),
    "not-utf-8": ("", "save it as UTF-8"),
    "patch-with-unknown-path": ("set.inertia.mass", "no such parameter: "),
    "patch-with-wrong-digest": ("base_digest", "make the patch anew"),
    "patch-with-missing-base": ("base", "'./gone.toml': no such file"),
    "patch-with-unknown-base": ("base", "did you mean 'gunnerus-28.9'?"),
    "patch-of-itself": ("base", "name a vessel"),
    "patch-with-unknown-key": ("sets", "did you mean 'set'?"),
    "patch-with-nested-values": ("set.inertia", "must be a number"),
    "patch-that-breaks-the-base": ("inertia.m", "must be above 0"),
    "extends-missing-file": ("extends", "'./gone.toml': no such file"),
    "extends-unknown-name": ("extends", "did you mean 'gunnerus-28.9'?"),
    "extends-itself": ("extends", "name a vessel that does not"),
    "extends-a-patch": ("extends", "extend a vessel"),
    "extends-and-base": ("extends", "valid: base, base_digest"),
    "waves-without-table": ("waves.first_order.table", "missing"),
    "waves-table-missing": ("waves.first_order.table", "gone.csv: cannot be read: No such file"),
    "waves-table-of-a-device": ("waves.first_order.table", "/dev/zero: cannot be read: a device or a pipe, not a file"),
    "table-of-another-term": ("hull.derivatives.table", "'tables/waves.csv': must be a number"),
    "table-in-the-wind": ("wind.table", "unknown key: valid: A_FW"),
    "waves-table-empty": ("waves.first_order.table", "words.csv: cannot be read: not a CSV table with a header"),
    "waves-table-without-a-column": ("waves.first_order.table", "has no column 'K_imag'"),
    "waves-with-columns-missing": ("waves.drift.table", "has no column 'X_drift'"),
    "waves-table-with-a-word": ("waves.first_order.table", "row 5 has no number in 'Z_real'"),
    "waves-table-with-a-gap": ("waves.first_order.table", "is no grid"),
    "waves-table-of-uneven-headings": ("waves.first_order.table", "equally spaced headings from 0 to 180 deg"),
    "waves-table-of-three-frequencies": ("waves.first_order.table", "four frequencies or more"),
    "waves-of-no-harmonics": ("waves.first_order.harmonics", "must be at least 1"),
    "radiation-of-unequal-modes": ("radiation.roll", "sigma 2, omega 2, K44_cos 3, K44_sin 2"),
    "radiation-that-grows": ("radiation.roll.sigma.1", "-0.6: must be above 0"),
    "radiation-without-damping": ("radiation.heave_pitch.sigma.1", "0.0: must be above 0"),
    "unknown-radiation": ("radiation.sway", "valid: heave_pitch, roll"),
    "restoring-without-waterplane": ("restoring.hydrostatic.A_wp", "missing"),
    "restoring-without-gravity": ("constants.g", "a term needs g"),
}
STUDIES = {
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
READ = {"vessels": (load_vessel, VESSELS), "studies": (read_plan, STUDIES)}


def test_what_the_broken_ones_differ_from_is_in_order_and_every_one_is_tested() -> None:
    """So that their flaw is the one that is meant."""
    assert load_vessel(FOLDER / "vessels" / "plain.toml").parameters["inertia.m"] == 1000.0
    assert read_plan(FOLDER / "studies" / "plain.toml").cells == 8
    for kind, (_, broken) in READ.items():
        assert {file.stem for file in (FOLDER / kind).glob("*.toml")} == {"plain", *broken}


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind, (_, broken) in READ.items() for name in broken])
def test_broken(kind: str, name: str) -> None:
    (read, broken), file = READ[kind], FOLDER / kind / f"{name}.toml"
    path, remedy = broken[name]
    with pytest.raises(DocumentError) as caught:
        read(file)
    line = str(caught.value)
    assert "\n" not in line or kind == "vessels"
    assert line.startswith(f"{file}: ")
    assert (caught.value.path or "") == path
    assert remedy in line


def test_missing_file_and_folder(tmp_path: Path) -> None:
    for name, why in ((str(tmp_path / "gone.toml"), "no such file"), (str(tmp_path), "is a folder")):
        with pytest.raises(DocumentError, match=why) as caught:
            load_vessel(name)
        assert name in str(caught.value)
    folder = tmp_path / "folder.toml"
    folder.mkdir()
    with pytest.raises(DocumentError, match="is a folder"):
        load_vessel(str(folder))


def test_unknown_name_is_corrected() -> None:
    with pytest.raises(DocumentError, match=r"did you mean 'gunnerus-28\.9'"):
        load_vessel("gunnerus-28")


def test_fault_in_the_base_names_the_base(tmp_path: Path) -> None:
    """A patch on a broken vessel is not the one to mend."""
    broken = FOLDER / "vessels" / "missing-mass.toml"
    patch = tmp_path / "patch.toml"
    patch.write_text(f'base = "{broken.as_posix()}"\n[set]\n"inertia.m" = 2.0\n')
    with pytest.raises(DocumentError, match="missing") as caught:
        load_vessel(str(patch))
    assert caught.value.file == str(broken)


def test_table_that_is_switched_off_is_read_all_the_same(tmp_path: Path) -> None:
    text = (
        (FOLDER / "vessels" / "waves-table-missing.toml")
        .read_text()
        .replace("./plain.toml", (FOLDER / "vessels" / "plain.toml").as_posix())
    )
    document = tmp_path / "calm.toml"
    document.write_text(
        text.replace("tables/gone.csv", (FOLDER / "vessels" / "tables" / "whole.csv").as_posix()) + "off = true\n"
    )
    calm = load_vessel(str(document))
    assert calm.document["waves"]["first_order"]["table"]["omega"][-1] == 2.0


def test_a_path_is_a_path_whatever_its_type(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A `Path` never is the name of a bundled vessel; a text that is neither is refused in words."""
    monkeypatch.chdir(tmp_path)
    Path("ship.toml").write_bytes(
        b"\xef\xbb\xbf" + (bundled_documents("models")["mariner"]).read_bytes()
    )  # as some editors do
    by_path, by_text = load_vessel(Path("ship.toml")), load_vessel("./ship.toml")
    assert by_path.digest == by_text.digest == load_vessel("mariner").digest
    with pytest.raises(DocumentError, match="no such file"):
        load_vessel(Path("mariner"))
    for wrong in (None, 3, []):
        with pytest.raises(DocumentError, match="is no name of a document"):
            load_vessel(wrong)  # type: ignore[arg-type]
    with pytest.raises(DocumentError, match="no vessel of this name"):
        load_vessel("")


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
        read_plan(FOLDER / "studies" / "plain.toml", {path: 7})
    assert message in str(caught.value)
    assert caught.value.path == path
    assert "\n" not in str(caught.value)
