"""Pages of the table of methods, one a cell, made from the table itself: equation, use, and the same beam by each."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

EXAMPLE = Path(__file__).parents[2] / "examples" / "beam_hammer" / "beam_hammer.uff"

#: What each realization does, in the notation of the report.
EQUATIONS = {
    "era": r"A = D^{-1/2} P^T H(1)\, Q\, D^{-1/2}, \quad B = D^{1/2} Q^T E_m, \quad C = E_l^T P D^{1/2}, \quad H(0) = P D Q^T",
    "polyreference": r"C A^r = -\sum_{i<r} \tilde P_i\, C A^i, \qquad \tilde P = -P_{nr}\,[E P_n]^{\#}",
    "alternate": r"A = D^{-1/2}\,[E P_n]^{\#}\,[\sigma E P_n]\,D^{1/2}",
    "least_squares": r"\tilde A = H(1)\,H(0)^{\#}",
    "ssi-data": r"O = Y_f / Y_p = P D Q^T, \qquad A = [E P_n D^{1/2}]^{\#}\,[\sigma E P_n D^{1/2}]",
    "ssi-cva": r"R_{ff}^{-1/2}\,O\,R_{pp}^{-T/2} = P D Q^T, \qquad V = R_{ff}^{1/2} P_n D^{1/2}, \qquad A = [E V]^{\#}[\sigma E V]",
    "n4sid": r"O = Y_f /_{U_f} \begin{bmatrix} U_p \\ Y_p \end{bmatrix}, \qquad A = [E V]^{\#}[\sigma E V]",
    "wnsf": r"\min_{A, B, C, K} \| R\,(\hat H - H)\,S^{-1/2} \|^2, \qquad H_k = C\,(A - K C)^k\,[B - K D,\; K]",
    "prce": r"\sum_{i<p} Y(k+i)\, a_i = -Y(k+p) \quad \text{for all } k",
    "loewner": r"H(0)_{ij} = -\frac{V_i - W_j}{\mu_i - \lambda_j} = O R, \qquad "
    r"H(1)_{ij} = -\frac{\mu_i V_i - \lambda_j W_j}{\mu_i - \lambda_j} = O A R, \qquad A = D^{-1/2} P^T H(1)\, Q\, D^{-1/2}",
    "aaa": r"H(x) \approx \frac{\sum_j w_j W_j / (x - \lambda_j)}{\sum_j w_j / (x - \lambda_j)}, \qquad L\, w = \sigma_{\min}, \qquad "
    r"\det\left(\begin{bmatrix} 0 & w^T \\ 1 & \Lambda \end{bmatrix} - x \begin{bmatrix} 0 & 0 \\ 0 & I \end{bmatrix}\right) = 0",
    "vector-fitting": r"\sigma = d + \sum_j \frac{c_j}{x - p_j}, \qquad \min \sum_f \| \sigma H - N \|^2, \qquad "
    r"p \leftarrow \text{eigenvalues of } P - b\,c^T / d",
    "lscf": r"H(z) = N(z)\,D(z)^{-1}, \qquad \min \sum_f \| N(z_f) - H(f)\,D(z_f) \|^2",
}

#: When to use each row.
USE = {
    "era": "Impulse responses, and a model that is balanced: for control, for reduction, for comparison with older results.",
    "polyreference": "To obtain the coefficients of the matrix polynomial: in s, mass, damping and stiffness. It has many extraneous poles, "
    "identified by their amplitude. For modes alone, the row `alternate` gives the same at less cost.",
    "alternate": "The first choice: one factorization serves all orders, and it is the default for responses, records on lines and correlations.",
    "least_squares": "To compare with Ibrahim's method or with dynamic mode decomposition. Its nonzero poles are those of ERA.",
    "ssi-data": "Ambient records, without an estimate of correlations.",
    "ssi-cva": "Ambient records with modes of very different strength: canonical variates weight them equally.",
    "n4sid": "Records with inputs and strong unmeasured forces.",
    "wnsf": "Records with inputs under white unmeasured forces: errors up to a fourth below those of `n4sid`. Under coloured forces, or noise of "
    "sensors alone, `n4sid` or OKID with ERA is better; `realize`, which refines a model to the least errors of prediction, is as near to the "
    "bound or nearer everywhere. No standard deviations of its own (`refine` gives them).",
    "prce": "Impulse responses of few references, to reproduce results of the complex exponential. Damping is biased by noise: nothing is truncated.",
    "loewner": "Frequency responses, whole or in a band, even or uneven lines: no degree of polynomials is chosen, and the model is nearly "
    "balanced. In ambient tests the half spectra of correlations.",
    "aaa": "Responses on lines without much noise, computed ones above all: the smallest rational function through them. Noise is interpolated.",
    "vector-fitting": "Responses on lines where the default has no clear result at low orders, and to compare with electrical models. No standard "
    "deviations of its own (`refine` gives them), and a repeated mode has one shape.",
    "lscf": "Frequency responses of many channels over a wide band, for very clear diagrams. Damping of weak modes is biased low by noise.",
}
#: Name and colour of each column.
DOMAINS = {"time": "samples (time)", "z": "lines of a sampled system (z)", "s": "lines of a continuous structure (s)"}
COLOURS = {"time": "#0072B2", "z": "#D55E00", "s": "#009E73"}


class Example(NamedTuple):
    """Data that a page identifies.

    `side_by_side`: whether the result belongs to the picture of all methods on one beam.
    """

    title: str
    data: Callable[[Any], Any]
    choices: dict[str, Any]
    side_by_side: bool = False


BEAM = Example(
    "The measured beam, 100 to 1700 Hz",
    lambda ms: ms.read(EXAMPLE),
    {"band": (100, 1700), "orders": range(2, 41, 2)},
    side_by_side=True,
)
_CHAIN, _ORDERS = "A simulated chain of five masses", {"orders": range(2, 25, 2)}

#: By what a row takes; responses of the beam for all others.
EXAMPLES = {
    "PAST": Example(
        _CHAIN, lambda ms: ms.systems.chain5().simulate(inputs="ambient", duration=600.0, noise=0.02, seed=1), _ORDERS
    ),
    "DRIVEN": Example(
        _CHAIN, lambda ms: ms.systems.chain5().simulate(duration=100.0, noise=0.02, process_noise=0.1), _ORDERS
    ),
}

#: Choices of rows that count orders otherwise than in states.
CHOICES: dict[str, dict[str, Any]] = {
    "prce": {"orders": range(12, 73, 6)},
    "lscf": {"orders": range(2, 17)},
    "aaa": {"orders": range(2, 21)},
}


def setup(app: Any) -> dict[str, Any]:
    app.connect("builder-inited", lambda app: write_pages(Path(app.srcdir)), priority=100)
    return {"parallel_read_safe": True}


def write_pages(source: Path) -> None:
    """Write the pages and their pictures below `generated/table`; pictures that are there are kept."""
    import modalscope as ms

    folder = source / "generated" / "table"
    folder.mkdir(parents=True, exist_ok=True)
    cells = [m for m in ms.methods() if m.takes.name != "RECORDS"]  # these rows stand twice
    tables = {(m.name, m.domain): _identified(ms, m, folder) for m in cells}
    for m in cells:
        (folder / f"{_slug(m)}.md").write_text(_page(m, tables[m.name, m.domain]), encoding="utf-8")
    (folder / "index.md").write_text(_index(cells), encoding="utf-8")
    _landing(cells, tables, folder)


def _slug(m: Any) -> str:
    return f"{m.name.replace('_', '-')}-{m.domain}"


def _example(m: Any) -> Example:
    return EXAMPLES.get(m.takes.name, BEAM)


def _identified(ms: Any, m: Any, folder: Path) -> str:
    """Identify the example of one cell, draw its diagram, and return the table of its modes."""
    picture, table = folder / f"{_slug(m)}.png", folder / f"{_slug(m)}.txt"
    if not (picture.exists() and table.exists()):
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            choices = _example(m).choices | CHOICES.get(m.name, {})
            diagram = ms.stabilize(_example(m).data(ms), method=m.name, domain=m.domain, **choices)
        modes = ms.select(diagram)
        figure = ms.plot.stabilization(diagram, modes).figure
        figure.savefig(picture, dpi=90)
        pyplot.close(figure)
        table.write_text(modes.table(), encoding="utf-8")
    return table.read_text(encoding="utf-8")


def _page(m: Any, table: str) -> str:
    names = ", ".join(m.known_as)
    aliases = ", ".join(f"`{name}`" for name in m.aliases) or "no other"
    options = ", ".join(f"`{name}`" for name in m.options_type.__dataclass_fields__)
    return f"""# {m.label}

`method="{m.name}", domain="{m.domain}"` · {m.realization} of {DOMAINS[m.domain]} · report: {m.section}

$$
{EQUATIONS[m.name]}
$$

**When to use it.** {USE[m.name]}

**In the literature.** {names}. Accepted names: {aliases}.

**It takes** {m.takes.value}.

## {_example(m).title}

![Stabilization diagram by {m.label}]({_slug(m)}.png)

```text
{table}
```

**Options of its data matrix**: {options}.
"""


def _index(cells: list[Any]) -> str:
    rows = dict.fromkeys(m.name for m in cells)
    lines = ["| | " + " | ".join(DOMAINS.values()) + " |", "|---|---|---|---|"]
    by = {(m.name, m.domain): m for m in cells}
    for name in rows:
        links = [f"[{by[name, d].common}]({_slug(by[name, d])}.md)" if (name, d) in by else "" for d in DOMAINS]
        realization = next(m.realization for m in cells if m.name == name)
        lines.append(f"| **{name}**: {realization} | " + " | ".join(links) + " |")
    tree = "\n".join(f"{m.label} <{_slug(m)}>" for m in cells)
    return f"""# The table

Every method is a data matrix and a realization. This table is generated from that of the program; each cell has a page with its
equation, its use, and its modes of the same beam.

{chr(10).join(lines)}

## Which method should I use?

| data | method | reason |
|---|---|---|
| any | the default | the default of each kind of data is the row that performed best on its kind |
| frequency responses | `alternate`, s (the default) | exact for continuous structures, no leakage at the band limits, standard deviations |
| frequency responses, very many channels | `polymax` | fast, clear diagrams; check damping with `alternate` |
| impulse responses, free decays | `era` or `itd` | samples need no transform |
| records of forces and responses | the default: records on lines | no intermediate estimate: no windows, no averages, no leakage |
| records with strong unmeasured forces | `n4sid` | past inputs and outputs as instruments |
| ambient records | `ssi-cov` (the default), then `ssi-data` | modes of both are reliable |
| a model for control, from records | `ms.realize(record)` | several rows are tried at many orders on a part that is held out; stable |
| a model for control, from responses | `era`, by `ms.realize` | balanced |
| mass, damping and stiffness | `polyreference`, s | a sensor at each mass: M^-1 K and M^-1 D |
| not sure | `ms.compare(data)` | all methods, their disagreements and the causes |

```{{toctree}}
:hidden:

{tree}
```
"""


def _landing(cells: list[Any], tables: dict[Any, str], folder: Path) -> None:
    """Draw the landing picture: the modes of the beam by each method, side by side."""
    target = folder / "side-by-side.png"
    if target.exists():
        return
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    shown = [m for m in cells if _example(m).side_by_side]
    figure = Figure(figsize=(9, 0.34 * len(shown) + 1.7), layout="constrained")
    ax = figure.add_subplot()
    for k, m in enumerate(shown):
        rows = [line.split() for line in tables[m.name, m.domain].splitlines()[1:] if line.split()]
        values = [float(row[1]) for row in rows]
        ax.plot(values, [k] * len(values), "o", color=COLOURS[m.domain], markersize=6)
    for f in (177.0, 477.4, 933.1, 1535.5):
        line = ax.axvline(f, color="#B4BEC9", linewidth=1.5, zorder=0)
    marks = [Line2D([], [], ls="", marker="o", color=color, label=DOMAINS[name]) for name, color in COLOURS.items()]
    line.set_label("published by the authors of the data")
    figure.legend(handles=[*marks, line], loc="outside lower center", ncols=2, frameon=False)
    ax.set_yticks(range(len(shown)), [m.label for m in shown])
    ax.invert_yaxis()
    ax.set_xlim(100, 1700)
    ax.set_xlabel("frequency [Hz]")
    ax.set_title("Modes of one measured beam by each method", loc="left", fontweight="bold")
    figure.savefig(target, dpi=100)
