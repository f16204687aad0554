"""Broken vessel documents: one line each, with the file, the dotted path and what would be right."""

from pathlib import Path

import pytest

from shipid.document import bundled_documents
from shipid.errors import DocumentError
from shipid.vessel.load import load_vessel

FOLDER = Path(__file__).parents[1] / "bad" / "vessels"

#: file -> dotted path that must be named, and a piece of the remedy
BROKEN = {
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


def test_every_document_of_the_folder_is_tested() -> None:
    assert {file.stem for file in FOLDER.glob("*.toml")} == {"plain", *BROKEN}


def test_the_plain_one_is_in_order() -> None:
    """What the broken ones differ from loads, so that their flaw is the one that is meant."""
    assert load_vessel(str(FOLDER / "plain.toml")).parameters["inertia.m"] == 1000.0


@pytest.mark.parametrize("name", BROKEN)
def test_broken(name: str) -> None:
    path, remedy = BROKEN[name]
    with pytest.raises(DocumentError) as caught:
        load_vessel(str(FOLDER / f"{name}.toml"))
    line = str(caught.value)
    assert line.startswith(str(FOLDER / f"{name}.toml") + ": ")
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
    broken = FOLDER / "missing-mass.toml"
    patch = tmp_path / "patch.toml"
    patch.write_text(f'base = "{broken.as_posix()}"\n[set]\n"inertia.m" = 2.0\n')
    with pytest.raises(DocumentError, match="missing") as caught:
        load_vessel(str(patch))
    assert caught.value.file == str(broken)


def test_table_that_is_switched_off_is_read_all_the_same(tmp_path: Path) -> None:
    text = (FOLDER / "waves-table-missing.toml").read_text().replace("./plain.toml", (FOLDER / "plain.toml").as_posix())
    document = tmp_path / "calm.toml"
    document.write_text(text.replace("tables/gone.csv", (FOLDER / "tables" / "whole.csv").as_posix()) + "off = true\n")
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
