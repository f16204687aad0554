from __future__ import annotations

import json
import re
from pathlib import Path

import pandas as pd
import pytest
import tomlkit

from shipid.document import bundled_documents
from shipid.vessel.load import load_vessel
from tests.cli.running import ended, output_of


@pytest.mark.parametrize("vessel", bundled_documents("models"))
def test_what_is_shown_fits_100_columns(vessel: str, tmp_path: Path) -> None:
    """Law over all bundled vessels, of `vessel show` and of `family show`; a path of a file is as long as it is."""
    file = tmp_path / "f.toml"
    output_of("family", "new", vessel, "--out", file, "--members", 3)
    lines = [*output_of("vessel", "show", vessel).splitlines(), *output_of("family", "show", file).splitlines()]
    assert max(len(line) for line in lines if not line.startswith(("file ", "/"))) <= 100


def test_the_way_of_a_family(tmp_path: Path) -> None:
    """Draft, show, roll out, lock, compare, verify; a changed lock is one line that says where."""
    file, table, motions, html = (tmp_path / name for name in ("f.toml", "t.csv", "m.parquet", "s.html"))
    output_of("family", "new", "gunnerus-28.9", "--out", file, "--members", 4)
    assert "high: 4 of R/V Gunnerus" in output_of("family", "show", file)
    output_of("family", "show", file, "--family", "high", "--csv", table)
    assert pd.read_csv(table).shape == (4, 1 + 2 * 37)
    more = ("--family", "high", "--csv", motions, "--html", html)
    rolled = output_of("family", "rollout", file, "zigzag", 20, 20, *more)
    assert "4 members after 266 s, none diverged" in rolled
    assert html.stat().st_size > 10_000
    assert pd.read_parquet(motions)["member"].nunique() == 4
    lock = tmp_path / "out" / "high.lock.toml"
    assert str(lock) in output_of("family", "export", file, "--family", "high", "--out", tmp_path / "out")
    assert "bit for bit" in output_of("family", "diff", file, lock, "--family", "high")
    kept = lock.read_text()
    lock.write_text(re.sub(r"(\"inertia.m\" = \[\n?\s*)[0-9.e+]+", r"\g<1>123456.0", kept))
    changed = json.loads(output_of("family", "diff", file, lock, "--family", "high", "--json"))
    assert (changed["rules"], changed["numbers"]) == ([], [{"number": "inertia.m", "members that differ": 1}])
    lock.write_text(kept)
    assert "as locked: digest" in output_of("family", "verify", lock)
    lock.write_text(lock.read_text().replace("seed = 2", "seed = 3"))
    code, _, error = ended("family", "verify", lock)
    assert (code, error.count("\n"), "not as locked" in error) == (1, 1, True)
    differences = json.loads(output_of("family", "diff", file, lock, "--family", "high", "--json"))
    assert differences["rules"] == [{"what": "rules.seed", "one": 2, "other": 3}]
    assert differences["numbers"] == [], "the lock still holds those of its old seed"
    code, _, error = ended("family", "export", file, "--family", "high", "--out", lock)
    assert (code, error.count("\n"), "File exists" in error) == (1, 1, True)
    assert "choose one of nominal, moderate, high" in ended("family", "export", file, "--out", tmp_path)[2]


def test_a_number_that_is_0_in_the_base_has_no_factor(tmp_path: Path) -> None:
    """Before, `family show` printed nan..nan."""
    file = tmp_path / "f.toml"
    rule = 'parameters = ["hull.derivatives.*"]\nbias = [0.1, 0.2]'
    file.write_text(f'[[family]]\nname = "moved"\nbase = "gunnerus-28.9"\nmembers = 2\n[[family.perturb]]\n{rule}\n')
    base = load_vessel("gunnerus-28.9").with_values({"hull.derivatives.N_ur": 0.0}).document
    (tmp_path / "ship.toml").write_text(tomlkit.dumps(base))
    file.write_text(file.read_text().replace('"gunnerus-28.9"', '"ship.toml"'))
    shown = output_of("family", "show", file)
    assert "nan" not in shown
    assert [line.split()[-1] for line in shown.splitlines() if " hull.derivatives.N_ur " in f" {line} "] == ["none"]
