"""The drawn raw folders agree with their truth, and the judge sees what is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from tests.logs.raw_folders import (
    RawFolder,
    draw_craft,
    draw_raw_folder,
    rates,
    run_command,
    simulate_day,
    vessel_text,
    wrong_signals,
)

CALM = {"V_w": 0.0, "beta_w": 0.0, "c_n": 0.0, "c_e": 0.0}


def toml_text(table: dict[str, Any], path: str = "") -> str:
    """A document as TOML."""
    lines = ""
    for key, value in table.items():
        if not isinstance(value, dict):
            lines += f"{json.dumps(key)} = {json.dumps(value, ensure_ascii=False, default=float)}\n"
    for key, value in table.items():
        if isinstance(value, dict):
            name = path + json.dumps(key)
            lines += f"[{name}]\n" + toml_text(value, name + ".")
    return lines


def import_with(folder: RawFolder, mapping: dict[str, Any], place: Path) -> dict[str, str]:
    """What is wrong after the import with a mapping."""
    document, out = place / "truth.toml", place / "out.parquet"
    document.write_text(toml_text(mapping), encoding="utf-8")
    out.unlink(missing_ok=True)
    status, text, _ = run_command("data", "import", document, folder.path, "--out", out)
    assert status == 0, text
    return wrong_signals(folder, pd.read_parquet(out))


def draw_mapped(seed: int, root: Path) -> RawFolder:
    """The next folder whose truth a mapping can say."""
    while not (folder := draw_raw_folder(seed, root)).mapping:
        seed += 1000
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_the_true_mapping_gives_the_motion_back_and_wrong_ones_do_not(seed: int, tmp_path: Path) -> None:
    folder = draw_mapped(seed, tmp_path)
    assert import_with(folder, folder.mapping, tmp_path) == {}
    axes = ("north", "east") if "north" in folder.mapping["columns"] else ("longitude", "latitude")
    columns = folder.mapping["columns"]
    swapped = {axes[0]: {**columns[axes[1]]}, axes[1]: {**columns[axes[0]]}}
    if axes[0] == "north" or abs(folder.mapping["origin"]["longitude"]) < 80:
        assert "position" in import_with(folder, folder.mapping | {"columns": columns | swapped}, tmp_path)
    turned = columns["psi"] | {"sign": -columns["psi"].get("sign", 1)}
    assert "psi" in import_with(folder, folder.mapping | {"columns": columns | {"psi": turned}}, tmp_path)
    for name in [name for name in columns if "." in name]:
        wrong = columns[name] | {"sign": -columns[name].get("sign", 1), "offset": -columns[name].get("offset", 0.0)}
        assert name in import_with(folder, folder.mapping | {"columns": columns | {name: wrong}}, tmp_path)


def test_every_file_of_a_folder_has_the_same_columns(tmp_path: Path) -> None:
    """The filtered heading had another name in the file in which heading and course are exchanged."""
    heads = {one.file.read_text().splitlines()[0] for one in draw_raw_folder(770534006, tmp_path).recordings}
    assert len(heads) == 1
    assert "_filt" in heads.pop()


DRIVES = ["single", "twin", "twinrudder", "azimuth", "outboard"]


@pytest.mark.parametrize("drive", DRIVES)
def test_the_vessel_document_has_the_commands_of_the_log(drive: str, tmp_path: Path) -> None:
    file = tmp_path / "ship.toml"
    file.write_text(vessel_text(draw_craft(np.random.default_rng(2), drive, small=False)))
    status, text, _ = run_command("vessel", "show", file)
    assert status == 0, text


@pytest.mark.parametrize("drive", DRIVES)
def test_a_helm_to_starboard_turns_to_starboard_and_the_mirror_image_to_port(drive: str) -> None:
    random = np.random.default_rng(3)
    craft = draw_craft(random, drive, small=True)
    day = simulate_day(np.random.default_rng(1), craft, craft.tau / 5, 200, CALM)
    helm = day[:, 9] - day[:, 10] if drive == "twin" else day[:, 11]
    assert np.corrcoef(helm[:-3], day[3:, 5])[0, 1] > 0.5
    assert np.all(np.abs(day[:, 3]) < 1.5 * craft.U)
    mirror, sides = np.array([1, -1, -1, 1, -1, -1, 1, 1, -1]), [0, 1, 2, 3, 4, 5, 7, 6, 8]
    for state, order in ((row[:9] + random.normal(0, 0.1, 9), row[9:]) for row in day[::20]):
        image = rates((mirror * state)[sides], order[[1, 0, 2]] * [1, 1, -1], craft, CALM)
        assert np.allclose(image, (mirror * rates(state, order, craft, CALM))[sides])
