"""Draws an outline of a figure, made by the program, with matplotlib: in the style of `sweep report --figure`."""

_MARKERS = {
    "circle": "o",
    "square": "s",
    "triangle": "^",
    "diamond": "D",
    "triangle-down": "v",
    "plus": "+",
    "cross": "x",
    # Around the markers of other points.
    "ring": "o",
    "frame": "s",
}
_AROUND = ["ring", "frame"]
_INCH = 72.0  # points, in which lengths of the outline are
_HOLLOW = "hollow-"


def draw(outline, ax=None):
    """Draws into `ax`, or into a figure of the outline's size; returns the axes."""
    small, large = outline["tick_size"], outline["label_size"]
    (panel,) = outline["panels"]
    if ax is None:
        from matplotlib import pyplot

        entries = sum(bool(curve["label"]) for curve in panel["curves"]) + bool(panel["dashed"])
        # A gap above the legend, and its rows.
        legend = 0.6 * large + 1.35 * small * entries if entries else 0
        height = outline["panel_height"] + legend
        size = (outline["width"] / _INCH, height / _INCH)
        _, ax = pyplot.subplots(figsize=size, layout="constrained")
    for curve in panel["curves"]:
        _draw_curve(ax, curve)
    x, y = panel["x"], panel["y"]
    if panel["shaded"] is not None:
        ax.axvspan(x["low"], panel["shaded"], color="#ebebeb", zorder=0, linewidth=0)
    for place in x["breaks"]:
        ax.axvline(place, color="#bbbbbb", linewidth=0.6, linestyle=(0, (1, 3)), zorder=0)
    for number, height in enumerate(panel["dashed"]):
        style = {"color": "#555555", "linewidth": 0.7, "linestyle": (0, (6, 4)), "zorder": 0}
        ax.axhline(height, label=panel["dashed_label"] if number == 0 else None, **style)
    _draw_axis(ax.xaxis, ax.set_xlim, ax.set_xscale, x)
    _draw_axis(ax.yaxis, ax.set_ylim, ax.set_yscale, y)
    label = "\n".join(filter(None, [x["label"], outline["note"]]))
    ax.set_xlabel(label, fontsize=large)
    ax.set_ylabel(y["label"], fontsize=large)
    ax.tick_params(labelsize=small, direction="in", which="both")
    if panel["dashed"] or any(curve["label"] for curve in panel["curves"]):
        ax.legend(
            loc="upper left",
            bbox_to_anchor=(0, -0.2),
            fontsize=small,
            frameon=False,
        )
    return ax


def _draw_axis(axis, set_limits, set_scale, scale):
    if scale["logarithmic"]:
        set_scale("log")
    set_limits(scale["low"], scale["high"])
    axis.set_ticks([place for place, _ in scale["ticks"]], [text for _, text in scale["ticks"]])
    axis.set_ticks(scale["minor"], ["" for _ in scale["minor"]], minor=True)


def _draw_curve(ax, curve):
    _draw_marks(ax, curve)
    if not curve["points"]:
        return
    places, heights, below, above = zip(*curve["points"])
    colour, marker = curve["colour"], curve["marker"]
    style = {"color": colour, "linewidth": 0, "label": curve["label"] or None}
    if marker is None:
        style |= {"linewidth": curve["width"]}
        if curve["dashes"] is not None:
            style["linestyle"] = (0, tuple(length / curve["width"] for length in curve["dashes"]))
    else:
        is_hollow = marker.startswith(_HOLLOW)
        style |= {
            "marker": _MARKERS[marker.removeprefix(_HOLLOW)],
            "markersize": 2 * curve["marker_size"],
            "markerfacecolor": "none" if marker in _AROUND else "white" if is_hollow else colour,
            "markeredgewidth": 0.8 * curve["width"],
        }
    for start, end, height in curve["across"]:
        middle, half = (start + end) / 2, (end - start) / 2
        ax.errorbar(middle, height, xerr=half, fmt="none", ecolor=colour, capsize=1.8, elinewidth=0.8 * curve["width"])
    if marker is None:
        # A run in time, or the mean of several: one piece, unless a sample has no viscosity.
        for number, (first, last) in enumerate(curve["pieces"]):
            if curve["has_band"]:
                piece = list(zip(places, heights, below, above))[first : last + 1]
                ends = [[y - down for _, y, down, _ in piece], [y + up for _, y, _, up in piece]]
                ax.fill_between([x for x, *_ in piece], *ends, color=colour, alpha=0.22, linewidth=0)
            label = style.pop("label", None) if number == 0 else None
            ax.plot(places[first : last + 1], heights[first : last + 1], label=label, **style)
        return
    if curve["has_intervals"]:
        style |= {"capsize": 1.8, "elinewidth": 0.8 * curve["width"]}
        ax.errorbar(places, heights, yerr=(below, above), zorder=3, **style)
    else:
        ax.plot(places, heights, zorder=3, **style)
    for first, last in curve["pieces"]:
        ax.plot(places[first : last + 1], heights[first : last + 1], color=colour, linewidth=curve["width"])


def _draw_marks(ax, curve):
    """Crosses for points without a result, on the lower edge, and for jammed runs."""
    edge = ax.get_xaxis_transform()
    cross = {"marker": "x", "linewidth": 0, "color": curve["colour"]}
    for place in curve["missing"]:
        ax.plot([place], [0.02], markersize=1.6 * curve["marker_size"], transform=edge, **cross)
    for place, height in curve["jammed"]:
        at = ([place], [0.97], edge) if height is None else ([place], [height], ax.transData)
        ax.plot(*at[:2], markersize=2.0 * curve["marker_size"], transform=at[2], **cross)
