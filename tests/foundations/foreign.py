"""FMUs of nobody's: a ship in C of FMI 2.0 or 3.0, made for a test, and the same ship in NumPy."""

from __future__ import annotations

import inspect
import shutil
import subprocess
import zipfile
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

SOURCE = Path(__file__).parent / "ship.c"
OUTPUTS = {"x": "m", "y": "m", "yaw": "deg", "surge": "kn", "sway": "kn", "rate": "deg/s"}
INPUTS = {"rudder": "deg", "rpm": "rpm"}
PARAMETERS = {"K_T": 0.02, "X_uu": 0.003, "T": 12.0, "K": 0.06, "b": 8.0}
STARTS = {"surge_0": "kn", "rate_0": "deg/s", "yaw_0": "deg"}
TABLE = """
[fmu]
file = "{file}"
{more}
north = {{ variable = "y" }}
east = {{ variable = "x" }}
psi = {{ variable = "yaw", unit = "deg", frame = "enu" }}
u = [{{ variable = "surge", unit = "kn" }}{u}]
v = [{{ variable = "sway", unit = "kn", scale = -1 }}{v}]
r = [{{ variable = "rate", unit = "deg/s", frame = "enu" }}{r}]
"rudder.delta" = {{ variable = "rudder", unit = "deg" }}
"propeller.n" = {{ variable = "rpm", unit = "rpm" }}
"""
START_ROWS = {
    "u": ', { variable = "surge_0", unit = "kn", role = "start" }',
    "r": ', { variable = "rate_0", unit = "deg/s", frame = "enu", role = "start" }',
    "v": "",
}


def describe(version: int, starts: bool, branches: bool) -> str:
    """Text of modelDescription.xml."""
    rows = [(name, "output", unit, None) for name, unit in OUTPUTS.items()]
    rows += [(name, "input", unit, 0.0) for name, unit in INPUTS.items()]
    rows += [(name, "parameter", None, value) for name, value in PARAMETERS.items()]
    rows += [(name, "parameter", unit, 0.0) for name, unit in STARTS.items()]
    rows += [("fault", "parameter", None, 0.0)]
    rows = [row for row in rows if starts or row[0] not in STARTS]
    place = {name: at for at, name in enumerate([*OUTPUTS, *INPUTS, *PARAMETERS, *STARTS, "fault"])}
    lines = []
    for name, causality, unit, start in rows:
        kind = "fixed" if causality == "parameter" else "continuous"
        words = f'name="{name}" valueReference="{place[name]}" causality="{causality}" variability="{kind}"'
        value = "" if start is None else f' start="{start}"'
        value += "" if unit is None else f' unit="{unit}"'
        lines.append(
            f"<Float64 {words}{value}/>" if version == 3 else f"<ScalarVariable {words}><Real{value}/></ScalarVariable>"
        )
    if version == 3:
        lines.append('<Float64 name="time" valueReference="99" causality="independent" variability="continuous"/>')
    units = "".join(f'<Unit name="{unit}"/>' for unit in sorted({*OUTPUTS.values(), *INPUTS.values(), "m/s"}))
    able = 'canGetAndSetFMU{}tate="true"'.format("S" if version == 3 else "s") if branches else ""
    if version == 3:
        outputs = "".join(f'<Output valueReference="{place[name]}"/>' for name in OUTPUTS)
        head = 'fmiVersion="3.0" modelName="ship" instantiationToken="1"'
    else:
        unknowns = "".join(f'<Unknown index="{place[name] + 1}"/>' for name in OUTPUTS)
        outputs = f"<Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns>"
        head = 'fmiVersion="2.0" modelName="ship" guid="1"'
    if version == 3:
        outputs += "".join(f'<InitialUnknown valueReference="{place[name]}"/>' for name in OUTPUTS)
    return (
        f'<?xml version="1.0"?><fmiModelDescription {head}><CoSimulation modelIdentifier="ship" {able}/>'
        f"<UnitDefinitions>{units}</UnitDefinitions><ModelVariables>{''.join(lines)}</ModelVariables>"
        f"<ModelStructure>{outputs}</ModelStructure></fmiModelDescription>"
    )


def build_ship(
    file: Path, version: int = 2, *, starts: bool = True, branches: bool = False, reset: bool = True
) -> Path:
    """Compile the ship into an FMU; the functions that it lacks give an error."""
    pytest.importorskip("fmpy")
    if shutil.which("gcc") is None:
        pytest.skip("no gcc")
    fmi = import_module(f"fmpy.fmi{version}")
    known = {name for name, _ in inspect.getmembers(getattr(fmi, f"FMU{version}Slave")) if name.startswith("fmi")}
    source = SOURCE.read_text()
    absent = "".join(f"int {name}(void) {{ return 3; }}\n" for name in sorted(known) if f"{name}(" not in source)
    text = file.with_suffix(".c")
    text.write_text(source + absent)
    flags = [f"-DFMI={version}", *(["-DSTARTS"] if starts else []), *([] if reset else ["-DNO_RESET"])]
    built = file.with_suffix(".so")
    subprocess.run(["gcc", "-O1", "-fPIC", "-shared", *flags, "-o", built, text, "-lm"], check=True)
    folder = "binaries/x86_64-linux" if version == 3 else "binaries/linux64"
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", describe(version, starts, branches))
        archive.write(built, f"{folder}/ship.so")
    return file


def write_table(file: Path, starts: bool = True, more: str = "") -> Path:
    """The table of the ship beside it."""
    rows = START_ROWS if starts else dict.fromkeys("uvr", "")
    psi = 'psi = [{ variable = "yaw", unit = "deg", frame = "enu" }, '
    psi += '{ variable = "yaw_0", unit = "deg", frame = "enu", role = "start" }]'
    text = TABLE.format(file=file.name, more=more, **rows)
    if starts:
        text = text.replace('psi = { variable = "yaw", unit = "deg", frame = "enu" }', psi)
    table = file.with_suffix(".toml")
    table.write_text(text)
    return table


def motion_of_ship(states, orders, step, **numbers):
    """Motion (S, K, 6) of the same ship in NumPy, in the axes and units of shipid."""
    p = {**PARAMETERS, **numbers}
    north, east, psi, u, _, r = np.asarray(states, float).T.copy()
    rows, inner = [], round(step / 0.05)
    for delta, n in zip(orders["rudder.delta"].T, orders["propeller.n"].T, strict=True):
        for _ in range(inner):
            v = -p["b"] * r  # the ship drifts outwards
            north, east = (
                north + 0.05 * (u * np.cos(psi) - v * np.sin(psi)),
                east + 0.05 * (u * np.sin(psi) + v * np.cos(psi)),
            )
            psi = psi + 0.05 * r
            u, r = (
                u + 0.05 * (p["K_T"] * n * abs(n) - p["X_uu"] * u * abs(u)),
                r + 0.05 * (p["K"] * u * -delta - r) / p["T"],
            )
        rows.append(np.stack([north, east, psi, u, -p["b"] * r, r], axis=-1))
    return np.stack(rows, axis=1)
