"""Which number buys H, of the families of `quick` with 40 members each, against numbers that are wrong alone.

`python docs/records.py number-shares python docs/number_shares.py FOLDER` from the root of a checkout. FOLDER keeps the
two studies: one with many members, from which the shares are estimated, and one whose foundations have one number
wrong each, by a factor of 0.6 and of 1.4. The shares know nothing of the second.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pandas as pd
from scipy.stats import spearmanr

from shipid.exchange.shares import shares_frame
from shipid.study.results import Results, read_results

MEMBERS, FACTORS = 40, {"less": 0.6, "more": 1.4}
NUMBERS = ("N_uv", "N_ur", "X_u|u|", "Y_uv", "Y_ur", "Y_rrv", "N_rrr", "Y_vvv", "N_vvv")
FAMILY = '[[family]]\nname = "{name}"\nbase = "gunnerus-28.9"\n'
RULE = '[[family.perturb]]\nparameters = ["hull.derivatives.{number}"]\nfactor = {factor}\n\n'


def run(folder: Path, name: str, text: str) -> Results:
    """Write a study and run it, or what of it is missing."""
    file = folder / f"{name}.toml"
    folder.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "shipid", "study", "run", str(file), "--out", str(folder / name), "--workers", "1"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return read_results(folder / name)


def error(results: Results, model: str, N_D: int) -> float:
    """H [m] of a model at an amount, or A."""
    if N_D == 0:
        return float(results.models.set_index("model").loc[model, "A"])
    cells = results.cells
    return float(cells[cells["foundation"].eq(model) & cells["N_D"].eq(N_D)]["H"].iloc[0])


def main(folder: Path) -> None:
    """Run both studies and print the tables of the record."""
    quick = Path("studies/quick.toml").read_text(encoding="utf-8")
    quick = quick.replace("N_D = [10, 30, 100]", "N_D = [10, 30]\nseeds = [0]")
    many = quick.replace("members = 3", f"members = {MEMBERS}").replace("members = 2", f"members = {MEMBERS}")
    frame = shares_frame(run(folder, "many", many))
    alone_text = quick.split("[[family]]", 1)[0] + FAMILY.format(name="nominal") + "\n"
    for k, number in enumerate(NUMBERS):
        for side, factor in FACTORS.items():
            alone_text += FAMILY.format(name=f"n{k}.{side}") + RULE.format(number=number, factor=factor)
    alone = run(folder, "alone", alone_text)

    pd.set_option("display.width", 200)
    for (family, N_D), part in frame.groupby(["family", "N_D"], sort=False):
        print(f"{family}, N_D = {N_D}, {part['members'].iloc[0]} members, H {part['H'].iloc[0]:.3f} m")
        numbers = part[part["kind"].eq("number")].sort_values("share", ascending=False).head(6)
        for row in (*numbers.itertuples(), *part[part["kind"].ne("number")].itertuples()):
            print(f"    {row.number:45} {row.share:7.1%} ({row.low:.1%} to {row.high:.1%})")
    for N_D in (0, 10, 30):
        nominal = error(alone, "nominal", N_D)
        rows = []
        for k, number in enumerate(NUMBERS):
            rise = sum(error(alone, f"n{k}.{side}", N_D) for side in FACTORS) / 2 - nominal
            mine = (
                frame["family"].eq("moderate") & frame["N_D"].eq(N_D) & frame["number"].eq(f"hull.derivatives.{number}")
            )
            rows.append((number, rise, float(frame[mine]["share"].iloc[0])))
        rows.sort(key=lambda row: -row[1])
        order = spearmanr([row[1] for row in rows], [row[2] for row in rows]).statistic
        print(f"wrong alone, N_D = {N_D}: nominal {nominal:.3f} m; rank correlation of rise and share {order:.2f}")
        for number, rise, share in rows:
            print(f"    {number:8} H rises by {rise:.3f} m, share {share:.1%}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
