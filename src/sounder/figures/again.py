"""Axes that are drawn into again for the next product: to make axes with their ticks takes as long as to draw them."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.colorbar import Colorbar


def clear(ax: Axes) -> list[Colorbar]:
    """Remove what was drawn into axes. Ticks, labels and the colour bars, which are returned, stay.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> ax = Figure().add_subplot()
    >>> bar = colour_bar(ax.imshow([[1, 2]]), ax, [], label="one")
    >>> clear(ax) == [bar], len(ax.images)
    (True, 0)
    """
    bars = [bar for drawn in (*ax.images, *ax.collections) if (bar := drawn.colorbar) is not None]
    for container in tuple(ax.containers):
        container.remove()
    for drawn in (*ax.images, *ax.collections, *ax.lines):
        drawn.remove()
    if (legend := ax.get_legend()) is not None:
        legend.remove()
    ax.set_prop_cycle(None)
    ax.relim()
    ax.autoscale(axis="y")
    return bars


def colour_bar(drawn: Any, ax: Axes, bars: list[Colorbar], **options: Any) -> Colorbar:
    """Colour bar of what was drawn into axes: the first of ``bars``, which is taken from them, or a new one.

    Parameters
    ----------
    drawn : matplotlib.cm.ScalarMappable
    ax : matplotlib.axes.Axes
    bars : list of matplotlib.colorbar.Colorbar
        From :func:`clear`, made with the same options but for their label.
    **options
        Of ``Figure.colorbar``.
    """
    if not bars:
        figure = ax.get_figure(root=True)
        assert figure is not None
        return figure.colorbar(drawn, ax=ax, **options)
    bar = bars.pop(0)
    drawn.autoscale_None()
    drawn.colorbar = bar
    bar.update_normal(drawn)
    bar.set_label(options["label"])
    return bar
