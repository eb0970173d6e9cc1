"""A branch of solutions, drawn by matplotlib: measures along the parameter, and what happens there."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly.studies.branches.result import Branch

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_branch"]

# How events are marked.
_MARKS = {
    "turning point": "o",
    "crossing": "X",
    "end of range": "|",
    "closed loop": ".",
    "contact closed": "v",
    "contact opened": "^",
    "contact over an edge": "D",
}


def plot_branch(branch: Branch) -> Figure:
    """See `Branch.plot`."""
    try:
        from matplotlib import pyplot
    except ImportError:
        raise ImportError("plots need matplotlib, which is not installed; install the extra plot") from None
    names = [f"{item.name} [{item.unit}]" for item in branch.of] or ["length along the branch"]
    columns = branch.measures.T if branch.of else [branch.lengths]
    kinds = sorted({event.kind for event in branch.events})
    figure, axes = pyplot.subplots(len(names), 1, figsize=(7.0, 3.0 * len(names)), squeeze=False, layout="constrained")
    for panel, name, column in zip(axes[:, 0], names, columns, strict=True):
        panel.plot(branch.values, column, color="tab:blue", linewidth=1.2)
        for k, kind in enumerate(kinds):
            events = branch.events_of(kind)
            places = [event.value for event in events], [column[event.row] for event in events]
            panel.plot(*places, _MARKS.get(kind, "s"), color=f"C{k + 1}", label=kind)
        if not branch.proved.all():
            panel.plot(branch.values[~branch.proved], column[~branch.proved], "x", color="black", label="not proved")
        panel.set_xlabel(f"{branch.parameter.name} [{branch.parameter.unit or '1'}]")
        panel.set_ylabel(name)
        panel.legend(frameon=False)
    return figure
