"""`shipid expect`: the error that the law of exchange expects, before there are data or with more runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from shipid.cli.answer import Json, open_answer
from shipid.errors import ShipidError

HEADS = {"physics": "physics", "N_D": "runs", "H": "H [m]", "low": "95 % from", "high": "to"}
OVER_FIRST = {"ratio": "over the first row", "ratio_low": "95 % from ", "ratio_high": "to "}


def expect_command(
    length: Annotated[float | None, typer.Option(min=0.01, max=1e6, help="m, between perpendiculars")] = None,
    speed: Annotated[float | None, typer.Option(min=0.001, max=1e6, help="m/s, in service")] = None,
    vessel: Annotated[
        str | None, typer.Option(help="bundled name or file, instead of --length and --speed: it is simulated")
    ] = None,
    study: Annotated[Path | None, typer.Option(help="folder of a run: its cells condition the law")] = None,
    kind: Annotated[
        list[str] | None, typer.Option(help="template, sister, identified, model-test, none, ...; may be repeated")
    ] = None,
    a: Annotated[
        float | None,
        typer.Option("--A", min=1e-6, max=1e6, help="m, mean error of the physics alone, of one --kind or any"),
    ] = None,
    runs: Annotated[list[int] | None, typer.Option(min=0, max=100_000, help="that train; may be repeated")] = None,
    ahead: Annotated[
        float | None, typer.Option(min=0.01, max=1000, help="ship lengths at 0.75 of the service speed; default: 2")
    ] = None,
    sea: Annotated[
        Literal["calm", "ordinary", "rough"] | None, typer.Option(help="of a third of the ships; default: of all")
    ] = None,
    law: Annotated[Path | None, typer.Option(help="another law.json")] = None,
    as_json: Json = False,
) -> None:
    """Say what error to expect from a kind of physics and a number of runs, with its 95 % interval."""
    from shipid.exchange import expect
    from shipid.exchange.law import UnseenShip, read_law

    exchange, amounts = read_law(law) if law else read_law(), sorted({*(runs or [4, 12, 40])})
    if sea and (vessel or study):
        raise ShipidError("goes with --length and --speed: a vessel or a study has its own sea", path="--sea")
    idle = {"--length": length, "--speed": speed} | ({"--vessel": vessel, "--ahead": ahead} if study else {})
    for option, value in idle.items():
        if value is not None and (study or vessel):
            raise ShipidError(f"--{'study' if study else 'vessel'} has its own: leave one of the two out", path=option)
    ahead = 2.0 if ahead is None else ahead
    if study is not None:
        import shipid

        cells, ship = expect.study_cells(shipid.read_results(study))
        exchange, ahead = exchange.given(cells), float(cells["ahead"].iloc[0])
        most = int(cells["N_D"].max())
        amounts = amounts if runs else [most, 2 * most, 4 * most]
        foundations = [*dict.fromkeys(cells["foundation"]), *(expect.likely_physics(kind, a) if kind or a else [])]
    else:
        foundations = expect.likely_physics(kind, a)
        if vessel is not None:
            ship = expect.meet_ship(vessel, ahead, Path("expect.toml"))
        elif length is None or speed is None:
            option = "--length" if length is None else "--speed"
            raise ShipidError("missing: give --length and --speed, or --vessel, or --study", path=option)
        else:
            ship = UnseenShip(length, speed, sea=sea or "")
    table = expect.expected_errors(exchange, ship, foundations, amounts, ahead)
    with open_answer(as_json) as answer:
        sentence = expect.expectation_sentence(table.iloc[0], ship, ahead)
        answer.say(sentence, sentence=sentence)
        if len(table) > 1:
            comparison = expect.comparison_sentence(table)
            answer.say(comparison, comparison=comparison)
        answer.warn(expect.sentences_on_limits(exchange, ship, foundations, amounts, ahead))
        answer.records("expected", table, HEADS | OVER_FIRST)
        answer.say(expect.LIMITS.format(**exchange.provenance), law=exchange.provenance)
