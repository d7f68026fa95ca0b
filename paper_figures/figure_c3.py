"""Contact figure 3: Tables 1, 2, 3 of Wang, Liu and Ma, as printed and as their equations give them."""

from paper_figures.sources import clearance_joint, closed_form
from pwsmooth.figures import Claim
from pwsmooth.laws.contact import HertzImpact, LiuImpact, composite_modulus, effective_restitution
from pwsmooth.plotting import new_figure
from pwsmooth.scenes import free_impact

NAME = "c3"
TITLE = "Restitution of the clearance-joint laws: the source's tables"
CAPTION = """
Tables 1 to 3 of Wang, Liu, Ma, J. Mech. Sci. Tech. 30 (2016) 1537-1545: rebound speed (m/s) and effective restitution
as printed, and ours: an event-driven impact of a unit mass beside the closed form, which depends on c_r alone.
Baseline: impact speed 0.3 m/s, c_r = 0.5. Mimp: their law; ML-N: Lankarani and Nikravesh's. Steel and joint length
20 mm assumed (they do not matter); the clearance, in mm here, is printed without a unit. The marked row does not
reproduce to its four digits; a coarse integration in the source would explain it. Printed restitutions are ratios of
the rounded speeds.
"""
# (table, law, c_r, clearance in mm, speed factor, printed rebound speed, printed restitution)
ROWS = [
    *((1, law, 0.5, c, 1, v, e) for law, v, e in (("Mimp", 0.1448, 0.4827), ("ML-N", 0.2176, 0.7253))
      for c in (0.01, 0.1, 0.5, 1)),
    *((2, "Mimp", c_r, 0.1, 1, v, e) for c_r, v, e in ((0.3, 0.098, 0.3267), (0.5, 0.1448, 0.4827),
                                                        (0.9, 0.2687, 0.8957), (1, 0.3, 1.0))),
    *((2, "ML-N", c_r, 0.1, 1, v, e) for c_r, v, e in ((0.3, 0.2053, 0.6843), (0.5, 0.2176, 0.7253),
                                                        (0.9, 0.274, 0.9133), (1, 0.3, 1.0))),
    *((3, "Mimp", 0.5, 0.1, k, v, e) for k, v, e in ((1, 0.1448, 0.4827), (3, 0.4343, 0.4826), (5, 0.7239, 0.4826),
                                                      (10, 1.4478, 0.4826))),
    *((3, "ML-N", 0.5, 0.1, k, v, e) for k, v, e in ((1, 0.2176, 0.7253), (3, 0.6527, 0.7252), (5, 1.0879, 0.7253),
                                                      (10, 2.1757, 0.7252))),
]  # fmt: skip


def ours():
    """For every row the rebound speed of an integrated impact, and the closed form's."""
    E = composite_modulus(207e9, 0.3)
    scenes = {
        "Mimp": free_impact(LiuImpact(E_star=E, length=0.02, clearance=1e-4, c_r=0.5), speed=0.3),
        "ML-N": free_impact(HertzImpact(K=5e9, c_r=0.5), speed=0.3),
    }
    names = {"Mimp": "wang-liu-ma", "ML-N": "lankarani-nikravesh"}
    found = []
    for _, law, c_r, c, factor, _, _ in ROWS:
        scene, speed = scenes[law], 0.3 * factor
        values = {"c_r": c_r} | ({"clearance": 1e-3 * c} if law == "Mimp" else {})
        start = dict(scene.start) | {"v": speed, "speed": speed}
        run = scene.solve((0, 0.01), start, parameters=values, rtol=1e-12, atol=[1e-18, 1e-15, 1e-15])
        found.append((-run["v"][-1], speed * effective_restitution(names[law], c_r)))
    return found


def _agrees(printed, value, unit=1e-4):
    return abs(printed - value) <= 0.5 * unit * (1 + 1e-9)


def claims(found):
    """Every printed speed; the restitutions follow from them."""
    result = []
    for (table, law, c_r, c, factor, v, e), (value, exact) in zip(ROWS, found):
        where = f"Table {table}, {law}, c_r = {c_r:g}, c = {c:g}, {factor:g} x 0.3 m/s"
        result.append(
            Claim(
                f"{where}: rebound speed and restitution",
                f"{v:g} / {e:g}",
                f"{value:.6f} / {value / (0.3 * factor):.6f}",
                bool(_agrees(v, value) and abs(e - v / (0.3 * factor)) <= 0.5e-4 + 1e-9),
                f"exact {exact:.6f}: off by {v - exact:.1e} m/s, consistent with a coarse integration in the source"
                if not _agrees(v, value)
                else "its restitution is rounded otherwise",
                **clearance_joint("Tables 1 to 3"),
            )
        )
    worst = max(abs(a - b) / b for a, b in found)
    result.append(
        Claim(
            "integrated impacts agree with the closed form, and depend neither on c nor on the speed",
            "the same in all columns",
            f"within {worst:.1e}",
            bool(worst < 1e-9),
            "they do not",
            **closed_form(),
        )
    )
    return result


def draw(fast):
    """Three tables side by side, the row that differs marked."""
    found = ours()
    figure = new_figure(7.4, 3.45)
    heads = {1: "Table 1: clearance c", 2: "Table 2: restitution $c_r$", 3: "Table 3: impact speed"}
    for ax, (table, title) in zip(figure.subplots(1, 3), heads.items()):
        ax.set_axis_off()
        ax.set_title(title)
        cells, colours = [], []
        for (number, law, c_r, c, factor, v, e), (value, _) in zip(ROWS, found):
            if number != table:
                continue
            varied = {1: f"{c:g}", 2: f"{c_r:g}", 3: rf"{factor:g}$\times$"}[table]
            cells.append([law, varied, f"{v:.4f}", f"{value:.5f}", f"{e:.4f}", f"{value / (0.3 * factor):.5f}"])
            colours.append(["#FFD9B3" if not _agrees(v, value) else "white"] * 6)
        head = ["law", {1: "c", 2: "$c_r$", 3: "speed"}[table], "$v^+$\nprinted", "$v^+$\nours", "$e$\nprinted",
                "$e$\nours"]  # fmt: skip
        drawn = ax.table(cells, cellColours=colours, colLabels=head, loc="upper center", cellLoc="center",
                         colWidths=[0.17, 0.14, 0.18, 0.19, 0.18, 0.19])  # fmt: skip
        drawn.auto_set_font_size(False)
        drawn.set_fontsize(6.5)
        drawn.scale(1, 1.5)
        for (row, _), cell in drawn.get_celld().items():
            cell.set_linewidth(0.4)
            if row == 0:
                cell.set_height(2 * cell.get_height())
    return figure, claims(found)
