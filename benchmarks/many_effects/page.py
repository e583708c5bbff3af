"""The page of sets of many effects."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from benchmarks.many_effects.scores import Row, explained, found, scores, seconds_on_processors, wrong

_HEAD = """# Many effects at once

Written by `python -m benchmarks.many_effects`; do not edit.

Sets of nought to six effects, drawn at random with sizes of half to ten times the typical one. The light
comes from the full render (other seeds, a lamp window 4 cm wide, the real tank), not from the model that the
diagnosis fits; width and absorption that it is told are 10 to 25 % wrong.

| stratum | what |
|---|---|
| clean | nought to six effects in five tanks, errors as stated |
| lamp | six lamps that are no Gaussian, two of them measured (below), with nought to three effects |
| misspecified | wrong errors (below), with nought to four effects |
| unknown | a ripple, a flicker, a shadow or a kink that is in no table, beside one to three effects |
| later | effects that came to the table later: plane gains, a floor, waves, a colour of the water |
| campaign | nought to six effects as the field cases have them (below), half with diffuse light |

A campaign is read in the tank of the field cases, on a line, a grid or fifteen planes, one in eight in a tank
that shows its walls or its surface; every set has a lamp and a water of its own, errors of 0.5 or 0.8 % and a
dark floor, and effects of one to twelve times the typical size, those of the field cases three times as often
as others. Four in ten have a lamp that is no Gaussian, of seven shapes with numbers drawn for each: a flood
with a soft edge, a ring, a pedestal, one darker on its axis, a cusp, a far ring, a power of the angle.

`lamps/measured-spot.csv` and `lamps/measured-flood.csv` name the source of the goniophotometer tables. Wrong
errors: stated half or double as large as they are, correlated from reading to reading (0.4), or two clusters
of successive readings spoiled by 6 to 30 sigma.

**delta** of an effect: by how many sigma the noise-free readings are missed without it, everything else that
was hidden refitted (of a lamp that is no Gaussian its curve too: what the curve can do is not visible).
**Right** is a name that was hidden, or the curve that contains what was; a *set* is right if it has all that
is above 5 sigma and nothing that was not hidden. Diagnoses trace their own light, as the command does.

Explained are all sets but those of the verdict "unexplained": also those in which nothing is found missing.
The aims are figures of the method's prototype, by its own rules: names that are certain are among those that
are the simplest, too, and finding by sigma is counted in clean sets.
"""


def page(rows: Sequence[Row], planned: int) -> str:
    """The page, as Markdown."""
    kinds = Counter(r["stratum"] for r in rows)
    seconds = seconds_on_processors(rows)
    card = sum(r.get("traced_on") == "cuda" for r in rows)
    versions = ", ".join(
        f"{v} ({n} sets)" for v, n in Counter(r.get("code", "-") for r in rows).most_common()
    )
    told = ", ".join(f"{n} {word}" for word, n in sorted(kinds.items()))
    errors = sum(r["verdict"] == "error" for r in rows)
    lines = [
        _HEAD,
        f"**{len(rows)} sets** of {planned} planned ({told}); {errors} ended in an error; light of "
        f"{card} was traced on a graphics card. Code: {versions}.",
    ]
    if len(rows) < planned and len(seconds):
        hours = planned * float(seconds.mean()) / 3600
        lines += [
            "They are a sample of the plan. In brackets: 95 % Clopper-Pearson limits; sets. So few "
            "sets tell a figure of some per cent from none only roughly. The diagnoses of all would take "
            f"{hours:.1f} hours of one processor, the renders and the deltas about as long again "
            "(`--every N` runs every N-th).",
        ]
    lines += ["", "## Scores", "", "| score | measured | release | world class |", "|---|---|---|---|"]
    lines += [f"| {s.name} | {s.value} | {s.release} | {s.world} |" for s in scores(rows)]
    lines += ["", "## Stratum by stratum", "", *_strata(rows), "", "## Set by set", "", *_sets(rows)]
    return "\n".join(lines) + "\n"


def _strata(rows: Sequence[Row]) -> list[str]:
    lines = [
        "| stratum | sets | explained | hidden above 15 sigma, in the best set | "
        "names in best sets, not hidden | "
        "certain, wrong | simplest, wrong |",
        "|---|---|---|---|---|---|---|",
    ]
    groups = [(name, [r for r in rows if r["stratum"] == name]) for name in ("clean", "later", "campaign")]
    campaigns = [r for r in rows if r["stratum"] == "campaign"]
    for lit in (False, True):
        for lamp in (False, True):
            mine = [r for r in campaigns if bool(r["lamp"]) == lamp and (r["draw"] % 2 == 1) == lit]
            light = "with scattered or reflected light" if lit else "direct light"
            groups.append((f"campaign, {light}, {'other' if lamp else 'Gaussian'} lamp", mine))
    for key, word in (("lamp", "lamp "), ("errors", "errors: "), ("unknown", "")):
        for kind in sorted({r[key] for r in rows} - {""}):
            groups.append((word + kind, [r for r in rows if r[key] == kind]))
    for name, some in groups:
        mine = [r for r in some if r["verdict"] != "error"]
        if not mine:
            continue
        clear = [(r, n) for r in mine for n in r["hidden"] if r["delta"][n] > 15]
        cells = [
            name, str(len(mine)), str(sum(map(explained, mine))),
            f"{sum(found(r, n, r['best_set']) for r, n in clear)} of {len(clear)}",
            *(
                f"{sum(len(r[key]) for r in mine)}, {sum(len(wrong(r, r[key])) for r in mine)}"
                for key in ("best_set", "certain", "simplest")
            ),
        ]  # fmt: skip
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _sets(rows: Sequence[Row]) -> list[str]:
    lines = [
        "Bold: not hidden. Missed: above 5 sigma and not in the best set.", "",
        "| set | hidden (delta) | verdict | certain | simplest | one of | partial | missed | error in % |",
        "|---|---|---|---|---|---|---|---|---|",
    ]  # fmt: skip
    return [*lines, *map(_line, rows)]


def _line(row: Row) -> str:
    parts = row["key"].split("/")
    kind = row["lamp"] or row["errors"]
    where = "/".join([*parts[:2], *([kind] if kind else []), *parts[-3:]])
    if row["verdict"] == "error":
        return f"| {where} | {', '.join(row['hidden'])} | error: {row['error'][:80]} | | | | | | |"

    def told(names: Sequence[str]) -> str:
        return ", ".join(f"**{n}**" if wrong(row, [n]) else n for n in names)

    delta = row["delta"]
    hidden = [f"{n} ({delta[n]:.0f})" for n in row["hidden"]]
    hidden += [f"{row['unknown']} ({row['delta_other']:.0f})"] if row["unknown"] else []
    missed = [n for n in row["hidden"] if delta[n] > 5 and not found(row, n, row["best_set"])]
    first, last, floor = row["percent"]
    cells = [
        where, ", ".join(hidden) or "nothing", row["verdict"], told(row["certain"]), told(row["simplest"]),
        "; ".join(" / ".join(s) for s in row["slots"]), told(row["partial"]), ", ".join(missed),
        f"{first:.3g} → {last:.3g} (noise {floor:.2g})",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"
