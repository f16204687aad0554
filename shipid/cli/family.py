"""`shipid family`: families of degraded vessels in a document of their own, drawn, simulated, locked."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import shipid
from shipid.cli.answer import Json, open_answer
from shipid.cli.options import VesselName

app = typer.Typer(no_args_is_help=True, help="Families: vessels made worse by rules, drawn, simulated, locked.")
FamilyDocumentName = Annotated[str, typer.Argument(help="document of families, lock or study: path, or bundled study")]
FamilyName = Annotated[str | None, typer.Option("--family", help="which, where the document has several")]


@app.command("new")
def family_new(
    vessel: VesselName,
    out: Annotated[Path, typer.Option(help="TOML file to write; an existing file is not overwritten")],
    members: Annotated[int, typer.Option(min=1, help="of each family that is drawn")] = 20,
) -> None:
    """Write a document of families for a vessel: as it is, with wrong damping, with wrong inertia too."""
    from shipid.files import write_new
    from shipid.study.new import draft_families

    typer.echo(f"families -> {write_new(draft_families(vessel, members, out), out)}")


@app.command("show")
def family_show(
    document: FamilyDocumentName,
    family: FamilyName = None,
    csv: Annotated[Path | None, typer.Option(help="table to write: a row a member, two columns a number")] = None,
    as_json: Json = False,
) -> None:
    """Show the families of a document; of one, each number in the base and over the members."""
    chosen = {"family": shipid.read_family(document, family)} if family or csv else shipid.read_families(document)
    with open_answer(as_json) as answer:
        for name, one in chosen.items():
            base, rules, table = one.base, one.rules, one.table()
            answer.say(f"{rules.name}: {rules.members} of {base.name}, seed {rules.seed}, {rules.sample}")
            rows = [
                {"number": path, "base": base.parameters[path], "unit": base.units[path]}
                | {"least": table[path, "value"].min(), "greatest": table[path, "value"].max()}
                | {"factors": f"{ends['min']:.3g}..{ends['max']:.3g}" if ends.notna().all() else "none"}
                for path in one.members[0].values
                for ends in [table[path, "factor"].agg(["min", "max"])]
            ]
            answer.records(name, rows, formats=dict.fromkeys(("base", "least", "greatest"), "{:.4g}".format))
            answer.save("table", csv, table.set_axis(table.columns.map(" ".join), axis=1).reset_index())


@app.command("diff")
def family_diff(
    document: FamilyDocumentName,
    other: Annotated[str, typer.Argument(help="the other document, lock or study")],
    family: FamilyName = None,
    as_json: Json = False,
) -> None:
    """Compare a family of two documents: base and rules, and how many members have another value of a number.

    Of a lock the values that it holds count.
    """
    from shipid.simulation.families import compare_contents, read_content

    one, two = (read_content(name, family) for name in (document, other))
    changes = {path: pair for path, pair in compare_contents(one, two).items() if not path.startswith("values.")}
    values = [path.rpartition(".")[0] for path in compare_contents(one["values"], two["values"])]
    with open_answer(as_json) as answer:
        answer.records("rules", [{"what": path, "one": a, "other": b} for path, (a, b) in changes.items()])
        counts = [{"number": path, "members that differ": values.count(path)} for path in dict.fromkeys(values)]
        answer.records("numbers", counts)
        answer.say("" if changes or values else "the same members, bit for bit")


@app.command("rollout")
def family_rollout(
    document: FamilyDocumentName,
    manoeuvre: Annotated[str, typer.Argument(help="zigzag, turning, pull-out, spiral or stop")] = "zigzag",
    angles: Annotated[list[float] | None, typer.Argument(help="helm in deg, of a zigzag also the heading")] = None,
    family: FamilyName = None,
    approach: Annotated[str, typer.Option(help="helmsman (holds the course), steady or rest")] = "helmsman",
    csv: Annotated[Path | None, typer.Option(help="CSV or Parquet file of all motions to write")] = None,
    html: Annotated[Path | None, typer.Option(help="figure of the spread to write")] = None,
    as_json: Json = False,
) -> None:
    """Simulate a standard manoeuvre of all members in one rollout: how far they come apart, and which diverge."""
    drawn = shipid.read_family(document, family)
    done = drawn.trajectories(manoeuvre, angles or (), approach=approach)
    frame, lost = drawn.motion_table(done), drawn.divergence_times(done)
    spread = frame.groupby("member").last().drop(columns="t").quantile([0.05, 0.5, 0.95]).T
    with open_answer(as_json) as answer:
        answer.say(
            f"{drawn.base.name}: {len(drawn.members)} members after {frame['t'].max():g} s, {len(lost) or 'none'} "
            f"diverged; spread of {len(drawn.members) - len(lost)}, SI units"
        )
        answer.records("spread", spread.set_axis(["5 %", "median", "95 %"], axis=1).reset_index(names="channel"))
        answer.records("diverge", [{"member": name, "diverges at [s]": time} for name, time in lost.items()])
        answer.save("motions", csv, frame)
        if html is not None:
            shipid.figures.spread(done).write_html(html)
            answer.say(f"figure -> {html}", figure=html)


@app.command("export")
def family_export(
    document: FamilyDocumentName,
    out: Annotated[Path, typer.Option(help="folder to write a lock and a vessel patch a member into")],
    family: FamilyName = None,
) -> None:
    """Write a lock with all values and digests to cite, and a patch document of each member."""
    typer.echo(f"lock -> {shipid.read_family(document, family).export(out)}")


@app.command("verify")
def family_verify(lock: Annotated[Path, typer.Argument(help="lock, as of `family export`")]) -> None:
    """Draw and simulate the family of a lock again, and compare base, rules, every value and what diverges."""
    typer.echo(f"as locked: digest {shipid.verify_lock(lock)}")
