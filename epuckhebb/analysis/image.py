"""The look of figures, and a figure as PNG, SVG or PDF, in the size of a column or a page of a paper if asked for.

Figures are opaque and white with a margin, so that they can be read on a dark page, too.
"""

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from matplotlib import rc_context, rcdefaults, rcParams
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.lines import Line2D
from matplotlib.text import Text
from PIL import Image

KINDS = ("png", "svg", "pdf")
_LEAST_PT = 6.0  # letters that can still be read in print
MM = 25.4  # of an inch
_NO_DATE = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}


_STYLE: dict[Any, Any] = {
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.w_pad": 0.12,  # inches
    "figure.constrained_layout.h_pad": 0.1,
    "figure.titlesize": 10,
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.6,
    "errorbar.capsize": 1.5,
    "lines.linewidth": 1.3,
    "lines.markersize": 5,
    "legend.frameon": False,
    "legend.fontsize": 9,
}


@contextmanager
def house_style() -> Iterator[None]:
    """Draw with the settings of the program, not with those of a user's `matplotlibrc`."""
    with rc_context():
        rcdefaults()
        rcParams.update(_STYLE)
        yield


def plain(text: str) -> str:
    """The text as matplotlib shows it unchanged, not as mathematics; `?` for each sign that its font lacks."""
    signs = get_font(findfont(FontProperties())).get_charmap()
    return "".join(sign if sign == "\n" or ord(sign) in signs else "?" for sign in text).replace("$", r"\$")


@house_style()
def image(figure: Figure, kind: str = "png", width_mm: float | None = None) -> bytes:
    """The figure as a file, without date or program: equal figures are bit-identical.

    kind: png, svg or pdf. width_mm: of the file; None for the width of the drawing. Letters shrink with it, down to 6
    points.

    Raises:
        ValueError: There is no room for what is drawn beside its letters.
    """
    if width_mm:
        _resize(figure, width_mm)
    buffer = io.BytesIO()
    dpi = 300 if width_mm else 120
    # Letters stay letters, as publishers ask.
    with rc_context({"svg.hashsalt": "epuckhebb", "pdf.fonttype": 42}), warnings.catch_warnings():
        warnings.filterwarnings("error" if width_mm else "default", "constrained_layout not applied")
        try:
            figure.savefig(buffer, format=kind, dpi=dpi, metadata=_NO_DATE[kind])
        except UserWarning as error:
            raise ValueError(f"this figure has no room in {width_mm:g} mm; give more") from error
    return buffer.getvalue()


def _resize(figure: Figure, width_mm: float) -> None:
    """Scale a figure to a width, letters and lines with it; letters stay large enough to be read."""
    width, height = figure.get_size_inches()
    share = width_mm / MM / width
    figure.set_size_inches(width * share, height * share)
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            size = axis.get_tick_params().get("labelsize")
            axis.set_tick_params(labelsize=max(_LEAST_PT, share * (size or 10.0)))
    for text in figure.findobj(Text):
        text.set_fontsize(max(_LEAST_PT, share * text.get_fontsize()))
    for line in figure.findobj(Line2D):
        line.set(linewidth=share * line.get_linewidth(), markersize=share * line.get_markersize())


def small(png: bytes) -> bytes:
    """A picture in 256 colours, a third of the size, for a report."""
    buffer = io.BytesIO()
    Image.open(io.BytesIO(png)).convert("RGB").quantize(256).save(buffer, format="png", optimize=True)
    return buffer.getvalue()
