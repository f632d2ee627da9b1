"""Draws plots as SVG: panels below each other with axes, lines, bands, dots, marks and a legend. Standard library only.

    plot = Plot("Figure 7", "the closed loop in the fabric softener")
    panel = plot.panel("position (m)", height=240, x=(0, 40), y=(-0.02, 0.12))
    panel.line(t_s, position_m, BLUE, "believed")
    plot.x_title("time (s)")
    pathlib.Path("figure_7.svg").write_text(plot.svg())

A value that is None or not finite interrupts a line. Axes are linear, or with `x_log` logarithmic.
"""
import html
import math

WIDTH, LEFT, RIGHT = 760, 74, 18  # pixels
TITLE_PX, LEGEND_PX, GAP_PX, X_TITLE_PX = 46, 20, 40, 42
LETTER_PX = 6.9  # of a legend, on average
INK, GREY, GRID, FRAME = "#1b2a33", "#5b6b73", "#e6ebed", "#8b9aa1"
BLUE, RED, SETPOINT = "#1f6fb2", "#c8402f", "#6b7a82"


def ticks(low, high, count):
    """(round values between the two, decimals that they need)."""
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [k * step for k in range(first, last + 1)], max(0, -math.floor(math.log10(step) + 1e-9))


def number(value, decimals):
    return f"{value + 0.0:.{decimals}f}".replace("-", "−") if round(value, decimals) else f"{0:.{decimals}f}"


class Panel:
    def __init__(self, title, top, height, x, y, x_log=False, part=(0, 1)):
        self.title, self.top, self.height, self.x_range, self.y_range, self.x_log = title, top, height, x, y, x_log
        self.left, self.right = (LEFT + share * (WIDTH - LEFT - RIGHT) for share in part)
        self.parts, self.legend = [], []

    def x(self, value):
        low, high = self.x_range
        if self.x_log:
            low, high, value = math.log10(low), math.log10(high), math.log10(value)
        return self.left + (value - low) / (high - low) * (self.right - self.left)

    def y(self, value):
        low, high = self.y_range
        return self.top + (high - value) / (high - low) * self.height

    def line(self, xs, values, colour, label="", dash="", width=1.6):
        """Straight from point to point."""
        path, pen_is_down = [], False
        for x, value in zip(xs, values):
            if value is None or not math.isfinite(value):
                pen_is_down = False
                continue
            path.append(f"{'L' if pen_is_down else 'M'}{self.x(x):.1f} {self.y(value):.1f}")
            pen_is_down = True
        style = f'fill="none" stroke="{colour}" stroke-width="{width}"' + (f' stroke-dasharray="{dash}"' if dash else "")
        self.parts.append(f'<path d="{"".join(path)}" {style} stroke-linejoin="round"/>')
        if label:
            self.legend.append((label, f'<path d="M0 -4H22" {style}/>'))

    def held(self, xs, values, colour):
        """Each value lasts until the next."""
        path = "".join(f"H{self.x(x):.1f}V{self.y(value):.1f}" for x, value in zip(xs, values))
        self.parts.append(f'<path d="M{self.x(xs[0]):.1f} {self.y(values[0]):.1f}{path}" fill="none" stroke="{colour}" '
                          'stroke-width="1.2"/>')

    def dots(self, xs, values, colour, label=""):
        self.parts.append(f'<g fill="{colour}" fill-opacity="0.6">' + "".join(
            f'<circle cx="{self.x(x):.1f}" cy="{self.y(value):.1f}" r="1.5"/>' for x, value in zip(xs, values)) + "</g>")
        if label:
            self.legend.append((label, f'<circle cx="11" cy="-4" r="3" fill="{colour}"/>'))

    def band(self, xs, lows, highs, colour, label=""):
        forth = [f"{self.x(x):.1f} {self.y(high):.1f}" for x, high in zip(xs, highs)]
        back = [f"{self.x(x):.1f} {self.y(low):.1f}" for x, low in zip(xs, lows)]
        self.parts.append(f'<path d="M{"L".join(forth + back[::-1])}Z" fill="{colour}" fill-opacity="0.15"/>')
        if label:
            self.legend.append((label, f'<rect y="-10" width="22" height="12" fill="{colour}" fill-opacity="0.25"/>'))

    def level(self, value, text, colour=GREY):
        """A horizontal line across the panel with words at its left end."""
        y = self.y(value)
        self.parts.append(f'<path d="M{self.left:.1f} {y:.1f}H{self.right:.1f}" stroke="{colour}" stroke-dasharray="2 4"/>'
                          f'<text x="{self.left + 6:.1f}" y="{y - 5:.1f}" fill="{colour}">{html.escape(text)}</text>')

    def mark(self, x, text, colour=GREY, below_px=14, anchor="start"):
        """A vertical line across the panel with a word beside it."""
        self.parts.append(f'<path d="M{self.x(x):.1f} {self.top}V{self.top + self.height}" stroke="{colour}" '
                          'stroke-dasharray="2 4"/>')
        self.note(x, text, colour, below_px, anchor)

    def note(self, x, text, colour=GREY, below_px=14, anchor="start"):
        at = self.x(x) + (5 if anchor == "start" else -5)
        self.parts.append(f'<text x="{at:.1f}" y="{self.top + below_px}" text-anchor="{anchor}" fill="{colour}">'
                          f'{html.escape(text)}</text>')

    def axes(self):
        bottom, out = self.top + self.height, []
        values, decimals = ticks(*self.y_range, max(3, self.height // 25))
        for value in values:
            out.append(f'<path d="M{self.left:.1f} {self.y(value):.1f}H{self.right:.1f}" stroke="{GRID}"/>'
                       f'<text x="{self.left - 8:.1f}" y="{self.y(value) + 4:.1f}" text-anchor="end">'
                       f'{number(value, decimals)}</text>')
        if self.x_log:
            decades = range(round(math.log10(self.x_range[0])), round(math.log10(self.x_range[1])) + 1)
            at = [(10.0 ** k, f"{10.0 ** k:g}") for k in decades]
            at += [(m * 10.0 ** k, "") for k in decades[:-1] for m in range(2, 10)]
        else:
            values, decimals = ticks(*self.x_range, max(3, int(self.right - self.left) // 80))
            at = [(value, number(value, decimals)) for value in values]
        for value, text in at:
            out.append(f'<path d="M{self.x(value):.1f} {self.top}V{bottom}" stroke="{GRID}"/>')
            if text:
                out.append(f'<text x="{self.x(value):.1f}" y="{bottom + 17}" text-anchor="middle">{text}</text>')
        out.append(f'<rect x="{self.left:.1f}" y="{self.top}" width="{self.right - self.left:.1f}" height="{self.height}" '
                   f'fill="none" stroke="{FRAME}"/>')
        return "".join(out)

    def heading(self):
        out = [f'<text x="{self.left:.1f}" y="{self.top - 8}" font-weight="600" fill="{INK}">{html.escape(self.title)}</text>']
        x = self.right
        for label, mark in reversed(self.legend):
            x -= LETTER_PX * len(label) + 30
            out.append(f'<g transform="translate({x:.1f} {self.top - 8})">{mark}'
                       f'<text x="28" fill="{INK}">{html.escape(label)}</text></g>')
            x -= 14
        return "".join(out)


class Plot:
    def __init__(self, title, subtitle):
        self.title, self.subtitle, self.panels, self.bottom, self.end = title, subtitle, [], TITLE_PX, ""

    def panel(self, title, height, x, y, **more):
        """`part` (0 to 1, from left to right) leaves room for another, which `beside` puts there."""
        self.top = self.bottom + LEGEND_PX + (GAP_PX - 10 if self.panels else 4)
        self.bottom = self.top + height
        return self.beside(title, height, x, y, **more)

    def beside(self, title, height, x, y, **more):
        self.panels.append(Panel(title, self.top, height, x, y, **more))
        return self.panels[-1]

    def x_title(self, text):
        self.end = (f'<text x="{(LEFT + WIDTH - RIGHT) / 2}" y="{self.bottom + 36}" text-anchor="middle" '
                    f'font-weight="600" fill="{INK}">{html.escape(text)}</text>')

    def svg(self):
        height = self.bottom + X_TITLE_PX + 6
        clips = "".join(f'<clipPath id="p{i}"><rect x="{p.left:.1f}" y="{p.top}" '
                        f'width="{p.right - p.left:.1f}" height="{p.height}"/></clipPath>' for i, p in enumerate(self.panels))
        panels = "".join(f'{p.axes()}<g clip-path="url(#p{i})">{"".join(p.parts)}</g>{p.heading()}\n'
                         for i, p in enumerate(self.panels))
        return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" '
                f'height="{height}" role="img" font-family="system-ui, sans-serif" font-size="12" fill="{GREY}">'
                f'<title>{html.escape(self.title)}: {html.escape(self.subtitle)}</title><defs>{clips}</defs>\n'
                f'<rect width="100%" height="100%" fill="#fff"/>'
                f'<text x="{LEFT}" y="22" font-size="15" font-weight="600" fill="{INK}">{html.escape(self.title)}</text>'
                f'<text x="{LEFT}" y="40">{html.escape(self.subtitle)}</text>\n{panels}{self.end}</svg>\n')
