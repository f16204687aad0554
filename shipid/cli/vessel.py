"""`shipid vessel`: list, show and write vessels."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from shipid.cli.answer import Json, open_answer
from shipid.cli.options import VesselName
from shipid.cli.terminal import criterion_table, text_table
from shipid.errors import ShipidError

app = typer.Typer(no_args_is_help=True, help="Vessels: declared ships, bundled or in a file.")


@app.command("list")
def vessel_list(as_json: Json = False) -> None:
    """List the bundled vessels."""
    from shipid.document import bundled_documents, read_document

    rows = [{"name": name, "vessel": read_document(file)["name"]} for name, file in bundled_documents("models").items()]
    with open_answer(as_json) as answer:
        answer.records("vessels", rows)


@app.command("show")
def vessel_show(
    vessel: VesselName,
    as_json: Json = False,
) -> None:
    """Show particulars, terms, and every parameter with its dotted path and unit."""
    from shipid.vessel.load import load_vessel
    from shipid.vessel.schema import PARTICULARS, term_blocks

    ship = load_vessel(vessel)
    document = ship.document
    terms: list[dict[str, Any]] = [
        {"term": path, "kind": key.split(".")[1], "off": off}
        for off in (False, True)
        for path, key, _ in term_blocks(document, off)
    ]
    known = {key: document["particulars"][key] for key in PARTICULARS if key in document.get("particulars", {})}
    with open_answer(as_json) as answer:
        words = [ship.name, document.get("description"), f"file {ship.file}, digest {ship.digest}"]
        answer.say("\n".join(filter(None, words)), name=ship.name, file=ship.file, digest=ship.digest)
        sentence = ", ".join(f"{key} {value:g} {PARTICULARS[key]}" for key, value in known.items())
        answer.say(f"particulars: {sentence}", particulars=known)
        rows = ((t["term"], t["kind"] + ", off" * t["off"]) for t in terms)
        answer.rows("terms", terms, text_table(["term", "kind"], rows))
        for path, _, block in term_blocks(document):
            if "table" in block:
                omega, beta = block["table"]["omega"], block["table"]["beta_deg"]
                ends = f"{min(omega):g} to {max(omega):g} rad/s"
                answer.say(f"{path}: {ends}, {len(set(beta))} headings from 0 to 180 deg")
        answer.rows(
            "parameters",
            [{"path": path, "value": value, "unit": ship.units[path]} for path, value in ship.parameters.items()],
            text_table(["parameter", "value", "unit"], _parameter_rows(ship.parameters, ship.units)),
        )


@app.command("new")
def vessel_new(
    length: Annotated[float, typer.Option(help="m, between perpendiculars")],
    beam: Annotated[float, typer.Option(help="m")],
    draught: Annotated[float, typer.Option(help="m")],
    block: Annotated[float, typer.Option(help="block coefficient")],
    out: Annotated[Path, typer.Option(help="TOML file to write; an existing file is not overwritten")],
    speed: Annotated[float | None, typer.Option(help="m/s, in service; default: a Froude number of 0.2")] = None,
    rpm: Annotated[float | None, typer.Option(help="of the screw at that speed; default: a guess")] = None,
    propulsor: Annotated[
        str, typer.Option(help="propeller-rudder, azimuth, or differential: two screws")
    ] = "propeller-rudder",
    shafts: Annotated[int | None, typer.Option(help="1 or 2; default: 1 with a rudder, else 2")] = None,
    propeller_diameter: Annotated[float | None, typer.Option(help="m; default: a guess")] = None,
    rudder_area: Annotated[float | None, typer.Option(help="m^2, of each rudder; default: a guess")] = None,
    tunnel_thruster: Annotated[bool, typer.Option("--tunnel-thruster", help="there is one at the bow")] = False,
    scale: Annotated[
        float | None,
        typer.Option(
            help="of a model: ship length over model length; 1: a ship; default: that of a ship of 160 m if below 10 m"
        ),
    ] = None,
    ship_type: Annotated[str, typer.Option(help="for the wind: cargo, tanker, research, ...")] = "cargo",
    name: Annotated[str | None, typer.Option(help="for people; default: first guess and length")] = None,
    as_json: Json = False,
) -> None:
    """Write a first guess of a vessel from its main particulars: runnable, each number with its formula."""
    if out.suffix != ".toml":
        raise ShipidError("a vessel is a TOML file: let the name end in .toml", file=out)
    if out.exists():
        raise ShipidError("exists already: choose another name", file=out)
    from shipid.document import check_values
    from shipid.files import write_text
    from shipid.simulation.measured import measure_trials
    from shipid.vessel.template import Particulars, first_guess

    check_values({"name": name or ""}, "vessel new")
    given = Particulars(
        length, beam, draught, block, speed, propulsor, ship_type, rpm, shafts, propeller_diameter, rudder_area,
        tunnel_thruster, scale,
    )  # fmt: skip
    guessed = first_guess(given, name or f"First guess, {length:g} m", str(out))
    write_text(out, guessed.text)
    with open_answer(as_json) as answer:
        count = len(guessed.vessel.parameters)
        answer.say(f"{count} parameters by formula, none of them measured -> {out}", file=out, parameters=count)
        answer.say(f"{60 * guessed.n:.4g} rpm hold {given.service:.3g} m/s", n=guessed.n, speed=given.service)
        if guessed.growth < 0:
            answer.say("course-stable by these formulae", growth=guessed.growth)
        else:
            grows = f"a small yaw grows e-fold in {1 / guessed.growth:.3g} s"
            answer.say(f"course-UNSTABLE by these formulae: {grows}", growth=guessed.growth)
        judged, notes = measure_trials(guessed.vessel, given.service)
        answer.say("\n".join(guessed.remarks), remarks=guessed.remarks)
        answer.rows("criteria", judged, criterion_table(judged, []) if judged else None)
        answer.say("\n".join(notes), notes=notes)


def _parameter_rows(values: dict[str, float], units: dict[str, str]) -> Iterator[tuple[str, str, str]]:
    """Yield rows of dotted path, value, unit; the entries of one table column, `path.0`, `path.1`, ..., share a row."""
    import re
    from itertools import groupby

    for stem, group in groupby(values, key=lambda path: re.sub(r"\.\d+$", "", path)):
        paths = list(group)
        if len(paths) == 1:
            yield paths[0], f"{values[paths[0]]:.10g}", units[paths[0]]
        else:
            yield f"{stem}.0 ... .{len(paths) - 1}", " ".join(f"{values[p]:g}" for p in paths), units[paths[0]]
