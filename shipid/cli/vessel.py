"""`shipid vessel`: list, show and write vessels."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import Annotated, Any, Literal

import typer

import shipid
from shipid.cli.answer import CRITERIA, Json, open_answer
from shipid.cli.options import VesselName, check_output
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
    from shipid.vessel.schema import PARTICULARS, term_blocks

    ship = shipid.load_vessel(vessel)
    document, particulars = ship.document, ship.document.get("particulars", {})
    known = {key: particulars[key] for key in PARTICULARS if key in particulars}
    terms: list[dict[str, Any]] = [
        {"term": path, "kind": key.split(".")[1], "off": off}
        for off in (False, True)
        for path, key, _ in term_blocks(document, off)
    ]
    with open_answer(as_json) as answer:
        words = [ship.name, document.get("description"), f"file {ship.file}, digest {ship.digest}"]
        text = "\n".join(fill(line, 100, break_long_words=False) for line in words if line)
        answer.say(text, name=ship.name, file=ship.file, digest=ship.digest)
        sentence = ", ".join(f"{key} {value:g} {PARTICULARS[key]}" for key, value in known.items())
        answer.say(fill(f"particulars: {sentence}", 100), particulars=known)
        answer.records("terms", terms)
        rows = [{"path": path, "value": value, "unit": ship.units[path]} for path, value in ship.parameters.items()]
        heads = {"path": "parameter", "value": "value", "unit": "unit"}
        answer.records("parameters", rows, heads, {"value": "{:.10g}".format})


@app.command("new")
def vessel_new(
    length: Annotated[float, typer.Option(help="m, between perpendiculars")],
    beam: Annotated[float, typer.Option(help="m")],
    out: Annotated[Path, typer.Option(help="TOML file to write; an existing file is not overwritten")],
    kind: Annotated[Literal["ship", "usv"], typer.Option(help="usv: a small craft driven by forces")] = "ship",
    draught: Annotated[float | None, typer.Option(help="m, of a ship")] = None,
    block: Annotated[float | None, typer.Option(help="block coefficient of a ship")] = None,
    mass: Annotated[float | None, typer.Option(help="kg, of a usv")] = None,
    thruster: Annotated[
        list[str] | None, typer.Option(help="X,Y in m forward and to starboard of the middle of a usv; one for each")
    ] = None,
    thrust: Annotated[
        float | None, typer.Option(help="N, greatest of each thruster of a usv; default: a guess")
    ] = None,
    swivel: Annotated[float, typer.Option(help="deg to either side that thrusters of a usv turn; 0: fixed")] = 0.0,
    hulls: Annotated[int | None, typer.Option(min=1, max=2, help="of a usv; default: a guess")] = None,
    speed: Annotated[
        float | None, typer.Option(help="m/s: of a ship in service, default a Froude number of 0.2; of a usv the top")
    ] = None,
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
    from shipid.document import check_values
    from shipid.files import write_text
    from shipid.simulation.measured import measure_trials
    from shipid.vessel.template import Particulars, first_guess
    from shipid.vessel.usv import SmallCraft, guess_craft

    check_output(out, endings=(".toml",))
    check_values({"name": name or ""}, "vessel new")
    called, of_usv = name or f"First guess, {length:g} m", kind == "usv"
    of_ships: dict[str, Any] = {
        "draught": draught,
        "block": block,
        "rpm": rpm,
        "shafts": shafts,
        "scale": scale,
        "propeller-diameter": propeller_diameter,
        "rudder-area": rudder_area,
        "tunnel-thruster": tunnel_thruster or None,
        "propulsor": None if propulsor == "propeller-rudder" else propulsor,
        "ship-type": None if ship_type == "cargo" else ship_type,
    }
    of_usvs = {"mass": mass, "thruster": thruster, "thrust": thrust, "hulls": hulls, "swivel": swivel or None}
    needed = {"mass": mass, "speed": speed, "thruster": thruster} if of_usv else {"draught": draught, "block": block}
    if lacking := next((option for option, value in needed.items() if value is None), None):
        raise ShipidError(f"missing: a {kind} needs it", path=f"--{lacking}")
    other = of_ships if of_usv else of_usvs
    if foreign := next((option for option, value in other.items() if value is not None), None):
        raise ShipidError(f"is for a {'ship' if of_usv else 'usv'}: leave it out", path=f"--{foreign}")
    if mass is not None and speed is not None:
        places = tuple(_parse_place(text) for text in thruster or ())
        guessed = guess_craft(SmallCraft(length, beam, mass, speed, places, thrust, swivel, hulls), called, str(out))
    else:
        guessed = first_guess(Particulars(
            length, beam, draught or 0.0, block or 0.0, speed, propulsor, ship_type, rpm, shafts, propeller_diameter,
            rudder_area, tunnel_thruster, scale,
        ), called, str(out))  # fmt: skip
    write_text(out, guessed.text)
    with open_answer(as_json) as answer:
        n, count = guessed.n, len(guessed.vessel.parameters)
        answer.say(f"{count} parameters by formula, none of them measured -> {out}", file=out, parameters=count)
        answer.say(f"{60 * n:.4g} {guessed.unit} hold {guessed.speed:.3g} m/s", n=n, speed=guessed.speed)
        grows = "" if guessed.growth < 0 else f": a small yaw grows e-fold in {1 / guessed.growth:.3g} s"
        answer.say(f"course-{'UNSTABLE' if grows else 'stable'} by these formulae{grows}", growth=guessed.growth)
        judged, notes = measure_trials(guessed.vessel, guessed.speed)
        answer.say("\n".join(guessed.remarks), remarks=guessed.remarks)
        answer.records("criteria", judged, CRITERIA)
        answer.say("\n".join(notes), notes=notes)


@app.command("similar")
def vessel_similar(
    length: Annotated[float | None, typer.Option(min=0.01, max=1e6, help="m, between perpendiculars")] = None,
    beam: Annotated[float | None, typer.Option(min=0.01, help="m")] = None,
    draught: Annotated[float | None, typer.Option(min=0.01, help="m")] = None,
    block: Annotated[float | None, typer.Option(min=0.01, max=1.0, help="block coefficient")] = None,
    speed: Annotated[float | None, typer.Option(min=0.01, help="m/s, in service")] = None,
    vessel: Annotated[
        str | None, typer.Option(help="your own, such as a first guess: its particulars, and commands to take")
    ] = None,
    ships: Annotated[
        Path | None, typer.Option("--from", help="folder of vessels of your own beside bundled ones")
    ] = None,
    number: Annotated[int, typer.Option(min=1, help="of ships")] = 3,
    data: Annotated[Path | None, typer.Option(help="dataset whose first runs rank the ships; needs --vessel")] = None,
    runs: Annotated[int, typer.Option(min=1, help="of the dataset that rank the ships")] = 5,
    out: Annotated[Path | None, typer.Option(help="folder to write a vessel a ship into")] = None,
    as_json: Json = False,
) -> None:
    """Find the ships most like yours and scale them to its length by Froude's law."""
    import tomlkit

    from shipid.files import write_text
    from shipid.study.screen import errors_on_runs
    from shipid.vessel.similar import read_ships, similar_vessels, vessel_particulars

    own = None if vessel is None else shipid.load_vessel(vessel)
    given = {"L_pp": length, "B": beam, "T": draught, "C_b": block, "U_0": speed}
    known = ({} if own is None else vessel_particulars(own)) | {key: x for key, x in given.items() if x is not None}
    if lacking := "length" if "L_pp" not in known else "vessel" if data is not None and own is None else None:
        remedy = {"length": "or a --vessel with particulars.L_pp", "vessel": "whose screws and helms the log drives"}
        raise ShipidError(f"missing: give it, {remedy[lacking]}", path=f"--{lacking}")
    for option, width in (("--beam", beam), ("--draught", draught)):
        if width is not None and width >= known["L_pp"]:
            raise ShipidError(f"{width:g} m: must be below the length, {known['L_pp']:g} m", path=option)
    rows: list[dict[str, Any]] = [
        {"ship": one.key, "distance": distance, "vessel": one}
        for distance, one in similar_vessels(known, read_ships(ships), own)
    ]
    if data is not None:
        errors = errors_on_runs([row["vessel"] for row in rows], shipid.read_dataset(data), runs)
        rows = [row | {"error [m]": error} for row, error in zip(rows, errors, strict=True)]
        rows.sort(key=lambda row: float(row["error [m]"]))
    best = [row.pop("vessel") for row in rows][:number]
    if out is not None:
        for one in best:
            write_text(check_output(out / f"{one.key}.toml", endings=(".toml",)), tomlkit.dumps(one.document))
    with open_answer(as_json) as answer:
        answer.records("ships", rows[:number])
        notes = [f"{one.name}: {one.document['source']}" for one in best]
        answer.say("\n".join(notes), notes=notes)
        answer.say("" if out is None else f"vessels -> {out}", out=out)


def _parse_place(text: str) -> tuple[float, float]:
    """The place X,Y [m] of a thruster; ShipidError for another text."""
    try:
        x, y = map(float, text.split(","))
    except ValueError:
        raise ShipidError(f"{text!r}: write the place as X,Y in m, such as -0.8,0.4", path="--thruster") from None
    return x, y
