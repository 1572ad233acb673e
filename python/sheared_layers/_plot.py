"""Draws an outline of a figure, made by the program, with matplotlib: the same look as `sweep report --figure`."""

_MARKERS = {
    "circle": "o",
    "square": "s",
    "triangle": "^",
    "diamond": "D",
    "triangle-down": "v",
    "plus": "+",
    "cross": "x",
    "star": "*",
}
_INCH = 96.0  # pixels of the outline
_POINT = 72.0 / _INCH  # points of matplotlib per pixel


def draw(outline, ax=None):
    """Draws into `ax`, or into a figure of the outline's size; gives the axes back."""
    small, large = outline["tick_size"] * _POINT, outline["label_size"] * _POINT
    if ax is None:
        from matplotlib import pyplot

        size = (outline["width"] / _INCH, outline["height"] / _INCH)
        _, ax = pyplot.subplots(figsize=size, layout="constrained")
    for curve in outline["lines"]:
        _draw_curve(ax, curve)
    x, y = outline["x"], outline["y"]
    if y["logarithmic"]:
        ax.set_yscale("log")
    elif y["from_zero"]:
        ax.set_ylim(bottom=0)
    if (decades := x["decades"]) is not None:
        ax.set_xlim(decades["left"], decades["right"])
        ticks = [(place, text) for place, text in decades["ticks"] if text]
        ax.set_xticks([place for place, _ in ticks], [text for _, text in ticks])
        _draw_lines(ax.axvline, decades["breaks"])
    _draw_lines(ax.axhline, outline["dashed"])
    ax.set_xlabel(x["label"], fontsize=large)
    ax.set_ylabel(y["label"], fontsize=large)
    ax.tick_params(labelsize=small)
    if any(curve["label"] for curve in outline["lines"]):
        ax.legend(
            loc="upper left",
            bbox_to_anchor=(0, -0.2),
            fontsize=small,
            frameon=False,
        )
    return ax


def _draw_curve(ax, curve):
    places, heights, below, above = zip(*curve["points"])
    style = {
        "color": curve["colour"],
        "linewidth": curve["width"] * _POINT,
        "label": curve["label"] or None,
    }
    if curve["marker"] is not None:
        style["marker"] = _MARKERS[curve["marker"]]
        style["markersize"] = 2 * curve["marker_size"] * _POINT
    if curve["has_intervals"]:
        ax.errorbar(places, heights, yerr=(below, above), capsize=2, elinewidth=_POINT, **style)
    else:
        ax.plot(places, heights, **style)


def _draw_lines(line, lines):
    for place in lines["places"]:
        line(
            place,
            color=lines["colour"],
            linewidth=lines["width"] * _POINT,
            linestyle=(0, tuple(length / lines["width"] for length in lines["dashes"])),
            zorder=0,
        )
